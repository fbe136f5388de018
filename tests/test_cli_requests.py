"""Claims about requests of the command line: a run of a given time, numbers given twice, what no bearing can be."""

from __future__ import annotations

import json
import os
import signal
import threading
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from typer.main import get_command
from typer.testing import Result

from ballpass.derive import SceneError
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model, RequestError, load_solution
from ballpass.runtime.app.cli import app

ROOT = Path(__file__).resolve().parent.parent
SCENE = ROOT / "scenes" / "varying_compliance.toml"


def test_a_shaft_at_rest_runs_for_a_time_and_comes_to_rest_at_the_static_point(
    site: Path, ballpass: Callable[..., Result]
) -> None:
    """3.9937 um is the static deflection with a ball on the load line; transients fall like exp(-t/0.2 s)."""
    words = ("--duration", "2500 ms", "--transient", "0", "--set", "shaft.speed=0 rpm", "--no-figures", "--out", "rest")
    done = ballpass("run", SCENE, *words)
    assert done.exit_code == 0, done.output
    solution = load_solution(site / "rest" / "solution.nc")
    assert solution.t[-1] == 2.5
    assert solution["inner.x"][-1] == pytest.approx(3.9937e-6, rel=2e-5)
    assert solution["inner.vx"][-1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("time", "told"),
    [
        ("-1s", "from 0 on"),
        ("1e300s", "at most 1e+09 s"),
        ("9e8s", "Allowed: up to 1e+09 turns"),  # the angle has no digit left that counts
    ],
)
@pytest.mark.parametrize("question", [("linearize",), ("jacobian", "--of", "rhs", "--wrt", "states")])
def test_instants_at_which_nothing_is_known_are_refused(
    ballpass: Callable[..., Result], question: tuple[str, ...], time: str, told: str
) -> None:
    done = ballpass(question[0], SCENE, *question[1:], "--time", time)
    assert done.exit_code == 2, done.output
    assert told in " ".join(done.output.split())


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--duration", "1 s", "--cycles", "2"), "both given"),
        (("--method", "cvodes", "--kinks", "located"), "cannot end its steps"),
        (("--duration", "1"), "unit is missing"),
        (("--duration", "1 mm"), "dimension"),
        (("--duration", "0 s"), "a time above 0"),
        (("--duration", "0.1 s"), "nothing is left"),
        (("--cycles", "2", "--set", "shaft.speed=0 rpm"), "Give duration in seconds"),
        (("--duration", "1 s", "--set", "shaft.speed=0 rpm"), "Set it to 0"),
        (("--set", "run.duration=2 s"), "--duration 2 s"),
        (("--set", "load.force.x=1 N", "--set", "load.force.x=2 N"), "1 N and 2 N"),
        (("--set", "load.force.x=1 N", "--set", "load.force.x = 1 N"), "set twice"),
        (("--set", "bearing.clearance=-8 mm"), "preload (a negative clearance) is as large as a ball"),
        (("--format", "jpg"), "'jpg' is none of the choices. Allowed: png, svg, pdf"),
    ],
)
def test_contradictions_and_nonsense_end_with_exit_code_2_and_no_folder(
    site: Path, ballpass: Callable[..., Result], words: tuple[str, ...], told: str
) -> None:
    done = ballpass("run", SCENE, *words, "--out", "never")
    assert done.exit_code == 2, done.output
    assert told in done.stderr
    assert "error: error" not in done.stderr
    assert not (site / "never").exists()


def test_a_value_in_quotes_as_in_a_scene_file_is_taken(ballpass: Callable[..., Result]) -> None:
    """A shell removes one pair of quotes; `'path="20 um"'` has two.  Both before and after the model is generated."""
    words = ("--no-figures", "--cycles", "1", "--transient", "0", "--json")
    plain = json.loads(ballpass("run", SCENE, *words, "--set", "bearing.clearance=20 um").stdout)
    for quoted in ('bearing.clearance="20 um"', "bearing.clearance = '20 um'"):
        done = ballpass("run", SCENE, *words, "--set", quoted)
        assert json.loads(done.stdout)["peak_ball_force"] == plain["peak_ball_force"], done.output
    odd = ballpass("run", SCENE, *words, "--set", 'bearing.clearance="20 um')
    assert (odd.exit_code, "no number in front" in odd.stderr) == (2, True)


