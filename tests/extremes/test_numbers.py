"""Numbers far from those of the shipped press, against the press written down by hand and integrated by SciPy."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest
from hand_written_press import Machine
from replacements import (
    BEFORE_PUNCH,
    CLEARANCE,
    CRANK,
    FAST,
    FIXED_RING,
    GIVEN_MASS,
    OFF_LINE,
    OUTER,
    PUNCH,
    RATIO,
    ROD,
    ROD_CENTER,
    ROTOR_LOAD,
    SIXTY_BALLS,
    SPEED,
    START,
    STRETCHED,
    STRONG,
    TINY,
    TURN,
    WINDOW,
    Change,
)  # fmt: skip

from ballpass.runtime import IntegrationError, Model, Solution

pytestmark = pytest.mark.extreme

Holds = Callable[..., None]
Press = Callable[..., Model]


def difference(x: np.ndarray, y: np.ndarray) -> float:
    """Largest difference of states over the largest position, and velocity, of the second."""
    half = x.shape[1] // 2
    parts = (slice(None, half), slice(half, None))
    return max(float(np.max(np.abs(x[:, k] - y[:, k])) / (np.max(np.abs(y[:, k])) or 1.0)) for k in parts)


def against_scipy(
    holds: Holds,
    model: Model,
    parameters: Mapping[str, float],
    *,
    duration: float | None = None,
    turns: float = 0.15,
    rtol: float = 1e-8,
    by: str = "DOP853",
    tight: float = 1e-9,
    bound: float = 1e-4,
    initial: np.ndarray | None = None,
) -> None:
    """A run from seven degrees before the punch, against SciPy's (method, relative tolerance) from the same start."""
    numbers = {START: BEFORE_PUNCH, **parameters}
    span = turns * model.period(numbers) if duration is None else duration
    per_cycle = max(1, round(200 * model.period(numbers) / span))
    solution = model.simulate(
        duration=span, parameters=numbers, rtol=rtol, samples_per_cycle=per_cycle, transient=0, initial=initial
    )
    expected = by_scipy(model, solution, numbers, by, tight)
    holds(difference(solution.x, expected), bound, f"{solution.statistics.steps} steps")


def by_scipy(
    model: Model, solution: Solution, numbers: Mapping[str, float], by: str = "DOP853", tight: float = 1e-9
) -> np.ndarray:
    """States of the press written by hand, at the samples of a run and from its start."""
    magnitude = np.max(np.abs(solution.x), axis=0) + 1e-12
    machine = Machine.of(model, numbers)
    return machine.integrate(solution.t, solution.x[0], method=by, rtol=tight, magnitude=1e-2 * magnitude)


def of_size(diameter: float) -> dict[str, float]:
    """Numbers of the 6204 scaled to another ball diameter [m]."""
    factor = diameter / 7.9375e-3
    return {
        "bearing.ball_diameter": diameter,
        "bearing.pitch_diameter": factor * 33.5e-3,
        "bearing.contact.inner_groove_radius": factor * 4.1275e-3,
        "bearing.contact.outer_groove_radius": factor * 4.206875e-3,
    }


