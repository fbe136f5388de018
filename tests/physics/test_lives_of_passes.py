"""Fatigue and wear count passes: lives of runs whose speed changes, against sums over passes written here."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from ballpass.runtime import Model, Solution
from ballpass.runtime.ratings.of_bearing import ratings_of

SPEED = 'speed = "500 rpm"                       # [paper]; positive is counter-clockwise\n'
ROWS, END = 6, 1.2
RPM = np.pi / 30.0
TABLE = "mechanism.driver.table"
#: ISO 16281 for C_r = 13.5 kN, printed in physics.md: ball loads of both rings that last a million turns [N].
INNER_BALL, OUTER_BALL = 4292.69, 8427.68


def column(values: list[float], unit: str) -> str:
    return f'{{ values = {values}, unit = "{unit}" }}'


@pytest.fixture(scope="module")
def press(make_model: Callable[..., Model]) -> Model:
    """The press with a table of its speed and, instead of the punch's force, a table of the load; C_r is given."""
    time, zeros = column([0.1 * k for k in range(ROWS)], "s"), column([0.0] * ROWS, "N")
    return make_model(
        "punching_press",
        (SPEED, f"table = {{ time = {time}, speed = {column([500.0] * ROWS, 'rpm')} }}\n"),
        ("[bearing]\n", f'[loads.work]\ntype = "table"\ntime = {time}\nx = {zeros}\ny = {zeros}\n\n[bearing]\n'),
        ('ball_diameter = "7.9375 mm"', 'ball_diameter = "7.9375 mm"\ndynamic_rating = "13.5 kN"'),
        ("cycles = 4 ", f'duration = "{END} s" '),
        ("outputs = [", 'outputs = ["cage.in_*", "ring_force.*", '),
        ("transient_cycles = 2", "transient_cycles = 0"),
    )


def numbers(time: np.ndarray, rpm: np.ndarray, x: np.ndarray, y: np.ndarray) -> dict[str, float]:
    """Tables of a mechanism that weighs nothing; half a millisecond apart, for derivatives want one edge at a time."""
    found = {"mechanism.forces.punch.force.y": 0.0, "mechanism.gravity": 0.0}
    found |= {f"mechanism.bodies.{body}.mass": 1e-6 for body in ("crank", "rod", "slider")}
    for k in range(ROWS):
        found |= {f"{TABLE}.time.{k + 1}": time[k], f"{TABLE}.speed.{k + 1}": rpm[k] * RPM}
        found |= {
            f"loads.work.time.{k + 1}": time[k] + 5e-4,
            f"loads.work.x.{k + 1}": x[k],
            f"loads.work.y.{k + 1}": y[k],
        }
    return found


def summed(model: Model, parameters: dict[str, float]) -> dict[str, float]:
    """Life and P by counting, and the mean speed of the passes."""
    run = model.simulate(parameters=parameters, times=np.linspace(0.0, END, 40001))
    life, turned = counted(run, "", (INNER_BALL, OUTER_BALL))
    force = np.hypot(run["ring_force.x"], run["ring_force.y"])[:-1]
    mean = float(np.average(force**3, weights=turned)) ** (1 / 3)
    return {"life": life, "P": mean, "speed": float(np.sum(turned)) / END}


def counted(run: Solution, prefix: str, ratings: tuple[float, float]) -> tuple[float, np.ndarray]:
    """Life, and angles between samples: every ball adds the cube of its load to the place it passes, for that angle."""
    load = np.maximum(run[f"{prefix}ball.force"], 0.0)
    balls, places = load.shape[1], 72
    moved = [np.diff(np.unwrap(run[f"{prefix}cage.in_{ring}"])) for ring in ("inner", "outer")]
    turned, load = np.abs(moved[1] - moved[0]), 0.5 * (load[:-1] + load[1:])
    damage = 0.0
    for ring, step, rating in zip(("inner", "outer"), moved, ratings, strict=True):
        angle = run[f"{prefix}cage.in_{ring}"][:-1, None] + 0.5 * step[:, None] + 2.0 * np.pi * np.arange(balls) / balls
        place = (angle / (2.0 * np.pi) % 1.0 * places).astype(int) % places
        cubes = np.bincount(place.ravel(), (turned[:, None] * load**3).ravel(), places)
        field = cubes * places / (balls * np.sum(turned))
        damage += float(np.mean(field ** (10 / 9))) * rating ** (-10 / 3)
    return 1e6 * damage**-0.9, turned


