"""Late times: where crank and balls are after 100 000 turns, and the motion there."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping

import mpmath
import numpy as np
import pytest
from replacements import RATIO, SPEED, START, TURN

from ballpass.runtime import Model
from ballpass.runtime.time import timeline

pytestmark = pytest.mark.extreme

Holds = Callable[..., None]
Press = Callable[..., Model]

BALL = "bearing.ball_angle"
#: What tells the angles of a run: that of the crank, and the deflections of the balls between two rings.
TELLING = ["body.crank.angle", "ball.deflection", "inner.x", "inner.y", "outer.x", "outer.y"]
#: The shipped press with these outputs alone.
TOLD = (
    'outputs = ["inner.*", "outer.*", "ball.*", "reaction.A.*", "drive_torque"]',
    f"outputs = {json.dumps(TELLING)}",
)
#: Error of a phase that is allowed [rad].
ALLOWED = 1e-9
#: Contacts damped so that a turn takes few steps; angles do not depend on it.
HEAVY = 30.0
RPM = TURN / 60.0


def exact_phase(offset: float, rate: float, t: float, ratio: mpmath.mpf | None = None) -> mpmath.mpf:
    """offset + ratio rate t modulo a turn, the numbers taken as they are, to forty digits [rad]."""
    with mpmath.workdps(40):
        angle = mpmath.mpf(offset) + (mpmath.mpf(1) if ratio is None else ratio) * mpmath.mpf(rate) * mpmath.mpf(t)
        return mpmath.fmod(angle, 2 * mpmath.pi)


def apart(angle: float, exact: mpmath.mpf) -> float:
    """Distance of two angles on the circle [rad]."""
    with mpmath.workdps(40):
        return float(abs(mpmath.fmod(mpmath.mpf(angle) - exact + 3 * mpmath.pi, 2 * mpmath.pi) - mpmath.pi))


def cage_ratio(p: Mapping[str, float]) -> mpmath.mpf:
    """Speed of the cage over that of the shaft, Eq. (7)."""
    with mpmath.workdps(40):
        return (1 - mpmath.mpf(p["bearing.ball_diameter"]) / mpmath.mpf(p["bearing.pitch_diameter"])) / 2


def ball_angles(deflection: np.ndarray, gap: np.ndarray) -> np.ndarray:
    """Angle of the first ball from the deflections of all, shape (samples, balls), and the rings' distance x + i y.

    Ball j is pressed by gap.x cos + gap.y sin less a constant; over all balls the first harmonic has the angle of the
    first ball less that of the distance.
    """
    balls = deflection.shape[1]
    harmonic = deflection @ np.exp(-1j * TURN * np.arange(balls) / balls)
    return np.asarray(np.angle(harmonic) + np.angle(gap))


def worst_angle(p: Mapping[str, float], t: np.ndarray, told: Mapping[str, np.ndarray]) -> float:
    """Largest error of the angles of crank and balls at these times [rad]."""
    gap = (told["inner.x"] - told["outer.x"]) + 1j * (told["inner.y"] - told["outer.y"])
    balls = ball_angles(told["ball.deflection"], gap)
    worst = 0.0
    for k, time in enumerate(t):
        crank = exact_phase(p[START], p[SPEED], float(time))
        ball = exact_phase(p[BALL], p[SPEED], float(time), cage_ratio(p))
        worst = max(worst, apart(float(told["body.crank.angle"][k]), crank), apart(float(balls[k]), ball))
    return worst


def test_phases_after_100_000_turns(press: Press, holds: Holds) -> None:
    """Angles of crank and cage that inputs are computed from, after 100 000 turns, against mpmath [rad]."""
    model = press()
    numbers = model.numbers({START: 1.0, BALL: 0.3})
    worst = 0.0
    for k in (100_000, 99_999, 33_333):
        t = k * timeline.driver(model.manifest, numbers.values).turn
        found = timeline.inputs_at(model.manifest, numbers.values, t)
        for info, value in zip(model.manifest.inputs, found, strict=True):
            if info.kind == "phase":
                turning = timeline.info_of(model.manifest, info)
                exact = exact_phase(numbers.values[turning.offset], numbers.values[turning.rate], t)
                worst = max(worst, apart(value, exact))
    holds(worst, ALLOWED)


@pytest.mark.parametrize(
    ("turns", "rpm"),
    [
        (1000.37, 500.0),
        (100_000.37, 500.0),
        (100_000.37, 10_000.0),
        (100_000.37, -5000.0),
    ],
)
def test_angles_of_late_samples(press: Press, holds: Holds, turns: float, rpm: float) -> None:
    """Angles of crank and balls in the last ten samples, one sample a turn, against mpmath [rad]."""
    model = press("one-sided", TOLD)
    numbers = {SPEED: rpm * RPM, START: 1.0, BALL: 0.3, RATIO: HEAVY * model.parameters[RATIO]}
    solution = model.simulate(
        cycles=turns, parameters=numbers, samples_per_cycle=1, transient=turns - 10.0, rtol=1e-2, outputs=TELLING
    )
    late = solution.steady()
    assert 1 <= len(late.t) <= 12
    assert late.t[-1] == solution.t[-1]
    told = {name: late[name] for name in TELLING}
    worst = worst_angle({**model.parameters, **numbers}, late.t, told)
    holds(worst, ALLOWED, f"{solution.statistics.steps} steps")


def test_angles_at_chosen_times(press: Press, holds: Holds) -> None:
    """The same at chosen times within 1000 turns, which fall on no step and no turn, against mpmath [rad]."""
    model = press("one-sided", TOLD)
    numbers = {START: 1.0, BALL: 0.3, RATIO: HEAVY * model.parameters[RATIO]}
    times = np.array([0.1, 0.37, 0.9, 0.9999, 1.0]) * 1000 * model.period(numbers)
    solution = model.simulate(times=times, parameters=numbers, rtol=1e-2, outputs=TELLING, transient=0)
    worst = worst_angle({**model.parameters, **numbers}, solution.t, {name: solution[name] for name in TELLING})
    holds(worst, ALLOWED, f"{solution.statistics.steps} steps")


@pytest.mark.parametrize("turns", [150, pytest.param(100_000, marks=pytest.mark.long)])
def test_late_motion_equals_a_fresh_start(press: Press, holds: Holds, turns: int) -> None:
    """The motion after many turns equals that of six turns whose balls start where exact arithmetic has them."""
    model, fresh = press(), 6
    heavy = {RATIO: HEAVY * model.parameters[RATIO]}
    late = model.reduce(cycles=turns, transient=0, parameters=heavy, rtol=1e-6)
    numbers = model.numbers(heavy)
    t = (turns - fresh) * timeline.driver(model.manifest, numbers.values).turn
    angle = float(exact_phase(0.0, numbers.values[SPEED], t, cage_ratio(numbers.parameters)))
    again = model.reduce(cycles=fresh, transient=0, parameters={**heavy, BALL: angle}, rtol=1e-6)
    size = max(again["inner.y"].range, again["inner.x"].range)
    error = max(abs(late.end[name] - again.end[name]) for name in ("inner.x", "inner.y", "outer.x", "outer.y")) / size
    holds(error, 1e-5, f"{late.steps} steps")