STIFF = {"by": "LSODA", "tight": 1e-8}
LIGHT_INNER_RING = {
    "bearing.inner_ring.equivalent_mass.ring": 1e-6,
    "mechanism.bodies.crank.mass": 1e-12,
    "bearing.inner_ring.equivalent_mass.crankpin": 0.0,
}
BALANCED = {
    "mechanism.bodies.crank.center_of_mass.distance": 0.02,
    "mechanism.bodies.crank.center_of_mass.angle": math.radians(150.0),
}
THROUGH_ZERO = {f"{WINDOW}.start": math.radians(350.0), f"{WINDOW}.end": math.radians(10.0), START: math.radians(340.0)}
#: Words, numbers, replacements in the scene, options of the comparison.
NUMBERS: tuple[tuple[str, dict[str, float], tuple[Change, ...], dict[str, Any]], ...] = (
    ("15 000 rpm", FAST, (), {}),
    ("1 rpm, 15 ms", {SPEED: TURN / 60.0, START: math.radians(236.98)}, (), {"duration": 15e-3}),
    ("5000 rpm clockwise", {SPEED: -5000.0 * TURN / 60.0, START: math.radians(270.0)}, (), {}),
    ("punch 0 N", {PUNCH: 0.0}, (), {}),
    ("punch 1 mN", {PUNCH: 1e-3}, (), {}),
    ("punch 300 kN", {PUNCH: STRONG}, (), {}),
    ("clearance -30 um", {CLEARANCE: -30e-6}, (), {}),
    ("clearance 1 mm", {CLEARANCE: 1e-3}, (), {"bound": 1e-3}),
    ("outer ring 1 mg", {f"{OUTER}.mass": 1e-6, START: math.radians(236.0)}, (), {**STIFF, "turns": 0.02}),
    ("outer ring 1 g", {f"{OUTER}.mass": 1e-3}, (), {"by": "LSODA", "bound": 1e-3}),
    ("outer ring 10 t", {f"{OUTER}.mass": 1e4}, (), {}),
    ("inner ring 1 mg", LIGHT_INNER_RING, (), {**STIFF, "bound": 1e-3}),
    ("inner ring 10 t", {"bearing.inner_ring.equivalent_mass.ring": 1e4}, (), {}),
    ("slider 1 mg", {"mechanism.bodies.slider.mass": 1e-6}, (), {}),
    ("slider 10 t", {"mechanism.bodies.slider.mass": 1e4}, (), {}),
    ("housing stiffness 0", {f"{OUTER}.stiffness": 0.0}, (), {}),
    ("housing stiffness 1 N/m", {f"{OUTER}.stiffness": 1.0}, (), {}),
    ("housing stiffness 1e10 N/m", {f"{OUTER}.stiffness": 1e10}, (), {}),
    ("housing damping 0", {f"{OUTER}.damping": 0.0}, (), {}),
    ("housing damping 1e9 N s/m", {f"{OUTER}.damping": 1e9}, (), STIFF),
    ("contact damping 0", {RATIO: 0.0}, (), {}),
    ("crank 5 um, rod 83 um", TINY, (), {}),
    ("crank 5 m, rod 83 m", {CRANK: 5.0, ROD: 5.0 / 0.06, ROD_CENTER: 5.0 / 0.12}, (), {}),
    ("crank over rod 0.9999", STRETCHED, (), {"turns": 0.05}),
    ("start at bottom dead centre", {START: math.radians(270.0)}, (), {}),
    ("start at top dead centre", {START: math.radians(90.0)}, (), {}),
    ("crank balanced to the far side", BALANCED, GIVEN_MASS, {}),
    ("window of zero width", {f"{WINDOW}.end": math.radians(237.0)}, (), {}),
    ("window over 360 deg", {f"{WINDOW}.end": math.radians(637.0)}, (), {"turns": 0.1}),
    ("window through 0 deg", THROUGH_ZERO, (), {}),
    ("start inside 200 um of penetration", {}, (), {"initial": np.array([0.0, -205e-6, *[0.0] * 6])}),
    ("two windows, guide offset to 93.99 of 94 mm, masses off the links", {}, OFF_LINE, {"turns": 0.2}),
    ("3 balls", {}, (("balls = 8  ", "balls = 3  "),), {}),
    ("60 balls of 1.7 mm", {}, SIXTY_BALLS, {}),
    ("balls of 0.5 mm, punch 1 kN", {**of_size(0.5e-3), PUNCH: 1e3}, (), {"bound": 1e-3}),
    ("balls of 100 mm", of_size(0.1), (), {}),
)  # fmt: skip


@pytest.mark.parametrize(
    ("parameters", "changes", "options"),
    [pytest.param(*case[1:], id=case[0]) for case in NUMBERS],
)
def test_press_moves_as_the_one_written_by_hand(
    press: Press, holds: Holds, parameters: dict[str, float], changes: tuple[Change, ...], options: dict[str, Any]
) -> None:
    """States of the press, against SciPy on the press written by hand, over their largest value."""
    against_scipy(holds, press("one-sided", *changes), parameters, **options)


