"""Claims about ``ballpass trade`` and ``ballpass run --error``: what they print and leave."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import Result

from ballpass.runtime.app.commands.run import relative_error

ROOT = Path(__file__).resolve().parent.parent
NAME = "varying_compliance"


@pytest.fixture(scope="module", autouse=True)
def scene(site: Path) -> None:
    """A short version of a scene in the working directory."""
    text = (ROOT / "scenes" / f"{NAME}.toml").read_text(encoding="utf-8")
    short = text.replace("cycles = 24 ", "cycles = 3 ").replace("transient_cycles = 20 ", "transient_cycles = 1 ")
    short = short.replace("samples_per_cycle = 2000", "samples_per_cycle = 200")
    assert short != text
    (site / f"{NAME}.toml").write_text(short, encoding="utf-8")


@pytest.mark.long
def test_a_trade_prints_what_an_error_costs_and_leaves_figures(ballpass: Callable[..., Result], site: Path) -> None:
    done = ballpass("trade", f"{NAME}.toml", "--members", "3")
    assert done.exit_code == 0, done.output
    assert "1 % on peak_ball_force: " in done.stdout
    assert "The reference, two methods that agree" in done.stdout
    results = site / "results" / NAME
    for quantity in ("peak_ball_force", "rms_inner_x", "range_inner_y"):
        assert (results / f"trade_{quantity}.png").read_bytes().startswith(b"\x89PNG")
    assert [path.name for path in results.iterdir() if path.suffix != ".png"] == ["trade.md"]


def test_a_trade_is_one_json_object_and_follows_its_settings(ballpass: Callable[..., Result], site: Path) -> None:
    words = ["trade", f"{NAME}.toml", "--members", "2", "--of", "peak_ball_force", "--json", "--no-figures"]
    peaks = []
    for setting in ([], ["--set", "load.force.x=150 N"]):
        done = ballpass(*words, *setting, "--out", "lighter")
        assert done.exit_code == 0, done.output
        data = json.loads(done.stdout)
        assert data["trade"]["members"] == 2
        assert {one["way"]["kinks"] for one in data["trade"]["measured"]} == {"stepped-over", "located"}
        peaks.append(data["trade"]["values"]["peak_ball_force"])
    assert peaks[1] < 0.9 * peaks[0]
    assert not (site / "lighter").exists()


@pytest.mark.long
def test_run_and_sweep_take_any_quantity_and_refuse_in_the_same_words(ballpass: Callable[..., Result]) -> None:
    """And at the same options as the summary's own peak; a name that is none is refused alike."""
    of = ("peak_ball_force", "kurtosis:inner.y", "value:inner.y@240deg", "peak_time:ball.force")
    asked = [word for name in of for word in ("--of", name)]
    done = ballpass("run", f"{NAME}.toml", *asked, "--kinks", "located", "--no-figures", "--json")
    assert done.exit_code == 0, done.output
    summary = json.loads(done.stdout)
    found = {name: one["value"] for name, one in summary["quantities"].items()}
    assert found["peak_ball_force"] == summary["peak_ball_force"]["total"]
    vary = (
        "--vary",
        "bearing.clearance=9 um:10 um:2",
        "--set",
        "load.force.x=0 N",
        "--kinks",
        "located",
        "--no-figures",
    )
    swept = ballpass("sweep", f"{NAME}.toml", *asked, *vary, "--json")
    assert swept.exit_code == 0, swept.output
    told = ballpass("run", f"{NAME}.toml", *asked, "--kinks", "located", "--no-figures")
    assert all(any(line.split()[:1] == [name] for line in told.stdout.splitlines()) for name in of)
    said = set()
    for command in (["run"], ["run", "--error", "1%"], ["sweep", *vary], ["trade"]):
        wrong = ballpass(*command[:1], f"{NAME}.toml", *command[1:], "--of", "mx:inner.y")
        assert wrong.exit_code == 2, wrong.output
        said.add(wrong.stderr.partition("error: ")[2])
    assert len(said) == 1


def test_a_named_error_tells_choice_estimate_and_cost(ballpass: Callable[..., Result]) -> None:
    of = ["--of", "peak_ball_force", "--of", "rms:inner.y"]
    arguments = ["run", f"{NAME}.toml", "--error", "1%", *of, "--no-figures"]
    done = ballpass(*arguments, "--json")
    assert done.exit_code == 0, done.output
    accuracy = json.loads(done.stdout)["accuracy"]
    assert accuracy["target"] == 0.01
    assert accuracy["estimate"] < 0.01
    assert accuracy["check_time"] > 0.0
    told = ballpass(*arguments)
    assert "error asked for 1 %" in told.stdout
    for name, factor, unit in (("peak_ball_force", 1.0, "N"), ("rms:inner.y", 1e6, "µm")):
        (row,) = (line.split() for line in told.stdout.splitlines() if line.split()[:1] == [name])
        value, error = factor * accuracy["values"][name], accuracy["estimates"][name]
        # as many digits as the error leaves
        assert row[1] == f"{value:.{math.ceil(-math.log10(error))}g}"
        assert row[2:] == [f"{100 * accuracy['estimates'][name]:.2g}", "%", unit]
    assert f"by {accuracy['method']} at rtol" in told.stdout
    assert accuracy["check"] in told.stdout


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--error", "soon"], "is not a relative error"),
        (["--error", "-1%"], "no error that can be asked for"),
        (["--error", "1%", "--rtol", "1e-6"], "or the error"),
        (["--error", "1%", "--of", "peak_ball_farce"], "peak_ball_force"),
    ],
)
def test_wrong_requests_are_refused_with_exit_code_2(
    ballpass: Callable[..., Result], arguments: list[str], words: str
) -> None:
    done = ballpass("run", f"{NAME}.toml", "--no-figures", *arguments)
    assert done.exit_code == 2
    assert words in done.output


def test_an_error_that_nothing_keeps_is_refused_with_exit_code_1(ballpass: Callable[..., Result]) -> None:
    arguments = ["--no-figures", "--error", "1e-8", "--of", "range_inner_y", "--set", "load.force.x=2 N"]
    arguments += ["--set", "bearing.inner_ring.damping=1 N*s/m"]
    done = ballpass("run", f"{NAME}.toml", *arguments)
    assert done.exit_code == 1, done.output
    assert "The best is" in done.output


def test_percent_signs_and_plain_numbers_mean_the_same() -> None:
    assert relative_error("1%") == relative_error(" 1 % ") == relative_error("0.01") == 0.01


def test_a_scene_without_a_bearing_has_nothing_to_trade(ballpass: Callable[..., Result], site: Path) -> None:
    text = (ROOT / "scenes" / "four_bar.toml").read_text(encoding="utf-8")
    bare = (
        text[: text.index("[bearing]")]
        + text[text.index("[run]") : text.index("outputs = ")]
        + 'outputs = ["drive_torque"]'
    )
    (site / "bare.toml").write_text(bare, encoding="utf-8")
    done = ballpass("trade", "bare.toml")
    assert done.exit_code == 2
    assert "this scene has no states" in done.output
    assert not (site / "generated" / "bare").exists()
