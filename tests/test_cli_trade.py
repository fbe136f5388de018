"""Claims about ``ballpass trade`` and ``ballpass run --error``: what they print, leave and use again."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ballpass.derive import read_scene
from ballpass.runtime import RequestError, load, load_trade
from ballpass.runtime.app.cli import app
from ballpass.runtime.app.commands.trade import key_of, models_of, read_error, stored_trade
from ballpass.runtime.certify.stored_trade import FILE_NAME

ROOT = Path(__file__).resolve().parent.parent
NAME = "varying_compliance"


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with a short version of a scene, in which a trade has been measured."""
    folder = tmp_path_factory.mktemp("trade")
    text = (ROOT / "scenes" / f"{NAME}.toml").read_text(encoding="utf-8")
    short = text.replace("cycles = 24 ", "cycles = 3 ").replace("transient_cycles = 20 ", "transient_cycles = 1 ")
    short = short.replace("samples_per_cycle = 2000", "samples_per_cycle = 200")
    assert short != text
    (folder / f"{NAME}.toml").write_text(short, encoding="utf-8")
    before = Path.cwd()
    os.chdir(folder)
    try:
        done = CliRunner().invoke(app, ["trade", f"{NAME}.toml", "--members", "3"])
        assert done.exit_code == 0, done.output
        (folder / "said.txt").write_text(done.stdout, encoding="utf-8")
        yield folder
    finally:
        os.chdir(before)


def test_a_trade_leaves_data_and_figures_and_says_what_an_error_costs(place: Path) -> None:
    results = place / "results" / NAME
    data = json.loads((results / FILE_NAME).read_text(encoding="utf-8"))
    assert data["trade"]["members"] == 3
    assert data["words"]
    for quantity in data["trade"]["quantities"]:
        assert (results / f"trade_{quantity}.png").read_bytes().startswith(b"\x89PNG")
    said = (place / "said.txt").read_text(encoding="utf-8")
    for line in data["words"]:
        assert line in said
    methods = {one["configuration"]["method"] for one in data["trade"]["measured"]}
    assert methods >= {"stepper", "stepper-rodas4", "quasi-static", "rosenbrock", "erk", "cvodes"}
    assert {one["configuration"]["switch"] for one in data["trade"]["measured"]} == {
        "",
        "fast-math",
        "kinks located",
    }


def test_a_trade_of_other_numbers_is_kept_for_these_numbers_alone(place: Path) -> None:
    """`run --error` takes no measurement of other numbers for one of the scene."""
    setting = ("--set", "load.force.x=150 N")
    words = ("trade", f"{NAME}.toml", "--members", "2", "--of", "peak_ball_force", "--no-figures", "--out", "lighter")
    done = CliRunner().invoke(app, [*words, *setting])
    assert done.exit_code == 0, done.output
    data = json.loads((place / "lighter" / FILE_NAME).read_text(encoding="utf-8"))
    key = key_of(read_scene(place / f"{NAME}.toml"), ["peak_ball_force"], 2)
    assert {name for name in key if key[name] != data["key"][name]} == {"numbers"}
    arguments = ["run", f"{NAME}.toml", "--error", "1%", "--of", "peak_ball_force", "--no-figures", "--json"]
    run = CliRunner().invoke(app, [*arguments, "--out", "lighter"])
    assert run.exit_code == 0, run.output
    assert "no trade of this scene was measured" in json.loads(run.stdout)["accuracy"]["reason"]
    run = CliRunner().invoke(app, [*arguments, "--out", "lighter", *setting])
    assert run.exit_code == 0, run.output
    reason = json.loads(run.stdout)["accuracy"]["reason"]
    assert "the scene's trade allows" in reason
    assert "other numbers" not in reason


def test_a_measurement_is_used_again_until_the_scene_changes(place: Path) -> None:
    stored = place / "results" / NAME / FILE_NAME
    before = stored.stat().st_mtime_ns
    again = CliRunner().invoke(app, ["trade", f"{NAME}.toml", "--members", "3", "--json", "--no-figures"])
    assert again.exit_code == 0, again.output
    assert json.loads(again.stdout) == json.loads(stored.read_text(encoding="utf-8"))
    assert stored.stat().st_mtime_ns == before
    scene = read_scene(place / f"{NAME}.toml")
    key = key_of(scene, None, 3)
    assert stored_trade(stored.parent, key) is not None
    number = scene.quantities[0]
    changed = replace(scene, quantities=(replace(number, value=2.0 * number.value), *scene.quantities[1:]))
    for other in (key_of(changed, None, 3), key_of(scene, ["peak_ball_force"], 3), key_of(scene, None, 4)):
        assert stored_trade(stored.parent, other) is None
    newer = {**key, "versions": {**key["versions"], "ballpass": "99"}}
    assert stored_trade(stored.parent, newer) is None


def test_a_named_error_begins_where_the_trade_says_and_tells_choice_estimate_and_cost(place: Path) -> None:
    arguments = ["run", f"{NAME}.toml", "--error", "1%", "--of", "peak_ball_force", "--no-figures"]
    done = CliRunner().invoke(app, [*arguments, "--json"])
    assert done.exit_code == 0, done.output
    accuracy = json.loads(done.stdout)["accuracy"]
    assert accuracy["target"] == 0.01
    assert accuracy["estimate"] < 0.01
    assert accuracy["reason"].startswith("the cheapest that the scene's trade allows")
    assert accuracy["companion_time"] > 0.0
    told = CliRunner().invoke(app, arguments)
    assert "error asked for 1 %" in told.stdout
    assert f"{accuracy['method']} at rtol" in told.stdout


