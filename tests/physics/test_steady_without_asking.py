"""What a scene gives that says nothing of its run: the steady machine, and not the impact of the start."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ballpass.derive import generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model, Solution, load, load_results
from ballpass.runtime.app.cli import app
from ballpass.runtime.contract.folder import read_manifest
from ballpass.runtime.export.c_program import export_c, started

#: A crank alone on its bearing, lightly damped: rings that fall through the clearance hit with twice the steady load.
FOUR = """
title = "A crank"
[mechanism]
driver = { joint = "A", speed = "600 rpm" }
frame.points = { A = "origin" }
[mechanism.bodies.crank]
mass = "0.4 kg"
inertia = "400 kg*mm^2"
center_of_mass = "20 mm"
points = { A = "origin" }
[mechanism.joints.A]
type = "revolute"
bodies = ["frame", "crank"]
[bearing]
joint = "A"
share = 1
designation = "6003"
clearance = "C3"
[bearing.damping]
law = "hunt-crossley"
hysteresis = "0.1 s/m"
[bearing.inner_ring]
mass = "0.5 kg"
[bearing.outer_ring]
support = "elastic"
mass = "1 kg"
stiffness = "1e8 N/m"
damping = "2000 N*s/m"
"""
RUN = '[run]\ncycles = 10\noutputs = ["inner.*", "ball.force"]\n'
CONCENTRIC = '[bearing.initial]\ninner = ["0 um", "0 um"]\n'


def made(folder: Path, text: str) -> Model:
    return load(generate(scene_from_text(text, "scene"), folder))


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Model:
    return made(tmp_path_factory.mktemp("plain"), FOUR)


@pytest.mark.parametrize(
    ("run", "turns"),
    [
        ("", (60.0, 50.0, False)),
        ('[run]\noutputs = ["inner.ax"]\n', (60.0, 50.0, False)),
        ("[run]\nsamples_per_cycle = 500\n", (60.0, 50.0, False)),
        ("[run]\ntransient_cycles = 5\n", (15.0, 5.0, True)),
        ("[run]\ncycles = 5\n", (5.0, 0.0, True)),
    ],
)
def test_an_output_more_does_not_ask_for_a_length_of_the_run(run: str, turns: tuple[float, float, bool]) -> None:
    """What a run does not say is that of a scene without one: who names an output need not know how long to run."""
    scene = scene_from_text(FOUR + run, "scene")
    assert (scene.run.cycles, scene.run.transient_cycles, scene.run.stated) == turns
    assert scene.outputs == (("inner.ax",) if "inner.ax" in run else ("*",))
    assert scene.run.at_rest == ("transient" not in run)


@pytest.mark.long
def test_rings_at_rest_do_not_fall_through_their_clearance(plain: Model, tmp_path: Path) -> None:
    steady = plain.reduce()["ball.force"].maximum
    assert plain.reduce().duration == pytest.approx(10 * plain.period())
    assert plain.reduce(10, transient=0)["ball.force"].maximum == pytest.approx(steady, rel=0.01)
    falling = {name: 0.0 for name in plain.parameters if name.startswith("bearing.initial.")}
    assert plain.reduce(10, transient=0, parameters=falling)["ball.force"].maximum > 1.5 * steady
    assert plain.reduce(60, transient=50, parameters=falling)["ball.force"].maximum == pytest.approx(steady, rel=1e-4)
    stated = made(tmp_path / "stated", FOUR + CONCENTRIC + RUN)
    assert stated.parameters["bearing.initial.inner.y"] == 0.0
    transient = made(tmp_path / "transient", FOUR + RUN + "transient_cycles = 0\n")
    assert transient.parameters["bearing.initial.inner.y"] == 0.0


@pytest.mark.long
def test_the_file_of_a_run_without_stated_turns_has_the_steady_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fifty turns of a transient that nobody asked for were five sixths of the file; asked-for turns are all there."""
    monkeypatch.chdir(tmp_path)
    Path("crank.toml").write_text(FOUR, encoding="utf-8")

    def solution(*words: str) -> Solution:
        done = CliRunner().invoke(app, ["run", "crank.toml", "--no-figures", *words])
        assert done.exit_code == 0, done.output
        return load_results("results/crank").solution

    found = solution()
    assert (found.t[0], found.t[-1]) == (pytest.approx(5.0), pytest.approx(6.0))  # turns of 0.1 s
    assert len(found.steady().t) == len(found.t) == 20001
    assert found.end.time == found.t[-1]  # from where --initial continues
    asked = solution("--cycles", "3", "--transient", "2")
    assert (asked.t[0], len(asked.t), len(asked.steady().t)) == (0.0, 6001, 2001)


@pytest.mark.long
def test_settling_drops_the_start(plain: Model) -> None:
    falling = {name: 0.0 for name in plain.parameters if name.startswith("bearing.initial.")}
    found = plain.settle(parameters=falling, transient=0)
    assert found.settled
    assert found.dropped == 64
    assert f"{found.turns} steady turns behind 64 of transient" in found.words
    steady = plain.settle().reductions["ball.force"].maximum
    assert found.reductions["ball.force"].maximum == pytest.approx(steady, rel=1e-3)


@pytest.mark.long
def test_run_warns_of_an_extreme_in_its_first_turns(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "falling.toml").write_text(FOUR + CONCENTRIC + RUN, encoding="utf-8")
    (tmp_path / "resting.toml").write_text(FOUR + RUN, encoding="utf-8")
    said = {name: CliRunner().invoke(app, ["run", f"{name}.toml", "--no-figures"]) for name in ("falling", "resting")}
    assert all(done.exit_code == 0 for done in said.values())
    words = " ".join(said["falling"].stderr.split())
    assert "force of each ball (ball.force) has its max of" in words
    assert "in turn 1, and later turns have" in words
    assert "ball.force has its" not in said["resting"].stderr