#: Where a ball is flattened by more than a tenth: words, numbers, part of a turn.
VOID = (
    ("60 000 rpm", {SPEED: 60_000 * TURN / 60.0}, 0.15),
    ("punch 1 MN", {PUNCH: 1e6}, 0.05),
    ("crank over rod 0.9999, 500 rpm", {**STRETCHED, SPEED: 500 * TURN / 60.0}, 0.05),
    ("balls of 0.5 mm", of_size(0.5e-3), 0.15),
)


@pytest.mark.parametrize(("numbers", "turns"), [pytest.param(*case[1:], id=case[0]) for case in VOID])
def test_what_no_bearing_can_do_is_refused(press: Press, holds: Holds, numbers: dict[str, float], turns: float) -> None:
    """A ball flattened by more than a tenth, also by SciPy on the press written by hand; states until then."""
    model, numbers = press(), {START: BEFORE_PUNCH, **numbers}
    with pytest.raises(IntegrationError, match=r"a ball is flattened by .* Reduce load, speed or clearance") as caught:
        model.simulate(
            duration=turns * model.period(numbers), parameters=numbers, rtol=1e-8, samples_per_cycle=6000, transient=0
        )
    solution = caught.value.partial
    expected = by_scipy(model, solution, numbers)
    apart = np.hypot(expected[:, 0] - expected[:, 2], expected[:, 1] - expected[:, 3])
    values = {**model.parameters, **numbers}
    assert np.max(apart) - values[CLEARANCE] / 2.0 > 0.1 * values["bearing.ball_diameter"]
    holds(difference(solution.x, expected), 1e-4, f"{solution.statistics.steps} steps")


LAWS = ("none", "one-sided", "one-sided-gated", "two-sided-gated", "tangent")
#: Critical damping of the inner ring on its contacts is about 1.3e4 N s/m; the shipped ratio gives 683.
CRITICAL = 20.0
#: Words, numbers, part of a turn: across 1 mm each impact amplifies differences.
EXTREMES = (
    ("15 000 rpm", FAST, 0.15),
    ("punch 300 kN", {PUNCH: STRONG}, 0.05),
    ("clearance -30 um", {CLEARANCE: -30e-6}, 0.05),
    ("clearance 1 mm", {CLEARANCE: 1e-3}, 0.022),
)


@pytest.mark.parametrize("law", LAWS)
def test_every_damping_law_moves_as_written_by_hand(press: Press, holds: Holds, law: str) -> None:
    """Every damping law with the shipped coefficient, against SciPy on the press written by hand."""
    options: dict[str, Any] = {"turns": 0.1, "rtol": 1e-10, "tight": 1e-11} if law == "none" else {}
    against_scipy(holds, press(law), {}, bound=1e-3, **options)


@pytest.mark.parametrize("law", LAWS[1:])
def test_a_hundred_times_critical_damping(press: Press, holds: Holds, law: str) -> None:
    """Every damping law at a hundred times critical damping, against SciPy on the press written by hand."""
    model = press(law)
    numbers = {RATIO: 100.0 * CRITICAL * model.parameters[RATIO]}
    against_scipy(holds, model, numbers, **STIFF, bound=2e-3)


@pytest.mark.parametrize(("numbers", "turns"), [pytest.param(*case[1:], id=case[0]) for case in EXTREMES])
@pytest.mark.parametrize("law", [law for law in LAWS if law != "one-sided"])
def test_every_law_at_the_edges(press: Press, holds: Holds, law: str, numbers: dict[str, float], turns: float) -> None:
    """The other laws at the edges, against SciPy on the press written by hand."""
    against_scipy(holds, press(law), numbers, bound=1e-3, turns=turns)