@pytest.mark.long
def test_lives_of_random_tables_are_sums_over_passes(press: Model) -> None:
    """20 tables of speed and load; the sums take samples and have no quadrature, no place that is a hat function."""
    rng = np.random.default_rng(20261123)
    for _ in range(20):
        time = np.concatenate([[0.0], np.sort(rng.uniform(0.05, 1.0, ROWS - 1))])
        time = np.maximum.accumulate(time + 0.01 * np.arange(ROWS))
        rpm, angle = rng.uniform(60.0, 1200.0, ROWS), rng.uniform(0.0, 2.0 * np.pi, ROWS)
        force = rng.choice([0.0, 1.0], ROWS) * rng.uniform(500.0, 4000.0, ROWS)
        parameters = numbers(time, rpm, force * np.cos(angle), force * np.sin(angle))
        (found,) = press.life(parameters=parameters).bearings
        expected = summed(press, parameters)
        assert found.life == pytest.approx(expected["life"], rel=0.01)
        assert found.equivalent_load == pytest.approx(expected["P"], rel=0.01)
        assert abs(found.speed) == pytest.approx(expected["speed"], rel=1e-3)


@pytest.mark.long
def test_a_driver_that_starts_at_rest_has_a_life(press: Model) -> None:
    """Rows of 0 rpm are legal, and no ball passes there: the first one was taken for a bearing that does not turn."""
    rpm = np.array([0.0, 500.0, 500.0, 600.0, 600.0, 0.0])
    parameters = numbers(0.2 * np.arange(ROWS), rpm, np.full(ROWS, 800.0), np.full(ROWS, 300.0))
    (found,) = press.life(parameters=parameters).bearings
    expected = summed(press, parameters)
    assert found.life == pytest.approx(expected["life"], rel=0.01)
    assert found.speed == pytest.approx(expected["speed"], rel=1e-3)
    assert press.quantities("life", parameters=parameters)["life"].value == pytest.approx(found.life, rel=1e-3)
    (still,) = press.life(parameters=numbers(0.2 * np.arange(ROWS), 0.0 * rpm, 0.0 * rpm, 800.0 + 0.0 * rpm)).bearings
    assert "does not turn" in still.why_no_life


def halves(slow: float, fast: float, half: float) -> dict[str, float]:
    """100 rpm for so many seconds, then 900, with a load along y in each."""
    # the load rises, for what falls on a ring at rest is an impact
    time = np.array([0.0, 0.01, half - 1e-3, half + 1e-3, 2.0 * half, 2.0 * half + 1.0])
    speed, load = np.array([100.0] * 3 + [900.0] * 3), np.array([0.0, *[slow] * 2, *[fast] * 3])
    return numbers(time, speed, np.zeros(ROWS), load)


@pytest.mark.long
def test_damage_counts_turns_and_not_seconds(press: Model) -> None:
    """3 kN where it turns slowly, or fast: 25 798 and 2866 h with a rating of 12 793 N, where seconds say 5117 h."""
    hours = []
    for loads in ((-3000.0, 0.0), (0.0, -3000.0)):
        parameters = halves(*loads, 3.0) | {"bearing.clearance": 0.0}
        (found,) = press.life(cycles=50, transient=0, parameters=parameters).bearings
        assert found.life is not None
        hours.append(found.hours(found.life))
        assert found.speed == pytest.approx(500.0 * RPM, rel=1e-3)
    expected = (13.5 / 12.793) ** 3 * np.array([25798.0, 2866.0])
    assert hours == pytest.approx(expected, rel=0.03)  # by L_10; five turns are 15 passes of balls


@pytest.mark.long
def test_lanes_and_derivatives_count_passes_as_well(press: Model) -> None:
    """More speed where the load is low shares out the damage: the life in turns grows."""
    parameters, speed = halves(-2000.0, -3000.0, 0.6), f"{TABLE}.speed.3"
    (found,) = press.life(parameters=parameters).bearings
    step = 1e-3 * parameters[speed]
    moved = {name: [value] * 3 for name, value in parameters.items()}
    moved[speed] = [parameters[speed] + k * step for k in (0.0, 1.0, -1.0)]
    middle, up, down = press.simulate_many(moved, ["life"], rtol=1e-10)["life"].tolist()
    (pair,) = press.sensitivity(of="life", wrt=speed, parameters=parameters, check=False).pairs
    assert middle == pytest.approx(found.life, rel=1e-3)
    assert pair.derivative == pytest.approx((up - down) / (2.0 * step), rel=0.01)
    assert pair.value == pytest.approx(middle, rel=1e-3)
    assert pair.derivative > 0.0


@pytest.mark.long
def test_the_big_end_of_the_press_counts_its_passes(make_model: Callable[..., Model]) -> None:
    """Its rings turn at .94 to 1.06 of their mean speed: a twentieth less than where seconds count."""
    model = make_model("punching_press_hinges", ("outputs = [", 'outputs = ["big_end.cage.in_*", '))
    (bearing,) = (one for one in model.life(cycles=14, transient=2).bearings if one.name == "big_end")
    (info,) = (one for one in model.manifest.bearings if one.name == "big_end")
    ratings = ratings_of(info, model.numbers().values)
    run = model.simulate(cycles=14, transient=2, samples_per_cycle=4000).steady()
    expected, _ = counted(run, "big_end.", (ratings.inner_ball, ratings.outer_ball))
    assert bearing.life == pytest.approx(expected, rel=0.01)
