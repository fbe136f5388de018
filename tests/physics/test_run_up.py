"""A driver with a table of its speed over time, against closed forms: the angle is a quadratic between rows."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import simpson
from scipy.optimize import brentq

from ballpass.derive import generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.derive.scene.errors import SceneError
from ballpass.runtime import Model, load
from ballpass.runtime.contract.errors import RequestError

PRESS = (Path(__file__).parents[2] / "scenes/punching_press.toml").read_text()
SPEED = 'speed = "500 rpm"                       # [paper]; positive is counter-clockwise\n'
TABLE = """flywheel.inertia = "0.3 kg*m^2"
table.time = { file = "run.csv", column = "time", unit = "s" }
table.speed = { file = "run.csv", column = "n", unit = "rpm" }
"""
ROWS = "time, n\n0.02, 60\n0.3, 600\n0.5, 450\n0.8, -300\n"
TIMES, SPEEDS = np.array([0.02, 0.3, 0.5, 0.8]), np.array([60.0, 600.0, 450.0, -300.0]) * math.pi / 30.0
END, START_ANGLE, PUNCH = 0.9, 0.4, "mechanism.forces.punch.force.y"
OUTPUTS = '"driver.*", "drive_*", "reaction.*"'
NAMES = [f"mechanism.driver.table.{column}.{row}" for column in ("time", "speed") for row in (1, 2, 3, 4)]


def angle(time: float, times: np.ndarray = TIMES, speeds: np.ndarray = SPEEDS) -> float:
    """The exact integral: trapezoids between knots."""
    edges = np.array([0.0, *times[times < time], time])
    return START_ANGLE + float(np.trapezoid(np.interp(edges, times, speeds), edges))


def _model(folder: Path, *changes: tuple[str, str], outputs: str = OUTPUTS) -> Model:
    """The press of the paper without its bearing."""
    head = PRESS[: PRESS.index("[bearing]")]
    for old, new in ((SPEED, TABLE), ('start_angle = "0 deg"', 'start_angle = "0.4 rad"'), *changes):
        assert old in head
        head = head.replace(old, new)
    (folder / "run.csv").write_text(ROWS)
    (folder / "press.toml").write_text(f'{head}\n[run]\nduration = "{END} s"\noutputs = [{outputs}]\n')
    return load(generate(folder / "press.toml", folder / "model"))


@pytest.fixture(scope="module")
def press(tmp_path_factory: pytest.TempPathFactory) -> Model:
    return _model(tmp_path_factory.mktemp("run_up"))


def test_samples_follow_the_turns_that_pass(press: Model) -> None:
    """From 60 rpm the 3.6 turns of the run had the samples of 0.9, and of 0.001 rpm two in all."""
    passed = float(np.trapezoid(np.abs(np.interp(np.linspace(0.0, END, 100_001), TIMES, SPEEDS)), dx=END / 1e5))
    for first in (SPEEDS[0], 1e-4):
        run = press.simulate(parameters={"mechanism.driver.table.speed.1": first})
        assert len(run.t) > 0.9 * 2000 * passed / math.tau
    assert len(press.simulate(samples_per_cycle=100).t) == pytest.approx(100 * passed / math.tau, rel=0.01)


def test_angle_and_acceleration_are_the_integral_and_the_slope_of_the_table(press: Model) -> None:
    times = np.array([0.01, 0.1, 0.31, 0.5, 0.7, 0.85])
    run = press.simulate(times=times, duration=END, rtol=1e-6)
    assert run["driver.angle"] == pytest.approx([angle(t) for t in times], rel=1e-12, abs=0.0)
    assert run["driver.speed"] == pytest.approx(np.interp(times, TIMES, SPEEDS), rel=1e-12)
    slopes = np.diff(SPEEDS) / np.diff(TIMES)
    assert run["driver.acceleration"] == pytest.approx([0.0, slopes[0], slopes[1], slopes[2], slopes[2], 0.0])


def test_steps_end_where_the_exact_angle_passes_the_edges_of_windows(press: Model) -> None:
    """Also behind the standstill at 0.68 s, from where the driver turns back."""
    edges = math.radians(237.0), math.radians(267.0)
    passed = []
    for left, right in pairwise([0.0, *TIMES[:3], 0.68, TIMES[3], END]):
        low, high = sorted((angle(left), angle(right)))
        for edge in edges:
            turn = edge + 2.0 * math.pi * math.ceil((low - edge) / (2.0 * math.pi))
            while turn < high:
                passed.append(brentq(lambda t, goal=turn: angle(t) - goal, left, right, xtol=1e-15))
                turn += 2.0 * math.pi
    switched = [t for t in press.breakpoints(0.0, END) if np.min(np.abs(t - TIMES)) > 1e-9]
    assert switched == pytest.approx(sorted(passed), abs=1e-14)
    assert len(passed) == 10
    beside = np.ravel([[t - 1e-9, t + 1e-9] for t in sorted(passed)])
    force = press.simulate(times=beside, duration=END, rtol=1e-6)["reaction.D.x"].reshape(-1, 2)
    free = press.simulate(times=beside, duration=END, rtol=1e-6, parameters={PUNCH: 0.0})["reaction.D.x"].reshape(-1, 2)
    acts = np.abs(force - free) > 1.0
    assert np.all(acts[:, 0] != acts[:, 1])


def test_work_of_the_drive_is_what_bodies_flywheel_and_weight_take(press: Model) -> None:
    """Piece by piece of the table; energies by closed forms of the slider-crank that are written here."""
    for left, right in pairwise([*TIMES, END]):
        times = np.linspace(left, right, 4001)
        times[[0, -1]] += [1e-9, -1e-9]  # the torque jumps at a row
        run = press.simulate(times=times, duration=END, rtol=1e-10, parameters={PUNCH: 0.0})
        theta, omega = run["driver.angle"], run["driver.speed"]
        sine, cosine = 0.06 * np.cos(theta), np.sqrt(1.0 - (0.06 * np.cos(theta)) ** 2)
        swing = 0.06 * np.sin(theta) / cosine * omega  # of the rod
        pin = 0.006 * np.array([-np.sin(theta), np.cos(theta)]) * omega
        # the rod hangs at the angle asin(sine) from the vertical
        height = 0.006 * np.sin(theta) - 0.1 * cosine
        slider = 0.006 * np.cos(theta) * omega - 0.1 * (sine / cosine) * 0.06 * np.sin(theta) * omega
        middle = 0.5 * np.array([pin[0], pin[1] + slider])
        kinetic = 0.5 * (0.3 + 611.7e-6) * omega**2 + 0.5 * 7517.545e-6 * swing**2
        kinetic += 0.5 * 2.55 * np.sum(middle**2, axis=0) + 0.5 * 16.7965 * slider**2
        potential = 9.81 * (2.55 * 0.5 * (0.006 * np.sin(theta) + height) + 16.7965 * height)
        energy = kinetic + potential
        work = simpson(run["drive_power"], x=times)
        assert energy[-1] - energy[0] == pytest.approx(work, rel=1e-8, abs=1e-8)


@pytest.mark.long
def test_derivatives_by_rows_of_the_table_are_those_of_the_integral(press: Model) -> None:
    """Times and speeds; the ends of segments move with the times."""
    found = press.sensitivities(NAMES, duration=END, rtol=1e-9, parameters={PUNCH: 0.0}).x[-1]
    rows, h = np.concatenate([TIMES, SPEEDS]), 1e-5
    for k in range(8):
        up, down = (np.split(rows + sign * h * np.eye(8)[k], 2) for sign in (1.0, -1.0))
        assert found[0, k] == pytest.approx((angle(END, *up) - angle(END, *down)) / (2.0 * h), rel=1e-8, abs=1e-8)
        assert found[1, k] == pytest.approx(float(k == 7), abs=1e-9)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ('speed = "5 rad/s"\ntable = { time = ["0 s", "1 s"], speed = ["0 rpm", "9 rpm"] }', "the table gives the"),
        ('table = { time = ["0 s", "0 s"], speed = ["0 rpm", "9 rpm"] }', "the time does not increase"),
        ('table = { time = ["0 s"], speed = ["0 rpm"] }', "the table has too few rows"),
        ('table = { time = ["-1 s", "1 s"], speed = ["0 rpm", "9 rpm"] }', "the value is negative"),
        ('table = { time = ["0 s", "1 s"] }', "this key is missing"),
        (
            'table = { time = ["0 s", "1 s"], speed = ["100 rpm", "0 rpm"] }',
            "nothing turns, or not so often",
        ),
    ],
)
def test_tables_of_speed_that_say_nothing_are_refused(keys: str, words: str) -> None:
    with pytest.raises(SceneError, match=words):
        scene_from_text(PRESS.replace(SPEED, keys + "\n"), "press")


@pytest.mark.parametrize("first", ["0 rpm", "0.5 rpm"])
def test_a_run_without_a_length_lasts_until_the_last_row(tmp_path: Path, first: str) -> None:
    """Sixty turns at the first speed were two hours; from rest there were no turns."""
    keys = f'table = {{ time = ["0 s", "0.8 s"], speed = ["{first}", "300 rpm"] }}\n'
    text = PRESS[: PRESS.index("[bearing]")].replace(SPEED, keys)
    model = load(generate(scene_from_text(f'{text}\n[run]\noutputs = ["driver.*"]\n', "press"), tmp_path / "model"))
    run = model.simulate()
    assert run.t[[0, -1]] == pytest.approx([0.0, 0.8])
    assert run["driver.speed"][-1] == pytest.approx(10.0 * math.pi)


def test_extremes_at_a_windows_edge_are_values_on_one_of_its_sides(press: Model) -> None:
    """Reactions jump there; a parabola through both sides went an eighth of the jump beyond."""
    run = press.simulate(times=np.linspace(0.0, END, 100_001), duration=END, rtol=1e-10)
    for name in ("reaction.A.y", "reaction.B.y", "reaction.C.y", "drive_torque"):
        found = press.quantities([f"{kind}:{name}" for kind in ("max", "min")], duration=END, transient=0)
        extremes = [one.value for one in found.values()]
        assert extremes == pytest.approx([np.max(run[name]), np.min(run[name])], abs=1e-3 * float(np.ptp(run[name])))


@pytest.mark.parametrize("window", [True, False])
def test_work_of_a_stop_is_that_of_fine_samples_where_steps_take_turns(tmp_path: Path, window: bool) -> None:
    """A speed that is linear in time lets steps be as long as the stretch between two rows."""
    wall = """[mechanism.stops.wall]