def test_speed_zero_inside_the_window(press: Press, holds: Holds) -> None:
    """Speed 0 inside the punch window: the rings come to rest where SciPy's root balances the forces."""
    numbers = {SPEED: 0.0, START: math.radians(240.0), f"{OUTER}.damping": 5e3}
    model = press()
    solution = model.simulate(duration=0.5, parameters=numbers, rtol=1e-10, samples_per_cycle=100, transient=0)
    end = Machine.of(model, numbers).equilibrium(0.0, True, solution.x[-1, :4])
    holds(float(np.max(np.abs(solution.x[-1, :4] - end)) / np.max(np.abs(end))), 1e-8)


def test_rigid_housing_equals_a_fixed_ring(press: Press, holds: Holds) -> None:
    """A housing of 1e13 N/m moves as the scene with a fixed outer ring."""
    soft, fixed = (
        model.simulate(
            duration=0.018, parameters={START: BEFORE_PUNCH, **numbers}, rtol=1e-8, samples_per_cycle=1000, transient=0
        )
        for model, numbers in ((press(), {f"{OUTER}.stiffness": 1e13}), (press("one-sided", *FIXED_RING), {}))
    )
    # the housing still gives 4 kN / 1e13 N/m, a hundred-thousandth of the contacts' deflection
    holds(difference(soft.x[:, [0, 1, 4, 5]], fixed.x), 1e-4, f"{soft.statistics.steps} steps")


def test_a_slow_turn_follows_the_equilibrium(press: Press, holds: Holds) -> None:
    """At 1 rpm the rings stand in the equilibrium of each instant, by SciPy's root."""
    model, numbers = press(), {SPEED: TURN / 60.0}
    solution = model.simulate(cycles=1, parameters=numbers, rtol=1e-8, samples_per_cycle=72, transient=0)
    machine = Machine.of(model, numbers)
    assert machine.linkage is not None
    worst = 0.0
    for t, x in zip(solution.t[1:], solution.x[1:], strict=True):
        end = machine.equilibrium(t, machine.linkage.punching(machine.linkage.speed * t), x[:4])
        worst = max(worst, float(np.max(np.abs(x[:4] - end)) / np.max(np.abs(end))))
    # dampers turn with the cage: their drag moves the rings by c v / k
    holds(worst, 1e-3, f"{solution.statistics.steps} steps")


def test_a_step_load_on_a_ring_in_free_flight(rotor: Press, holds: Holds) -> None:
    """A load that steps onto a ring inside its clearance moves it by F t^2 / 2m."""
    table = 'type = "table"\ntime = ["0 s", "1 us"]\nx = ["0 N", "100 N"]\ny = ["0 N", "0 N"]'
    numbers = {
        "load.x.1": 0.0, "load.x.2": 100.0, "load.time.1": 0.01, "load.time.2": 0.01 + 1e-9, CLEARANCE: 1e-3,
        "bearing.initial.inner.x": 0.0, "bearing.initial.inner.y": 0.0, "bearing.inner_ring.damping": 0.0,
        "bearing.inner_ring.mass": 0.5,
    }  # fmt: skip
    solution = rotor((ROTOR_LOAD, table)).simulate(
        duration=0.012, parameters=numbers, rtol=1e-9, samples_per_cycle=5000, transient=0
    )
    expected = 0.5 * 100.0 / 0.5 * np.maximum(solution.t - 0.01, 0.0) ** 2
    holds(float(np.max(np.abs(solution["inner.x"] - expected)) / np.max(expected)), 1e-6)


def test_all_balls_out_of_contact(press: Press, holds: Holds) -> None:
    """Nothing touches and nothing pulls: the ring moves on a straight line."""
    numbers = {"bearing.share": 0.0, CLEARANCE: 1e-3, RATIO: 0.0, f"{OUTER}.damping": 0.0}
    start = np.array([1e-5, 0.0, 0.0, 0.0, 1e-3, 2e-3, 0.0, 0.0])
    solution = press().simulate(
        cycles=1, parameters=numbers, initial=start, rtol=1e-8, samples_per_cycle=100, transient=0
    )
    expected = start[:2] + np.outer(solution.t, start[4:6])
    holds(float(np.max(np.abs(solution.x[:, :2] - expected)) / np.max(expected)), 1e-10)
