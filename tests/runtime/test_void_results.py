"""Results in which a ball is flattened by more than a tenth end every command in words, not only `run`."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from quick_cases import long_but
from typer.testing import CliRunner

from ballpass.runtime import IntegrationError, Model, SimulationError, UnusualWarning
from ballpass.runtime.app.cli import app
from ballpass.runtime.contract.status import Status
from ballpass.runtime.run.failure_location import FailureLocation

#: The load of a rotor, of which 196 N flatten by 4 um: so much flattens by about a millimetre, of 11 mm.
FORCE = "load.force.x"
HEAVY = 1.5e6
SOFT = "--set load.force.x=1500kN"

COMMANDS = (
    *(
        "run SCENE --no-figures --cycles 1 --transient 0",
        "run SCENE --no-figures --cycles 1 --transient 0 --error 1%",
        "life SCENE --cycles 1 --transient 0",
    ),
    *("sensitivity SCENE --cycles 0.5 --transient 0 --of rms:inner.y --wrt bearing.clearance --no-check",),
    *("sweep SCENE --vary bearing.clearance=1um:2um:2 --of rms:inner.y --cycles 1 --transient 0 --no-figures",),
    "optimize SCENE --minimize rms:inner.x --vary bearing.clearance=1um:2um --starts 1 --cycles 0.5 --transient 0",
)


RUNNING_ONCE = ("life --cycles 22", "spectrum --of inner.x", "run --no-figures --error 1%")


@pytest.fixture
def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, scene_text: Callable[..., str]) -> Path:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "scene.toml"
    path.write_text(scene_text("varying_compliance"), encoding="utf-8")
    return path


@pytest.mark.parametrize("words", long_but(COMMANDS, *COMMANDS[:3]))
def test_commands_end_with_what_to_change(words: str, scene: Path) -> None:
    done = CliRunner().invoke(app, [*words.replace("SCENE", scene.name).split(), *SOFT.split()])
    assert done.exit_code == 1
    said = " ".join(done.stderr.split())
    assert "a ball is flattened by" in said
    assert "Reduce load, speed or clearance" in said
    if deflected := re.search(r"flattened by ([\d.]+) mm.*Most deflected there: .*, by (\d+) µm", said):
        assert float(deflected[2]) == pytest.approx(1e3 * float(deflected[1]), abs=1.0)


def test_where_no_ball_touches_none_is_named_as_most_deflected() -> None:
    """It was "ball 6, by -4.999e+08 um" of a clearance of a kilometre."""
    there = FailureLocation(crank_angle=0.0, bearing="", ball=6, ball_angle=0.5, deflection=-500.0)
    assert there.words == "No ball is in contact there."
    assert replace(there, deflection=0.0147).words.endswith("ball 6 at 28.65 deg, by 14700 µm.")


def test_lanes_find_the_members_that_are_void_alone(make_model: Callable[..., Model]) -> None:
    """Where nothing of the balls is asked for, their deflection is taken at ends of steps, and near its largest."""
    model = make_model("varying_compliance")
    table = {FORCE: np.geomspace(1e5, 1e6, 40).tolist()}
    given: dict[str, Any] = {"cycles": 1, "transient": 0, "rtol": 1e-6}
    lanes, alone = (model.simulate_many(table, "rms:inner.x", lanes=lanes, **given) for lanes in (True, False))
    assert lanes.statistics.lanes > 1
    void = [failure.member for failure in lanes.failures if failure.status == Status.VOID.name]
    assert 10 < len(void) < 30
    assert void == [failure.member for failure in alone.failures if failure.status == Status.VOID.name]


def test_members_are_void_one_by_one(make_model: Callable[..., Model]) -> None:
    model = make_model("varying_compliance")
    found = model.simulate_many({FORCE: [196.0, HEAVY, 300.0]}, "rms:inner.x", cycles=1, transient=0)
    assert [(failure.member, failure.status) for failure in found.failures] == [(1, Status.VOID.name)]
    assert "a ball is flattened by" in found.failures[0].message
    assert np.isnan(found["rms:inner.x"]).tolist() == [False, True, False]
    alone = model.simulate_many({FORCE: [HEAVY]}, "rms:inner.x", cycles=1, transient=0, lanes=False)
    assert alone.failures[0].status == Status.VOID.name
    with pytest.raises(SimulationError, match="a ball is flattened by"):
        model.simulate(cycles=1, transient=0, parameters={FORCE: HEAVY})


#: One turn, which the scene's twenty transient turns hold, or all of it counts; what else a run keeps.
ROUTES: dict[str, Callable[[Model], Any]] = {
    "within the transient": lambda model: model.simulate(1, parameters={FORCE: HEAVY}),
    "without outputs": lambda model: model.simulate(1, parameters={FORCE: HEAVY}, outputs=[]),
    "cvodes": lambda model: model.simulate(0.1, parameters={FORCE: HEAVY}, method="cvodes", rtol=1e-6),
    "sensitivities": lambda model: model.sensitivities([FORCE], 0.1, parameters={FORCE: HEAVY}),
    "static equilibrium": lambda model: model.static_equilibrium(parameters={FORCE: HEAVY}),
    "linearize": lambda model: model.linearize(parameters={FORCE: HEAVY}),
    "section": lambda model: model.section(readings=40, parameters={FORCE: HEAVY}),
}


@pytest.mark.parametrize("route", long_but(ROUTES, "within the transient", "without outputs"))
def test_no_route_gives_void_results(route: str, make_model: Callable[..., Model]) -> None:
    with pytest.raises(SimulationError, match="a ball is flattened by"):
        ROUTES[route](make_model("varying_compliance"))


def test_scenes_whose_outputs_have_no_deflections_give_none_either(make_model: Callable[..., Model]) -> None:
    """It was "There is no output 'ball.deflection'"."""
    model = make_model("rotor")
    assert "ball.deflection" not in [info.name for info in model.manifest.outputs]
    with pytest.raises(IntegrationError, match="a ball is flattened by") as caught:
        model.simulate(1, parameters={"loads.weight.force.x": 1e6}, outputs=[], transient=0)
    assert caught.value.ball == 1  # on the load line at first


@pytest.mark.parametrize("name", ["value:inner.x@0.1s", "amplitude:inner.x@cage"])
def test_quantities_that_no_step_reduces_are_void_too(name: str, make_model: Callable[..., Model]) -> None:
    found = make_model("varying_compliance").simulate_many({FORCE: [196.0, HEAVY]}, name, cycles=1, transient=0)
    assert [(failure.member, failure.status) for failure in found.failures] == [(1, Status.VOID.name)]


def test_the_failure_is_at_the_moment_of_the_largest_flattening(make_model: Callable[..., Model]) -> None:
    """Which ball that is, and when, is the maximum of the run's own outputs at dense samples."""
    model = make_model("varying_compliance")
    with pytest.raises(IntegrationError) as caught:
        model.simulate(1, parameters={FORCE: HEAVY}, transient=0)
    failure = caught.value
    with pytest.raises(IntegrationError) as again:
        model.simulate(parameters={FORCE: HEAVY}, transient=0, times=np.linspace(0.0, 2.0 * failure.time, 1001)[1:])
    found = again.value.partial
    assert found.t[-1] == pytest.approx(failure.time, rel=3e-3)
    assert failure.partial.t[-1] <= failure.time
    deflections = found["ball.deflection"]
    assert np.argmax(deflections.max(axis=1)) >= len(deflections) - 2
    assert np.argmax(deflections[-1]) + 1 == failure.ball
    assert f"by {1e6 * deflections.max():.4g} µm" in str(failure)