def test_export_says_what_it_wrote_and_how_to_run_it(site: Path, ballpass: Callable[..., Result]) -> None:
    done = ballpass("export", SCENE, "--c", "--out", "a program")
    assert done.stdout == "a program\n"
    assert "make -C 'a program' run builds it" in done.stderr
    assert "README.md" in done.stderr
    assert (site / "a program" / "README.md").is_file()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--format", "avi"), "Allowed: html, mp4, gif"),
        (("--pictures", "9"), "--pictures is of movies"),
        (("--last", "9"), "Simulate more turns, or show fewer"),
        (("--pictures", "1"), "Allowed: a whole number from 2 on"),
        (("--last", "nan"), "--last: nan lies outside its bounds. Allowed: a number above 0"),
        (("--format", "mp4"), "ffmpeg, which is not on PATH"),
        (("--bearing", "left"), "no bearing 'left'. There are: none, for the only bearing has no name."),
    ],
)
def test_animations_that_cannot_be_end_with_exit_code_2(
    site: Path, ballpass: Callable[..., Result], words: tuple[str, ...], told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if "mp4" in words:
        monkeypatch.setenv("PATH", str(site))
    done = ballpass("animate", SCENE, *words, "--out", "moving")
    assert done.exit_code == 2, done.output
    assert ("simulating" in done.stderr) == (words == ("--last", "9"))  # what can be known before is told before
    assert told in " ".join(done.stderr.split())
    assert not list(site.glob("moving/*"))


def test_out_names_the_file_and_its_kind(site: Path, ballpass: Callable[..., Result]) -> None:
    """A GIF begins with its name; a folder that is called like one stays a folder."""
    words = ("--cycles", "1", "--transient", "0", "--pictures", "2")
    done = ballpass("animate", SCENE, *words, "--out", "films/x.gif")
    assert done.exit_code == 0, done.output
    assert (site / "films" / "x.gif").read_bytes().startswith(b"GIF8")
    assert [path.name for path in (site / "films").iterdir()] == ["x.gif"]
    done = ballpass("animate", SCENE, *words, "--format", "mp4", "--out", "films/x.gif")
    assert done.exit_code == 2, done.output
    assert "name two kinds of files" in done.stderr
    (site / "folder.gif").mkdir()
    done = ballpass("animate", SCENE, *words, "--format", "gif", "--out", "folder.gif")
    assert done.stdout.startswith("folder.gif/animation.gif (")


def test_animate_writes_the_page_of_the_last_turns(site: Path, ballpass: Callable[..., Result]) -> None:
    done = ballpass("animate", SCENE, "--cycles", "4", "--transient", "1", "--last", "2", "--out", "moving")
    assert done.exit_code == 0, done.output
    assert done.stdout.startswith("moving/animation.html (")
    text = (site / "moving" / "animation.html").read_text(encoding="utf-8")
    numbers = json.loads(text.partition('id="data">')[2].partition("</script>")[0])
    angles = np.array(numbers["angle"]["values"]) / 10.0 ** numbers["angle"]["decimals"]
    assert angles[-1] - angles[0] == pytest.approx(720.0, abs=1e-2)
    assert len(angles) == pytest.approx(1000, abs=3)
    assert numbers["linkage"] is None
    assert len(numbers["bearings"]) == 1


@pytest.mark.parametrize("clearance", ["-7.9375 mm", "-1 m"])
def test_a_preload_of_a_balls_diameter_is_refused_in_a_file(scene_text: Callable[..., str], clearance: str) -> None:
    """There is room for no ball then."""
    with pytest.raises(SceneError, match="as large as a ball"):
        scene_from_text(
            scene_text("varying_compliance", ('clearance = "0 um" ', f'clearance = "{clearance}" ')), "wide"
        )


def test_a_preload_of_a_balls_diameter_is_refused_in_python(make_model: Callable[..., Model]) -> None:
    model = make_model("varying_compliance")
    ball = model.parameters["bearing.ball_diameter"]
    with pytest.raises(RequestError, match=r"bearing\.clearance"):
        model.numbers({"bearing.clearance": -ball})
    result = model.simulate_many({"bearing.clearance": [0.0, -ball]}, "peak_ball_force", cycles=1, transient=0)
    assert [failure.member for failure in result.failures] == [1]
    for clearance in (-np.nextafter(ball, 0.0), 1.0):
        assert model.numbers({"bearing.clearance": clearance}).values["bearing.clearance"] == clearance


@pytest.mark.parametrize("error", [np.float32(0.01), np.float64(0.01), Fraction(1, 100)])
def test_an_error_may_be_any_real_number(make_model: Callable[..., Model], error: float) -> None:
    model = make_model("varying_compliance")
    found = model.simulate(cycles=3, transient=1, samples_per_cycle=50, error=error, of="peak_ball_force").accuracy
    assert found is not None
    assert found.target == pytest.approx(0.01, rel=1e-6)
    assert type(found.target) is float


@pytest.mark.parametrize("error", [True, "0.01", [0.01], float("nan"), 0.0, 2.0])
def test_an_error_that_is_none_is_refused_without_a_doubled_word(
    make_model: Callable[..., Model], error: float
) -> None:
    model = make_model("varying_compliance")
    with pytest.raises(RequestError, match="relative error from") as caught:
        model.simulate(cycles=3, transient=1, error=error, of="peak_ball_force")
    assert not str(caught.value).startswith("error")


def test_an_interrupt_within_cvodes_is_one(make_model: Callable[..., Model]) -> None:
    """CasADi reports it as a right-hand side that failed; the run of some minutes ends within the first seconds."""
    model = make_model("varying_compliance")
    timers: list[threading.Timer] = []

    def begin(_: float) -> None:
        if not timers:
            timers.append(threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)))
            timers[0].start()

    with pytest.raises(KeyboardInterrupt):
        model.simulate(cycles=3000, transient=0, method="cvodes", samples_per_cycle=20, rtol=1e-11, progress=begin)
    assert timers