bodies = ["frame", "slider"]
points = ["A", "C"]
direction = "270 deg"
stiffness = "2e6 N/m"
free_distance = "97 mm"
hysteresis = "1 s/m"

[mechanism.forces.punch]"""
    changes = [("[mechanism.forces.punch]", wall)]
    if not window:
        changes.append(('window = { start = "237 deg", end = "267 deg" }\n', ""))
    model = _model(tmp_path, *changes, outputs='"stop.wall.*", "stop.wall.power"')
    run = model.simulate(times=np.linspace(0.0, END, 400_001), duration=END, rtol=1e-10)
    for name in ("stop.wall.power", "stop.wall.force"):
        found = model.quantities(f"integral:{name}", duration=END, transient=0, rtol=1e-7)[f"integral:{name}"]
        samples = float(np.trapezoid(run[name], run.t))
        assert found.value == pytest.approx(samples, rel=1e-6)


def test_work_of_a_run_from_rest_is_its_energy_where_steps_take_turns(tmp_path: Path) -> None:
    """A turn at a first speed of zero has no end: 425 turns had 256 panels, and the work was half as much again."""
    window = 'window = { start = "237 deg", end = "267 deg" }\n'
    outputs = '"drive_power", "applied_power", "total_energy"'
    model = _model(tmp_path, (window, ""), outputs=outputs)
    rows = dict(zip(NAMES, [0.0, 3.0, 3.1, 3.2, 0.0, 314.0, 314.0, 314.0], strict=True))
    parameters, duration = {**rows, "mechanism.driver.flywheel.inertia": 0.0}, 10.0
    work, end, begin = "integral:applied_power", "end:total_energy", "value:total_energy@0s"
    found = model.quantities([work, end, begin], duration=duration, transient=0, parameters=parameters)
    assert found[work].value == pytest.approx(found[end].value - found[begin].value, rel=1e-6)


def test_work_of_the_punch_after_a_long_rest_is_its_force_times_the_travel_in_every_window(tmp_path: Path) -> None:
    """Edges lay a share of the run before the load's, where turns at a first speed of zero have no end."""
    model = _model(tmp_path, outputs='"driver.angle", "force.punch.power"')
    rows = dict(zip(NAMES, [90.0, 91.0, 92.0, 93.0, 0.0, 314.0, 314.0, 314.0], strict=True))
    work, angle_end = "integral:force.punch.power", "end:driver.angle"
    found = model.quantities([work, angle_end], duration=92.0, transient=0, parameters=rows)

    def height(angle: float) -> float:
        return 6e-3 * math.sin(angle) - math.sqrt(0.1**2 - (6e-3 * math.cos(angle)) ** 2)

    travel = height(math.radians(267.0)) - height(math.radians(237.0))
    last = found[angle_end].value
    begin, end = (math.floor((angle - math.radians(267.0)) / math.tau) for angle in (START_ANGLE, last))
    assert (last - math.radians(237.0)) % math.tau > math.radians(30.0)  # it ends outside the window
    assert found[work].value == pytest.approx(8964.8 * travel * (end - begin), rel=1e-6)