def test_a_void_start_of_a_run_that_counts_later_is_a_warning(make_model: Callable[..., Model]) -> None:
    """A ring thrown at its balls with 20 m/s flattens them once; a turn later it has come to rest."""
    model = make_model("varying_compliance")
    start = np.array([0.0, 0.0, 20.0, 0.0])
    given: dict[str, Any] = {"initial": start, "outputs": ["ball.deflection"]}
    with pytest.warns(UnusualWarning, match=r"Before the turns that count, t = .* a ball is flattened by"):
        found = model.simulate(20, transient=19, **given)
    assert found.steady_reductions is not None
    assert found.steady_reductions["ball.deflection"].maximum < 1e-4
    with pytest.raises(IntegrationError, match="a ball is flattened by"):
        model.simulate(1, transient=0, **given)


@pytest.mark.filterwarnings("always::ballpass.runtime.UnusualWarning")
@pytest.mark.parametrize("words", long_but(RUNNING_ONCE, RUNNING_ONCE[1]))
def test_a_void_start_is_a_warning_of_every_command_that_runs_once(words: str, scene: Path) -> None:
    """`run` and `simulate` alone had it."""
    name, *rest = words.split()
    done = CliRunner().invoke(app, [name, scene.name, *rest, "--set", "bearing.initial.inner_velocity.x=20m/s"])
    assert done.exit_code == 0, done.stderr
    assert " ".join(done.stderr.split()).count("Before the turns that count, t = 0.000204 s: bearing: a ball is") == 1


def test_quantities_and_settling_warn_of_a_void_start(make_model: Callable[..., Model]) -> None:
    model, thrown = make_model("varying_compliance"), {"bearing.initial.inner_velocity.x": 20.0}
    runs: list[Callable[[], object]] = [
        lambda: model.reduce(20, transient=19, parameters=thrown),
        lambda: model.quantities("rms:inner.x", 20, transient=19, parameters=thrown),
        lambda: model.settle(transient=19, parameters=thrown),
    ]
    for run in runs:
        with pytest.warns(UnusualWarning, match=r"Before the turns that count, t = .* a ball is flattened by"):
            run()