def test_a_command_without_an_option_that_it_needs_says_what_the_option_takes(
    ballpass: Callable[..., Result],
) -> None:
    done = ballpass("spectrum", SCENE)
    assert (done.exit_code, done.stderr.count("is missing")) == (2, 1)
    assert "--of is missing. It takes: output or state with one value: `inner.y`" in done.stderr


def test_a_command_without_its_arguments_says_what_each_takes(ballpass: Callable[..., Result]) -> None:
    """What every command says of options holds for arguments: also of a second one, and in every command."""
    commands = get_command(app).commands  # type: ignore[attr-defined]
    arguments = {
        name: [item.metavar for item in command.params if item.param_type_name == "argument" and item.required]
        for name, command in commands.items()
    }
    asked = {name: wanted for name, wanted in arguments.items() if wanted}
    assert asked.keys() >= {"run", "dataset", "steady", "trade"}
    assert asked["fit"] == ["SCENE", "DATA"]
    for name, wanted in asked.items():
        for k, missing in enumerate(wanted):
            done = ballpass(name, *[SCENE] * k)
            assert done.exit_code == 2
            assert f"error: {name}: {missing} is missing. It takes: " in done.stderr
            assert f"Write: ballpass {name} {' '.join(wanted)}, then options" in done.stderr
    assert "error: --out is missing. It takes: file to write, NetCDF-4." in ballpass("stream", SCENE).stderr
    assert ballpass("run", SCENE, "a", "b").exit_code == 2
