"""Cases of physics: numbers far from those of the shipped press, against the press written down by hand."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from extremes.case import Case, Finding
from extremes.models import FIXED_RING, ROTOR_LOAD, STEP_TABLE, Change, press, rotor
from extremes.reference import TURN, Machine

GROUP = "Physics"
SPEED = "mechanism.driver.speed"
START = "mechanism.driver.start_angle"
PUNCH = "mechanism.forces.punch.force.y"
WINDOW = "mechanism.forces.punch.window"
CRANK, ROD = "mechanism.bodies.crank.points.B", "mechanism.bodies.rod.points.C"
ROD_CENTER = "mechanism.bodies.rod.center_of_mass"
OUTER = "bearing.outer_ring"
RATIO = "bearing.damping.ratio"
#: Critical damping of the inner ring on its contacts is about 1.3e4 N s/m; the shipped ratio gives 683.
CRITICAL = 20.0
#: The crank starts 7 degrees before the punch, so that a seventh of a turn holds both of its steps.
BEFORE_PUNCH = math.radians(230.0)
SCIPY = "SciPy on the hand-written press; states over their largest value"


def difference(x: np.ndarray, y: np.ndarray) -> float:
    """Largest difference of states over the largest position, and velocity, of the second."""
    half = x.shape[1] // 2
    parts = (slice(None, half), slice(half, None))
    return max(float(np.max(np.abs(x[:, k] - y[:, k])) / (np.max(np.abs(y[:, k])) or 1.0)) for k in parts)


def against_scipy(
    parameters: Mapping[str, float],
    *,
    law: str = "one-sided",
    changes: tuple[Change, ...] = (),
    duration: float | None = None,
    turns: float = 0.15,
    method: str = "stepper",
    rtol: float = 1e-8,
    by: str = "DOP853",
    tight: float = 1e-9,
    bound: float = 1e-4,
    relative: Mapping[str, float] | None = None,
    initial: np.ndarray | None = None,
) -> Finding:
    """A run from seven degrees before the punch, against SciPy's from the same start.

    Parameters
    ----------
    relative : factors on the scene's values, besides `parameters`
    by, tight : SciPy's method and relative tolerance
    """
    model = press(law, *changes)
    scaled = {name: model.parameters[name] * factor for name, factor in (relative or {}).items()}
    numbers = {START: BEFORE_PUNCH, **scaled, **parameters}
    span = turns * model.period(numbers) if duration is None else duration
    solution = model.simulate(
        duration=span,
        parameters=numbers,
        method=method,
        rtol=rtol,
        samples_per_cycle=max(1, round(200 * model.period(numbers) / span)),
        transient=0,
        initial=initial,
    )
    machine = Machine.of(model, numbers)
    magnitude = np.max(np.abs(solution.x), axis=0) + 1e-12
    expected = machine.integrate(solution.t, solution.x[0], method=by, rtol=tight, magnitude=1e-2 * magnitude)
    steps = solution.statistics.steps
    return Finding(
        status="done", error=difference(solution.x, expected), bound=bound, note=f"{steps} steps" if steps else ""
    )


#: Lines of the shipped scene and what stands there instead.
GIVEN_MASS: tuple[Change, ...] = (
    ("[bearing.inner_ring.equivalent_mass]", '[bearing.inner_ring]\nmass = "0.4 kg"'),
    ('ring = "0.032 kg" ', "#"),
    ('crankpin = "0.05 kg" ', "#"),
    ('crank = "whole" ', "#"),
)
OFF_LINE: tuple[Change, ...] = (
    *GIVEN_MASS,
    ('guide = "origin" ', 'guide = ["93.99 mm", "-10 mm"]  #'),
    ('{ distance = "0 mm", angle = "0 deg" }', '{ distance = "4 mm", angle = "150 deg" }'),
    ('center_of_mass = "50 mm"  ', 'center_of_mass = ["38 mm", "7 mm"]  #'),
    (
        'window = { start = "237 deg", end = "267 deg" }',
        'window = [{ start = "237 deg", end = "250 deg" }, { start = "260 deg", end = "267 deg" }]',
    ),
)
SIXTY: tuple[Change, ...] = (
    ("balls = 8  ", "balls = 60  #"),
    ('ball_diameter = "7.9375 mm"', 'ball_diameter = "1.7 mm"'),
    ('groove_radius = "4.1275 mm"', 'groove_radius = "0.884 mm"'),
    ('groove_radius = "4.206875 mm"', 'groove_radius = "0.901 mm"'),
)


def of_size(diameter: float) -> dict[str, float]:
    """Numbers of the 6204 scaled to another ball diameter [m]."""
    factor = diameter / 7.9375e-3
    return {
        "bearing.ball_diameter": diameter,
        "bearing.pitch_diameter": factor * 33.5e-3,
        "bearing.contact.inner_groove_radius": factor * 4.1275e-3,
        "bearing.contact.outer_groove_radius": factor * 4.206875e-3,
    }


def _press_cases() -> list[Case]:
    """Numbers of the press, one extreme at a time."""
    table: list[tuple[str, dict[str, float], dict[str, Any], bool]] = [
        ("60 000 rpm", {SPEED: 60_000 * TURN / 60.0}, {}, True),
        (
            "1 rpm, 15 ms around the start of the punch",
            {SPEED: TURN / 60.0, START: math.radians(236.98)},
            {"duration": 15e-3},
            True,
        ),
        ("5000 rpm clockwise", {SPEED: -5000.0 * TURN / 60.0, START: math.radians(270.0)}, {}, False),
        ("punch 0 N", {PUNCH: 0.0}, {}, False),
        ("punch 1 mN", {PUNCH: 1e-3}, {}, False),
        ("punch 1 MN", {PUNCH: 1e6}, {}, True),
        ("clearance -30 um (preload)", {"bearing.clearance": -30e-6}, {}, True),
        ("clearance 1 mm", {"bearing.clearance": 1e-3}, {"bound": 1e-3}, True),
        (
            "outer ring 1 mg",
            {f"{OUTER}.mass": 1e-6, START: math.radians(236.0)},
            {"by": "LSODA", "tight": 1e-8, "turns": 0.02},
            True,
        ),
        ("outer ring 1 g", {f"{OUTER}.mass": 1e-3}, {"by": "LSODA", "bound": 1e-3}, False),
        ("outer ring 10 t", {f"{OUTER}.mass": 1e4}, {}, False),
        (
            "inner ring 1 mg",
            {
                "bearing.inner_ring.equivalent_mass.ring": 1e-6,
                "mechanism.bodies.crank.mass": 1e-12,
                "bearing.inner_ring.equivalent_mass.crankpin": 0.0,
            },
            {"by": "LSODA", "tight": 1e-8, "bound": 1e-3},
            False,
        ),
        ("inner ring 10 t", {"bearing.inner_ring.equivalent_mass.ring": 1e4}, {}, False),
        ("slider 1 mg", {"mechanism.bodies.slider.mass": 1e-6}, {}, False),
        ("slider 10 t", {"mechanism.bodies.slider.mass": 1e4}, {}, False),
        ("housing stiffness 0", {f"{OUTER}.stiffness": 0.0}, {}, True),
        ("housing stiffness 1 N/m", {f"{OUTER}.stiffness": 1.0}, {}, True),
        ("housing stiffness 1e10 N/m", {f"{OUTER}.stiffness": 1e10}, {}, False),
        ("housing damping 0", {f"{OUTER}.damping": 0.0}, {}, False),
        ("housing damping 1e9 N s/m", {f"{OUTER}.damping": 1e9}, {"by": "LSODA", "tight": 1e-8}, False),
        ("contact damping 0", {RATIO: 0.0}, {}, False),
        ("crank 5 um, rod 83 um", {CRANK: 5e-6, ROD: 5e-6 / 0.06, ROD_CENTER: 5e-6 / 0.12}, {}, False),
        ("crank 5 m, rod 83 m", {CRANK: 5.0, ROD: 5.0 / 0.06, ROD_CENTER: 5.0 / 0.12}, {}, False),
        ("crank over rod 0.9999", {CRANK: 0.09999, START: math.radians(350.0)}, {"turns": 0.05}, True),
        ("start at bottom dead centre", {START: math.radians(270.0)}, {}, False),
        ("start at top dead centre", {START: math.radians(90.0)}, {}, False),
        (
            "crank balanced to the far side, theta_1p = 150 deg",
            {
                "mechanism.bodies.crank.center_of_mass.distance": 0.02,
                "mechanism.bodies.crank.center_of_mass.angle": math.radians(150.0),
            },
            {"changes": GIVEN_MASS},
            False,
        ),
        ("window of zero width", {f"{WINDOW}.end": math.radians(237.0)}, {}, True),
        ("window over 360 deg", {f"{WINDOW}.end": math.radians(237.0 + 400.0)}, {"changes": (), "turns": 0.1}, True),
        (
            "window wrapping through 0 deg",
            {f"{WINDOW}.start": math.radians(350.0), f"{WINDOW}.end": math.radians(10.0), START: math.radians(340.0)},
            {},
            True,
        ),
        ("start inside 200 um of penetration", {}, {"initial": np.array([0.0, -205e-6, *[0.0] * 6])}, True),
        (
            "two windows, guide offset to 93.99 of 94 mm, masses off the links",
            {START: math.radians(230.0)},
            {"changes": OFF_LINE, "turns": 0.2},
            False,
        ),
        ("3 balls", {}, {"changes": (("balls = 8  ", "balls = 3  "),)}, False),
        ("60 balls of 1.7 mm", {}, {"changes": SIXTY}, False),
        ("balls of 0.5 mm", of_size(0.5e-3), {"bound": 1e-3}, False),
        ("balls of 100 mm", of_size(0.1), {}, False),
    ]
    return [
        Case(
            group=GROUP,
            name=name,
            method="stepper",
            against=SCIPY,
            quick=quick,
            run=partial(against_scipy, numbers, **options),
        )
        for name, numbers, options, quick in table
    ]


#: Where every law is taken besides, and for what part of a turn: across 1 mm each impact amplifies differences.
LAW_EXTREMES: tuple[tuple[str, dict[str, float], float], ...] = (
    ("60 000 rpm", {SPEED: 60_000 * TURN / 60.0}, 0.15),
    ("punch 1 MN", {PUNCH: 1e6}, 0.05),
    ("clearance -30 um", {"bearing.clearance": -30e-6}, 0.05),
    ("clearance 1 mm", {"bearing.clearance": 1e-3}, 0.022),
)
LAWS = ("none", "one-sided", "one-sided-gated", "two-sided-gated", "tangent")


def _law_cases() -> list[Case]:
    """Every damping law, at the shipped coefficient and at a hundred times critical damping."""
    cases = []
    for law in LAWS:
        options: dict[str, Any] = {"law": law, "bound": 1e-3}
        if law == "none":
            options |= {"turns": 0.1, "rtol": 1e-10, "tight": 1e-11}
        cases.append((f"law {law}", options, law == "two-sided-gated"))
        if law != "none":
            far = {"relative": {RATIO: 100.0 * CRITICAL}, "by": "LSODA", "tight": 1e-8, "bound": 2e-3}
            cases.append((f"law {law}, 100 times critical", options | far, False))
    found = [
        Case(
            group=GROUP,
            name=name,
            method="stepper",
            against=SCIPY,
            quick=quick,
            run=partial(against_scipy, {}, **options),
        )
        for name, options, quick in cases
    ]
    found += [
        Case(
            group=GROUP,
            name=f"law {law}, {words}",
            method="stepper",
            against=SCIPY,
            run=partial(against_scipy, numbers, law=law, bound=1e-3, turns=turns),
        )
        for law in LAWS
        if law != "one-sided"  # that of the cases above
        for words, numbers, turns in LAW_EXTREMES
    ]
    return found


def static_press() -> Finding:
    """Speed zero inside the window: the rings come to rest where forces balance."""
    model = press()
    numbers = {SPEED: 0.0, START: math.radians(240.0), f"{OUTER}.damping": 5e3}
    solution = model.simulate(duration=0.5, parameters=numbers, rtol=1e-10, samples_per_cycle=100, transient=0)
    machine = Machine.of(model, numbers)
    end = machine.equilibrium(0.0, True, solution.x[-1, :4])
    return Finding(
        status="done", error=float(np.max(np.abs(solution.x[-1, :4] - end)) / np.max(np.abs(end))), bound=1e-8
    )


def rigid_housing() -> Finding:
    """A housing of 1e13 N/m, against the scene with a fixed outer ring."""
    numbers = {START: BEFORE_PUNCH}
    soft = press().simulate(
        duration=0.018,
        parameters={**numbers, f"{OUTER}.stiffness": 1e13},
        rtol=1e-8,
        samples_per_cycle=1000,
        transient=0,
    )
    fixed = press("one-sided", *FIXED_RING).simulate(
        duration=0.018, parameters=numbers, rtol=1e-8, samples_per_cycle=1000, transient=0
    )
    error = difference(soft.x[:, [0, 1, 4, 5]], fixed.x)
    # the housing still gives 4 kN / 1e13 N/m, a hundred-thousandth of the contacts' deflection
    return Finding(status="done", error=error, bound=1e-4, note=f"{soft.statistics.steps} steps")


def quasi_static_turn() -> Finding:
    """At 1 rpm the rings follow the load: where it is constant for long, they stand in its equilibrium."""
    model = press()
    numbers = {SPEED: TURN / 60.0}
    solution = model.simulate(cycles=1, parameters=numbers, rtol=1e-8, samples_per_cycle=72, transient=0)
    machine = Machine.of(model, numbers)
    assert machine.linkage is not None
    worst = 0.0
    for t, x in zip(solution.t[1:], solution.x[1:], strict=True):
        end = machine.equilibrium(t, machine.linkage.punching(machine.linkage.speed * t), x[:4])
        worst = max(worst, float(np.max(np.abs(x[:4] - end)) / np.max(np.abs(end))))
    # dampers turn with the cage: their drag moves the rings by c v / k
    return Finding(status="done", error=worst, bound=1e-3, note=f"{solution.statistics.steps} steps")


def step_in_free_flight() -> Finding:
    """A load that steps onto a ring inside its clearance: F t^2 / 2m until it touches."""
    model = rotor((ROTOR_LOAD, STEP_TABLE))
    numbers = {
        "load.x.1": 0.0, "load.x.2": 100.0, "load.time.1": 0.01, "load.time.2": 0.01 + 1e-9,
        "bearing.clearance": 1e-3, "bearing.initial.inner.x": 0.0, "bearing.initial.inner.y": 0.0,
        "bearing.inner_ring.damping": 0.0, "bearing.inner_ring.mass": 0.5,
    }  # fmt: skip
    solution = model.simulate(duration=0.012, parameters=numbers, rtol=1e-9, samples_per_cycle=5000, transient=0)
    flight = np.maximum(solution.t - 0.01, 0.0)
    expected = 0.5 * 100.0 / 0.5 * flight**2
    error = float(np.max(np.abs(solution["inner.x"] - expected)) / np.max(expected))
    return Finding(status="done", error=error, bound=1e-6)


def all_balls_free() -> Finding:
    """Nothing touches and nothing pulls: a straight line."""
    model = press()
    numbers = {"bearing.share": 0.0, "bearing.clearance": 1e-3, RATIO: 0.0, f"{OUTER}.damping": 0.0}
    start = np.array([1e-5, 0.0, 0.0, 0.0, 1e-3, 2e-3, 0.0, 0.0])
    solution = model.simulate(
        cycles=1, parameters=numbers, initial=start, rtol=1e-8, samples_per_cycle=100, transient=0
    )
    expected = start[:2] + np.outer(solution.t, start[4:6])
    return Finding(
        status="done", error=float(np.max(np.abs(solution.x[:, :2] - expected)) / np.max(expected)), bound=1e-10
    )


def stiffness_of_size(diameter: float) -> Finding:
    """Hertz: the stiffness of similar contacts grows with the root of their size; 8.64473e9 N/m^1.5 is a 6204's."""
    expected = 8.64473e9 * math.sqrt(diameter / 7.9375e-3)
    found = press().constants(of_size(diameter))["bearing.k_b"]
    return Finding(status="done", error=abs(found / expected - 1.0), bound=1e-6)


def cases() -> list[Case]:
    """All of this section."""
    words = "closed form"
    plain: list[tuple[str, str, str, Any, bool]] = [
        ("speed 0 inside the punch window", "stepper", "SciPy's root of the balance of forces", static_press, True),
        ("housing stiffness 1e13 N/m", "stepper", "the scene with a fixed outer ring", rigid_housing, False),
        ("1 rpm, a whole turn", "stepper", "equilibrium at each sample by SciPy's root", quasi_static_turn, False),
        ("step load on a ring in free flight", "stepper", words, step_in_free_flight, True),
        ("all balls out of contact", "stepper", words, all_balls_free, True),
        (
            "stiffness of balls of 0.5 mm",
            "constants",
            "square root of the size",
            partial(stiffness_of_size, 0.5e-3),
            True,
        ),
        ("stiffness of balls of 100 mm", "constants", "square root of the size", partial(stiffness_of_size, 0.1), True),
    ]
    return [
        *_press_cases(),
        *_law_cases(),
        *(
            Case(group=GROUP, name=name, method=method, against=against, run=run, quick=quick)
            for name, method, against, run, quick in plain
        ),
    ]