LIGHT = FOUR.replace("600 rpm", "6000 rpm").replace("2000 N*s/m", "20 N*s/m").replace("0.1 s/m", "1e-4 s/m")


@pytest.mark.long
def test_a_transient_of_more_than_fifty_turns_is_found(tmp_path: Path) -> None:
    """Turns 50 to 60 have 0.4 % more than the steady machine, which was not said."""
    model = made(tmp_path / "light", LIGHT)
    steady = model.reduce(1010, transient=1000)["ball.force"].maximum
    assert model.reduce(60, transient=50)["ball.force"].maximum > 1.003 * steady
    found = model.reduce()
    assert found.start > 100 * model.period()
    assert found.duration == pytest.approx(10 * model.period())
    assert found["ball.force"].maximum == pytest.approx(steady, rel=1e-4)
    # neighbours run as long, and what is asked for is run
    softer = model.reduce(parameters={"bearing.outer_ring.damping": 30.0})
    assert softer.start == found.start
    assert model.reduce(60, transient=50).start == pytest.approx(50 * model.period())


COMMANDS = (
    *(
        "run SCENE --no-figures --error 10%",
        "sensitivity SCENE --of peak_ball_force --wrt bearing.clearance --no-check",
    ),
    *("sweep SCENE --vary bearing.clearance=10um:12um:2 --of peak_ball_force --no-figures", "life SCENE"),
    "optimize SCENE --minimize peak_ball_force --vary bearing.clearance=10um:12um --starts 1",
)


@pytest.mark.long
@pytest.mark.parametrize("words", [COMMANDS[0], *(pytest.param(c, marks=pytest.mark.long) for c in COMMANDS[1:])])
def test_commands_warn_of_an_extreme_in_its_first_turns(
    words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only `run` did."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "falling.toml").write_text(FOUR + CONCENTRIC + RUN, encoding="utf-8")
    done = CliRunner().invoke(app, words.replace("SCENE", "falling.toml").split())
    assert done.exit_code == 0, done.stderr
    said = " ".join(done.stderr.split())
    assert "extremes of the start, not of the steady machine:" in said
    assert "(ball.force)" in said


@pytest.mark.long
@pytest.mark.parametrize("words", ["run SCENE --no-figures", "life SCENE"])
def test_commands_warn_where_no_transient_is_found(words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a hundredth of the damping a search of a second does not reach the steady machine."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "light.toml").write_text(LIGHT.replace("20 N*s/m", "0.2 N*s/m"), encoding="utf-8")
    done = CliRunner().invoke(app, words.replace("SCENE", "light.toml").split())
    said = " ".join(done.stderr.split())
    assert "have not forgotten their start" in said
    names = said.partition("of the motion still changes ")[2].partition(". Give a run")[0]
    first, _, more = names.partition(" % and ")
    listed = [one.partition(" by ")[0] for one in first.split(", ")]
    # forces of balls, then what the table shows; velocities of next to nothing stood first
    assert listed[0] == "ball.force"
    assert len(listed) == len(set(listed)) == 4
    assert re.fullmatch(r"\d+ more", more)


SCENES = (
    "punching_press_roller",
    *("punching_press", "punching_press_hinges", "punching_press_motor", "punching_press_two_way", "four_bar"),
    *("punching_press_tangent", "crank_shaper", "offset_slider", "toggle_press", "rotor", "varying_compliance"),
)
#: These take more than ten seconds each.
DEAR = ("punching_press_roller", "punching_press_hinges", "toggle_press")


@pytest.mark.long
@pytest.mark.parametrize("scene", [pytest.param(s, marks=pytest.mark.extreme if s in DEAR else []) for s in SCENES])
def test_peaks_of_scenes_without_a_run_are_those_of_the_steady_machine(
    scene: str, scene_text: Callable[..., str], tmp_path: Path
) -> None:
    """From another start, some micrometres off, turns 50 to 60 have the same peaks as printed."""
    text = scene_text(scene)
    model = made(tmp_path / scene, text[: text.index("\n[run]")])
    found = model.reduce()
    assert found.start >= 49.99 * model.period()
    assert found.duration == pytest.approx(10 * model.period())
    other = {
        name: value + 2e-6
        for name, value in model.parameters.items()
        if ".initial." in name and "velocity" not in name and name.endswith((".x", ".y"))
    }
    again = model.reduce(60, transient=50, parameters=other)
    for bearing in model.manifest.bearings:
        name = f"{bearing.prefix}ball.force"
        peak = f"max:{name}"
        if model.uncertainties(peak)[peak] < 1e-3 * found[name].maximum:
            assert again[name].maximum == pytest.approx(found[name].maximum, rel=1e-3)


def test_exported_programs_start_where_runs_do(plain: Model, tmp_path: Path) -> None:
    written = read_manifest(plain.folder)
    assert written.parameters != plain.manifest.parameters
    assert started(plain.folder, written).manifest.parameters == plain.manifest.parameters
    program = export_c(plain.folder, tmp_path / "program")
    starts = [value for name, value in plain.parameters.items() if ".initial." in name and value != 0.0]
    assert starts
    source = (program / "scene.c").read_text(encoding="utf-8")
    assert all(repr(value) in source for value in starts)
