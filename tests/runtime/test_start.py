"""Claims about where runs start: they go on where others ended, and rings rest under the first load."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from ballpass.runtime import Model, load_solution
from ballpass.runtime.app.cli import app
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.point.evaluate import point

MOTOR = """[mechanism.driver.torque]
law = "asynchronous"
breakdown_torque = "40 N*m"
breakdown_slip = 0.2
synchronous_speed = "520 rpm"

[mechanism.driver.flywheel]
inertia = "0.2 kg*m^2"

[mechanism.frame.points]"""
DRIVEN = ("[mechanism.frame.points]", MOTOR)


@pytest.mark.parametrize(
    ("scene", "changes"),
    [
        ("punching_press", ()),
        ("punching_press_two_way", ()),
        pytest.param("varying_compliance", (), marks=pytest.mark.long),
        pytest.param("punching_press_hinges", (), marks=pytest.mark.long),
        pytest.param("punching_press_hinges", (DRIVEN,), marks=[pytest.mark.long, pytest.mark.extreme]),
    ],
)
def test_a_run_goes_on_as_one_run_through(
    make_model: Callable[..., Model], tmp_path: Path, scene: str, changes: tuple[tuple[str, str], ...]
) -> None:
    """Cut behind a whole turn and off every edge: windows, cages and the driver's angle go on."""
    model = make_model(scene, *changes)
    how = {"rtol": 1e-11, "kinks": "stepped-over", "samples_per_cycle": 200}
    through = model.simulate(cycles=1.65, transient=0, **how)
    first = model.simulate(cycles=1.15, transient=0, **how)
    again = load_solution(first.save(tmp_path / "first.nc")).end
    second = model.simulate(cycles=0.5, transient=1.3, initial=again, **how)
    last = len(through) - len(second)
    assert second.t[0] == first.t[-1]
    assert second.t == pytest.approx(through.t[last:], rel=1e-13, abs=0.0)
    for name in through.outputs:
        assert np.max(np.abs(second[name] - through[name][last:])) <= 1e-6 * np.max(np.abs(through[name])), name
    # the transient counts from t = 0, also without samples and in two parts
    part = {"transient": 1.3, "rtol": 1e-11, "kinks": "stepped-over"}
    reduced, of_all = model.reduce(cycles=0.5, initial=again, **part), model.reduce(cycles=1.65, **part)
    for name in model.states:
        assert reduced[name].maximum == pytest.approx(of_all[name].maximum, rel=1e-6, abs=0.0)
        assert reduced[name].rms == pytest.approx(of_all[name].rms, rel=1e-5)
    assert second.steady().t[0] == pytest.approx(reduced.start, rel=1e-2)


@pytest.mark.long
def test_the_command_goes_on_from_the_file_of_a_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, scene_text: Callable[..., str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("alone.toml").write_text(scene_text("varying_compliance"), encoding="utf-8")
    how = ["--no-figures", "--transient", "0.2", "--cycles"]
    runs = {
        "first": ["0.3"],
        "second": ["0.1", "--initial", "first/solution.nc"],
        "rest": ["0.3", "--initial", "equilibrium"],
    }
    for name, words in runs.items():
        done = CliRunner().invoke(app, ["run", "alone.toml", "--out", name, *how, *words])
        assert done.exit_code == 0, done.output
    first, second, rest = (load_solution(f"{name}/solution.nc") for name in runs)
    assert (second.t[0], second.x[0].tolist()) == (first.t[-1], first.x[-1].tolist())
    assert abs(np.diff(rest["inner.x"][:2])[0]) < 0.05 * abs(np.diff(first["inner.x"][:2])[0])
    done = CliRunner().invoke(app, ["run", "alone.toml", "--initial", "nowhere.nc"])
    assert done.exit_code == 2
    assert "nowhere.nc: there is no such file" in done.output


def test_what_would_jump_does_not_go_on(make_model: Callable[..., Model]) -> None:
    press, alone = make_model("punching_press"), make_model("varying_compliance")
    end = press.simulate(cycles=0.3, transient=0).end
    with pytest.raises(RequestError, match=r"driver.speed changed, the driver would jump by 5.4 deg.*end\.x"):
        press.simulate(cycles=1, parameters={"mechanism.driver.speed": 1.05 * 52.35987755982989}, initial=end)
    with pytest.raises(RequestError, match="ball_angle changed, balls would jump"):
        press.simulate(cycles=1, parameters={"bearing.ball_angle": 0.1}, initial=end)
    with pytest.raises(RequestError, match="run of this scene"):
        alone.simulate(cycles=1, initial=end)
    with pytest.raises(RequestError, match="lies before it"):
        press.simulate(times=[0.0, 0.1], initial=end)
    heavier = press.simulate(cycles=0.1, parameters={"bearing.clearance": 12e-6}, initial=end, transient=0)
    assert np.array_equal(heavier.x[0], end.x)


@pytest.mark.parametrize(
    "scene", ["punching_press_two_way", pytest.param("punching_press_hinges", marks=pytest.mark.long)]
)
def test_rings_start_at_rest_under_weight_and_inertia(make_virtual: Callable[..., Model], scene: str) -> None:
    """Undamped: nothing is accelerated there by the equations of motion, with the crank turning at its speed."""
    model = make_virtual(scene)
    undamped = {name: 0.0 for name in model.parameters if name.endswith("damping.ratio")}
    for angle in (0.3, 4.5):  # outside and within the punch's window
        parameters = {**undamped, "mechanism.driver.start_angle": angle}
        run = model.simulate(
            duration=1e-5, transient=0, method="cvodes", outputs=[], parameters=parameters, initial="equilibrium"
        )
        still = np.zeros_like(run.x[0])
        rest, ideal = (
            np.abs(model.kernel("rhs")(point(model, model.numbers(parameters), 0.0, x))) for x in (run.x[0], still)
        )
        assert np.max(rest) < 1e-9 * np.max(ideal)
        half = len(still) // 2
        assert np.max(np.abs(run.x - run.x[0])[:, :half]) < 1e-3 * np.max(np.abs(run.x[0, :half]))


def test_a_ball_gap_without_load_has_no_place_of_rest(make_virtual: Callable[..., Model]) -> None:
    model = make_virtual("punching_press_two_way")
    standing = {"mechanism.driver.speed": 0.0, "mechanism.gravity": 0.0}
    with pytest.raises(RequestError, match=r"no ball touches.*preload"):
        model.simulate(duration=0.1, transient=0, parameters=standing, initial="equilibrium")
    with pytest.raises(RequestError, match='Allowed: a state, "equilibrium"'):
        model.simulate(duration=0.1, transient=0, initial="rest")


def test_a_ring_on_one_ball_has_no_place_to_start_from(make_virtual: Callable[..., Model]) -> None:
    """The load points at a ball: nothing holds the ring sideways, however far the clearance lets it roll."""
    alone = make_virtual("varying_compliance")
    with pytest.raises(RequestError, match=r"do(es)? not hold the rings.*two balls carry"):
        alone.simulate(
            cycles=1,
            transient=0,
            parameters={"load.force.x": 100.0, "load.force.y": 0.0, "bearing.clearance": 1e-3},
            initial="equilibrium",
        )