def test_the_full_model_can_be_asked_for(place: Path) -> None:
    """On this scene the quasi-static model is right to a hundredth of a per cent, and faster."""
    arguments = ["run", f"{NAME}.toml", "--error", "0.1%", "--of", "peak_ball_force", "--no-figures", "--json"]
    done = CliRunner().invoke(app, [*arguments, "--full-model"])
    assert done.exit_code == 0, done.output
    accuracy = json.loads(done.stdout)["accuracy"]
    assert accuracy["method"] != "quasi-static"
    assert accuracy["model"] == "full"
    assert "a simpler model" not in accuracy["reason"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--error", "soon"], "is no relative error"),
        (["--error", "-1%"], "is no relative error"),
        (["--error", "1%", "--rtol", "1e-6"], "Give one or the"),
        (["--of", "peak_ball_force"], "Add --error"),
        (["--error", "1%", "--of", "peak_ball_farce"], "peak_ball_force"),
    ],
)
def test_wrong_requests_are_refused_with_exit_code_2(place: Path, arguments: list[str], words: str) -> None:
    done = CliRunner().invoke(app, ["run", f"{NAME}.toml", "--no-figures", *arguments])
    assert done.exit_code == 2
    assert words in done.output


def test_an_error_that_nothing_keeps_is_refused_with_exit_code_1(place: Path) -> None:
    done = CliRunner().invoke(
        app,
        [
            "run",
            f"{NAME}.toml",
            "--no-figures",
            "--error",
            "1e-8",
            "--of",
            "range_inner_y",
            "--set",
            "load.force.x=2 N",
        ],
    )
    assert done.exit_code == 1, done.output
    assert "The best is" in done.output


def test_percent_signs_and_plain_numbers_mean_the_same() -> None:
    assert read_error("1%", None, None, None) == read_error(" 1 % ", None, None, None) == 0.01
    assert read_error("0.01", None, None, None) == 0.01
    assert read_error(None, None, None, None) is None


def test_simpler_models_are_the_scene_with_another_structural_choice() -> None:
    scene = read_scene(ROOT / "scenes" / "punching_press.toml")
    models = models_of(scene)
    assert list(models) == ["full", "the outer ring fixed"]
    for name, model in models.items():
        assert model.bearing is not None
        assert scene.bearing is not None
        assert (model.bearing.outer is None) == (name == "the outer ring fixed")
        assert model.mechanism == scene.mechanism
        assert model.quantities == scene.quantities


def test_a_scene_without_a_bearing_has_nothing_to_trade() -> None:
    scene = replace(read_scene(ROOT / "scenes" / "four_bar.toml"), bearing=None)
    with pytest.raises(RequestError, match="no bearing"):
        models_of(scene)


@pytest.mark.parametrize("damage", [b"\xff\xfe", b"[]", b'{"schema": 3', b"edited"])
def test_a_damaged_measurement_is_said_and_not_used(place: Path, damage: bytes) -> None:
    folder = place / "damaged"
    folder.mkdir(exist_ok=True)
    whole = (place / "results" / NAME / FILE_NAME).read_bytes()
    spoilt = whole.replace(b'"members": 3', b'"members": 4', 1) if damage == b"edited" else damage
    assert spoilt != whole
    (folder / FILE_NAME).write_bytes(spoilt)
    arguments = ["run", f"{NAME}.toml", "--error", "1%", "--of", "peak_ball_force", "--no-figures", "--json"]
    done = CliRunner().invoke(app, [*arguments, "--out", "damaged"])
    assert done.exit_code == 0, done.output
    assert "is damaged or was edited by hand, and is not used" in " ".join(done.stderr.split())
    assert "no trade of this scene was measured" in json.loads(done.stdout)["accuracy"]["reason"]
    assert (folder / FILE_NAME).read_bytes() == spoilt
    with pytest.raises(RequestError, match="is damaged or was edited by hand, and is not used"):
        load_trade("damaged")


def test_a_stored_measurement_serves_python_as_it_serves_the_command(place: Path) -> None:
    trade = load_trade(place / "results" / NAME)
    arguments = ["run", f"{NAME}.toml", "--error", "1%", "--of", "peak_ball_force", "--no-figures", "--json"]
    done = CliRunner().invoke(app, [*arguments, "--full-model"])
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)["accuracy"]
    solution = load("generated/varying_compliance").simulate(
        error=0.01, of="peak_ball_force", trade=trade, models="full"
    )
    assert solution.accuracy is not None
    assert (solution.accuracy.method, solution.accuracy.rtol) == (told["method"], told["rtol"])
    assert "trade" in solution.accuracy.reason
    assert solution.accuracy.reason == told["reason"]


def test_a_folder_without_a_measurement_of_this_version_says_what_to_do(place: Path, tmp_path: Path) -> None:
    with pytest.raises(
        RequestError, match=r"trade\.json: cannot be read \(No such file or directory\)\. .*ballpass trade"
    ):
        load_trade(tmp_path)
    data = json.loads((place / "results" / NAME / FILE_NAME).read_text(encoding="utf-8"))
    (tmp_path / FILE_NAME).write_text(json.dumps({**data, "schema": 1}), encoding="utf-8")
    with pytest.raises(RequestError, match=r"another version.*--fresh"):
        load_trade(tmp_path)