@pytest.fixture(scope="module")
def with_bearing(tmp_path_factory: pytest.TempPathFactory) -> Model:
    """The press of the paper with its bearing, no state more, run up from rest."""
    folder = tmp_path_factory.mktemp("with_bearing")
    text = PRESS.replace(
        SPEED, 'table = { time = ["0 s", "0.2 s", "0.3 s"], speed = ["0 rpm", "600 rpm", "450 rpm"] }\n'
    )
    (folder / "press.toml").write_text(text[: text.index("[run]")] + '[run]\nduration = "0.4 s"\n')
    model = load(generate(folder / "press.toml", folder / "model"))
    assert not any(name.startswith("driver") for name in model.states)
    return model


def test_angles_and_orders_of_a_run_up_are_those_of_the_integral_of_its_table(with_bearing: Model) -> None:
    """10 rad/s^2 times pi from rest; the mean speed is turns over time, and the last 240 degrees lie where it says."""
    rows, rates = np.array([0.0, 0.2, 0.3]), np.array([0.0, 600.0, 450.0]) * math.pi / 30.0

    def turned(time: float) -> float:
        return angle(time, rows, rates) - START_ANGLE

    whole = math.floor((turned(0.4) - math.radians(240.0)) / math.tau)
    last = brentq(lambda t: turned(t) - math.radians(240.0) - math.tau * whole, 0.1, 0.4, xtol=1e-14)
    mean = turned(0.4) / math.tau / 0.4
    first = math.sqrt(2.0 * math.radians(240.0) / (rates[1] / 0.2))
    pairs = {
        "value:drive_torque@240deg": f"value:drive_torque@{last!r}s",
        "amplitude:drive_torque@2x": f"amplitude:drive_torque@{2.0 * mean!r}Hz",
        "static_deflection@240deg": f"static_deflection@{first!r}s",
    }
    found = with_bearing.quantities([*pairs, *pairs.values()], transient=0)
    for name, given in pairs.items():
        assert found[name].value == pytest.approx(found[given].value, rel=1e-9), name


@pytest.mark.long
def test_derivatives_of_a_run_up_agree_with_runs_beside_it(with_bearing: Model) -> None:
    """By speeds and times of rows: at an angle, at an order, of an extreme of the torque."""
    asked = ["value:drive_torque@240deg", "amplitude:inner.y@1x", "amplitude:inner.y@bpfo", "max:drive_torque"]
    moved = ["mechanism.driver.table.speed.3", "mechanism.driver.table.time.2"]
    report = with_bearing.sensitivity(asked, moved, transient=0)
    assert {pair.check.verdict.name for pair in report.pairs} == {"VERIFIED"}, str(report)


def test_a_run_down_to_rest_has_no_period(with_bearing: Model) -> None:
    still = {"mechanism.driver.table.speed.3": 0.0}
    with pytest.raises(RequestError, match="nothing turns"):
        with_bearing.section(parameters=still)
    with pytest.raises(RequestError, match="do not change with time"):
        with_bearing.steady(parameters=still)
