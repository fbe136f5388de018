"""Cases of late times: where crank and balls are after 100 000 turns, and the motion there."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from functools import partial
from pathlib import Path

import mpmath
import numpy as np

from ballpass.runtime import load_solution
from ballpass.runtime.run import inputs as clock
from extremes.case import Case, Finding
from extremes.models import Change, press, text_of
from extremes.reference import TURN

GROUP = "Physics"
SPEED = "mechanism.driver.speed"
START = "mechanism.driver.start_angle"
BALL = "bearing.ball_angle"
RATIO = "bearing.damping.ratio"
#: What tells the angles of a run: that of the crank, and the deflections of the balls between two rings.
TELLING = ["body.crank.angle", "ball.deflection", "inner.x", "inner.y", "outer.x", "outer.y"]
#: The shipped press with these outputs alone.
TOLD: Change = (
    'outputs = ["inner.*", "outer.*", "ball.*", "reaction.A.*", "drive_torque"]',
    f"outputs = {json.dumps(TELLING)}",
)
#: Error of a phase that is allowed [rad].
ALLOWED = 1e-9
#: Contacts damped so that a turn takes few steps; angles do not depend on it.
HEAVY = 30.0


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


def _worst(p: Mapping[str, float], t: np.ndarray, told: Mapping[str, np.ndarray]) -> float:
    """Largest error of the angles of crank and balls at these times [rad]."""
    gap = (told["inner.x"] - told["outer.x"]) + 1j * (told["inner.y"] - told["outer.y"])
    balls = ball_angles(told["ball.deflection"], gap)
    ratio = cage_ratio(p)
    worst = 0.0
    for k, time in enumerate(t):
        crank = exact_phase(p[START], p[SPEED], float(time))
        ball = exact_phase(p[BALL], p[SPEED], float(time), ratio)
        worst = max(worst, apart(float(told["body.crank.angle"][k]), crank), apart(float(balls[k]), ball))
    return worst


def phases(turns: int) -> Finding:
    """Angles of crank and cage that the clock gives after many turns."""
    model = press()
    numbers = model.numbers({START: 1.0, BALL: 0.3})
    worst = 0.0
    for k in (turns, turns - 1, turns // 3):
        t = k * clock.period(model.manifest, numbers.values)
        found = clock.inputs_at(model.manifest.inputs, numbers.values, t)
        for info, value in zip(model.manifest.inputs, found, strict=True):
            if info.kind == "phase":
                exact = exact_phase(numbers.values[info.offset], numbers.values[info.rate], t)
                worst = max(worst, apart(value, exact))
    return Finding(status="done", error=worst, bound=ALLOWED)


def simulated(turns: float, speed: float) -> Finding:
    """Angles of crank and balls in the last ten samples of ``model.simulate``, one sample a turn."""
    model = press("one-sided", TOLD)
    numbers = {SPEED: speed, START: 1.0, BALL: 0.3, RATIO: HEAVY * model.parameters[RATIO]}
    solution = model.simulate(
        cycles=turns, parameters=numbers, samples_per_cycle=1, transient=max(0.0, turns - 10.0), rtol=1e-2,
        outputs=TELLING,
    )  # fmt: skip
    late = solution.steady()
    assert 1 <= len(late.t) <= 12, len(late.t)
    assert late.t[-1] == solution.t[-1]
    moved = late.t > 0.0  # rings that are concentric do not tell where the balls are
    told = {name: late[name][moved] for name in TELLING}
    worst = _worst({**model.parameters, **numbers}, late.t[moved], told)
    return Finding(status="done", error=worst, bound=ALLOWED, note=f"{solution.statistics.steps} steps")


def sampled(turns: int) -> Finding:
    """The same at chosen times, which fall on no step and no turn."""
    model = press("one-sided", TOLD)
    numbers = {START: 1.0, BALL: 0.3, RATIO: HEAVY * model.parameters[RATIO]}
    times = np.array([0.1, 0.37, 0.9, 0.9999, 1.0]) * turns * model.period(numbers)
    solution = model.simulate(times=times, parameters=numbers, rtol=1e-2, outputs=TELLING, transient=0)
    worst = _worst({**model.parameters, **numbers}, solution.t, {name: solution[name] for name in TELLING})
    return Finding(status="done", error=worst, bound=ALLOWED, note=f"{solution.statistics.steps} steps")


def commanded(turns: int) -> Finding:
    """Angles in the file that ``ballpass run`` writes after so many turns, of the last samples."""
    text = text_of(
        "punching_press",
        TOLD,
        ("samples_per_cycle = 2000", "samples_per_cycle = 16"),  # the fewest that a scene may ask for
        ("rtol = 1e-6", "rtol = 1e-2"),
    )
    with tempfile.TemporaryDirectory(prefix="ballpass-extremes-") as name:
        scene = Path(name) / "punching_press.toml"
        scene.write_text(text, encoding="utf-8")
        done = subprocess.run(
            (sys.executable, "-c", "from ballpass.runtime.app.cli import main; main()", "run", str(scene), "--cycles",
             str(turns), "--transient", str(turns - 10), "--set", "mechanism.driver.start_angle=1 rad", "--set",
             "bearing.damping.ratio=2.4e-6 s*m^0.5", "--no-figures", "--json", "--out", "late"),
            cwd=name, capture_output=True, text=True, check=False, timeout=900, env=dict(os.environ),
        )  # fmt: skip
        assert done.returncode == 0, done.stderr[-2000:]
        steps = json.loads(done.stdout)["steps"]
        solution = load_solution(Path(name) / "late" / "solution.nc")
        told = {item: np.asarray(solution[item])[-10:] for item in TELLING}
        p, t = dict(solution.parameters), np.asarray(solution.t)[-10:]
    assert abs(t[-1] * p[SPEED] / TURN - turns) < 1e-6
    return Finding(status="done", error=_worst(p, t, told), bound=ALLOWED, note=f"{steps} steps")


def late_motion(turns: int) -> Finding:
    """The motion after many turns, against a fresh run whose balls start where exact arithmetic has them."""
    model = press()
    fresh = 6
    heavy = {RATIO: HEAVY * model.parameters[RATIO]}
    late = model.reduce(cycles=turns, transient=0, parameters=heavy, rtol=1e-6)
    numbers = model.numbers(heavy)
    t = (turns - fresh) * clock.period(model.manifest, numbers.values)
    angle = float(exact_phase(0.0, numbers.values[SPEED], t, cage_ratio(numbers.parameters)))
    again = model.reduce(cycles=fresh, transient=0, parameters={**heavy, BALL: angle}, rtol=1e-6)
    size = max(again["inner.y"].range, again["inner.x"].range)
    error = max(abs(late.end[name] - again.end[name]) for name in ("inner.x", "inner.y", "outer.x", "outer.y")) / size
    return Finding(status="done", error=error, bound=1e-5, note=f"{late.steps} steps")


def cases() -> list[Case]:
    """All about late times, in the section of physics."""
    exact, shaft = "mpmath [rad]", TURN / 60.0
    table = [
        ("phases after 100 000 turns", "clock", exact, partial(phases, 100_000), True, False),
        ("angles of crank and balls after 1 turn", "simulate", exact, partial(simulated, 1.0, 500 * shaft), True,
         False),
        ("angles after 1000.37 turns", "simulate", exact, partial(simulated, 1000.37, 500 * shaft), True, False),
        ("angles after 1000 turns at chosen times", "simulate", exact, partial(sampled, 1000), False, False),
        ("angles after 300 turns", "ballpass run", exact, partial(commanded, 300), True, False),
        *(
            (f"angles after 100 000 turns at {rpm:g} rpm", "simulate", exact,
             partial(simulated, 100_000.37, rpm * shaft), False, True)
            for rpm in (500.0, 60_000.0, -5000.0)
        ),
        ("angles after 100 000 turns", "ballpass run", exact, partial(commanded, 100_000), False, True),
        *(
            (f"motion after {words} turns", "reduce", "six turns from the exact ball angle",
             partial(late_motion, turns), turns == 150, turns > 1000)
            for words, turns in (("150", 150), ("1000", 1000), ("100 000", 100_000))
        ),
    ]  # fmt: skip
    return [
        Case(group=GROUP, name=name, method=method, against=against, run=run, quick=quick, long=long)
        for name, method, against, run, quick, long in table
    ]
