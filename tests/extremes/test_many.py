"""Ensembles in lanes, sensitivities and outputs at the edges, against the press written down by hand."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import pairwise

import numpy as np
import pytest
from hand_written_press import Machine
from replacements import (
    BEFORE_PUNCH,
    CLEARANCE,
    CRANK,
    FAST,
    OUTER,
    PUNCH,
    RATIO,
    SPEED,
    START,
    STRETCHED,
    STRONG,
    TINY,
    TURN,
    WINDOW,
)  # fmt: skip

from ballpass.runtime import Model

pytestmark = pytest.mark.extreme

Holds = Callable[..., None]
Press = Callable[..., Model]

#: Members that stand side by side in lanes, an extreme each.
MEMBERS: tuple[dict[str, float], ...] = (
    {},
    FAST,
    {SPEED: -5000.0 * TURN / 60.0, START: math.radians(270.0)},
    {PUNCH: 0.0},
    {PUNCH: STRONG},
    {CLEARANCE: -30e-6},
    {CLEARANCE: 1e-3},
    {f"{OUTER}.mass": 1e4},
    {f"{OUTER}.stiffness": 0.0},
    {f"{OUTER}.stiffness": 1e10},
    {f"{OUTER}.damping": 0.0},
    {RATIO: 0.0},
    {RATIO: 7.9e-6},
    TINY,
    STRETCHED,
    {f"{WINDOW}.end": math.radians(237.0)},
    {"bearing.initial.inner.y": -205e-6},
)
#: Part of a turn that members run.
PART = 0.15
POSITIONS = ("inner.x", "inner.y", "outer.x", "outer.y")


def by_hand(model: Model, numbers: Mapping[str, float]) -> tuple[np.ndarray, float, float]:
    """By SciPy: positions at the end of a member's run, its highest elastic force of a ball, its mean of inner.y."""
    machine, start = Machine.of(model, numbers), model.initial(numbers)
    times = np.linspace(0.0, PART * abs(model.period(numbers)), 4001)
    rough = machine.integrate(times[::200], start, rtol=1e-4)  # sizes of the states, for the tolerance
    size = 1e-2 * np.max(np.abs(rough), axis=0) + 1e-12
    states = machine.integrate(times, start, rtol=1e-9, magnitude=size)
    forces = np.array([np.max(machine.balls(t, x)[0]) for t, x in zip(times, states, strict=True)])
    k, peak = int(np.argmax(forces)), float(np.max(forces))
    if 0 < k < len(forces) - 1:  # the parabola through three samples
        before, after = peak - forces[k - 1], peak - forces[k + 1]
        peak += (after - before) ** 2 / (8.0 * (after + before)) if after + before > 0.0 else 0.0
    y = states[:, 1]
    return states[-1, :4], peak, float(np.mean(0.5 * (y[1:] + y[:-1])))


@pytest.mark.parametrize(
    ("law", "method", "members", "bound"),
    [
        pytest.param("one-sided", "stepper", (0, 5, 15), 2e-4, id="3 members"),
        pytest.param("one-sided", "stepper", range(len(MEMBERS)), 2e-4, id="all extremes"),
        pytest.param("tangent", "stepper-dp54", (0, 1, 4, 5, 8), 1e-3, id="tangent, dp54"),
        pytest.param("two-sided-gated", "stepper-rodas5p", (0, 1, 4, 5, 8), 1e-3, id="gated, rodas5p"),
    ],
)
def test_extremes_side_by_side(
    press: Press, holds: Holds, law: str, method: str, members: tuple[int, ...], bound: float
) -> None:
    """Ends, highest forces and means of members that advance together in lanes, against SciPy for each."""
    model = press(law)
    rows = [{START: BEFORE_PUNCH, **MEMBERS[k]} for k in members]
    names = dict.fromkeys(name for row in rows for name in row)
    table = {name: [row.get(name, model.parameters[name]) for row in rows] for name in names}
    asked = [*(f"end:{name}" for name in POSITIONS), "max:ball.elastic_force", "mean:inner.y"]
    found = model.simulate_many(table, asked, cycles=PART, transient=0, rtol=1e-8, method=method, kinks="stepped-over")
    assert not found.failures
    assert found.statistics.lanes > 1
    worst = 0.0
    for row, numbers in enumerate(rows):
        end, peak, mean = by_hand(model, numbers)
        size = float(np.max(np.abs(end)))
        ends = np.array([found[f"end:{name}"][row] for name in POSITIONS])
        worst = max(worst, float(np.max(np.abs(ends - end))) / size, abs(found["mean:inner.y"][row] - mean) / size)
        if peak > 0.0:
            worst = max(worst, abs(found["max:ball.elastic_force"][row] / peak - 1.0))
    holds(worst, bound, f"{len(rows)} members")


def test_members_that_fail_leave_their_neighbours_alone(press: Press, holds: Holds) -> None:
    """Members that fail are NaN with a message; those beside them have the bits of a run alone."""
    model = press()
    force = [8964.8, 1e300, 0.0, 1e5, 1e300, 8964.8, 1e-3, 1e300, 5e3]
    asked = ["end:inner.y", "max:ball.force"]
    found = model.simulate_many({PUNCH: force}, asked, cycles=1, transient=0)
    failed = [k for k, value in enumerate(force) if value == 1e300]
    assert [item.member for item in found.failures] == failed
    assert all(item.message and 0.0 < item.time < model.period() for item in found.failures)
    assert all(math.isnan(found[name][k]) for name in asked for k in failed)
    worst = 0.0
    for k, value in enumerate(force):
        if k not in failed:
            alone = model.simulate_many({PUNCH: [value]}, asked, cycles=1, transient=0)
            worst = max(worst, *(abs(found[name][k] - alone[name][0]) for name in asked))
    holds(worst, 0.0, f"{len(failed)} of {len(force)} members fail")


def test_free_rings_of_1_mg_to_10_t(rotor: Press, holds: Holds) -> None:
    """Rings of 1 mg to 10 t side by side in free flight: the closed form."""
    masses = [1e-6, 1e-3, 0.032, 1.0, 20.0, 1e3, 1e4]
    same = {
        "bearing.inner_ring.damping": 0.0, CLEARANCE: 1.0, "bearing.initial.inner.x": 0.0,
        "bearing.initial.inner.y": 0.0, "bearing.initial.inner_velocity.y": 1e-3,
    }  # fmt: skip
    table = {name: [value] * len(masses) for name, value in same.items()}
    table |= {"bearing.inner_ring.mass": masses, "load.force.x": [1e-6 * mass for mass in masses]}
    asked = ["end:inner.x", "end:inner.y"]
    found = rotor().simulate_many(table, asked, duration=10.0, transient=0, rtol=1e-9, kinks="stepped-over")
    assert not found.failures
    x, y = found["end:inner.x"] / (0.5 * 1e-6 * 100.0), found["end:inner.y"] / (1e-3 * 10.0)
    holds(float(max(np.max(np.abs(x - 1.0)), np.max(np.abs(y - 1.0)))), 1e-9, f"{len(masses)} members")


#: Parameters by which runs are differentiated, and the steps of the differences.
BY = {CLEARANCE: 1e-9, CRANK: 1e-8, f"{WINDOW}.start": 1e-6}


@pytest.mark.parametrize(
    ("numbers", "method"),
    [
        pytest.param(FAST, "stepper-dop853", id="15 000 rpm"),
        pytest.param({CLEARANCE: -30e-6}, "stepper", id="clearance -30 um"),
        pytest.param(STRETCHED, "stepper-rodas4", id="crank over rod 0.9999"),
    ],
)
def test_derivatives_equal_differences(press: Press, holds: Holds, numbers: dict[str, float], method: str) -> None:
    """Derivatives of states by parameters, against differences of SciPy's runs of the press written by hand."""
    model = press()
    given = {START: BEFORE_PUNCH, **numbers}
    found = model.sensitivities(
        list(BY), cycles=PART, parameters=given, method=method, rtol=1e-8, sensitivity_rtol=1e-7, samples_per_cycle=200
    )
    start, t = model.initial(given), found.solution.t
    size = 1e-2 * np.max(np.abs(found.solution.x), axis=0) + 1e-12
    places = [len(t) // 2, -1]

    def moved(name: str, change: float) -> np.ndarray:
        value = {**model.parameters, **given}[name] + change
        machine = Machine.of(model, {**given, name: value})
        return machine.integrate(t[[0, *places]], start, rtol=1e-10, magnitude=size)[1:]

    worst = 0.0
    for k, (name, step) in enumerate(BY.items()):
        expected = (moved(name, step) - moved(name, -step)) / (2.0 * step)
        for half in (slice(0, 4), slice(4, 8)):
            scale = np.max(np.abs(expected[:, half])) or 1.0
            worst = max(worst, float(np.max(np.abs(found.x[places][:, half, k] - expected[:, half]))) / scale)
    holds(worst, 3e-3, f"{found.solution.statistics.steps} steps")


@pytest.mark.parametrize(
    ("numbers", "law"),
    [
        pytest.param(FAST, "one-sided", id="15 000 rpm"),
        pytest.param({CLEARANCE: 1e-3}, "two-sided-gated", id="clearance 1 mm"),
        pytest.param(STRETCHED, "tangent", id="crank over rod 0.9999"),
        pytest.param(TINY, "one-sided", id="crank 5 um, rod 83 um"),
        pytest.param({f"{OUTER}.damping": 0.0}, "none", id="no damping"),
    ],
)
def test_outputs_equal_the_hand_written_press(press: Press, holds: Holds, numbers: dict[str, float], law: str) -> None:
    """Forces of balls and hinge and the torque of the drive, against the press written by hand at the same states."""
    model = press(law)
    given = {START: BEFORE_PUNCH, **numbers}
    solution = model.simulate(cycles=1, parameters=given, samples_per_cycle=500, transient=0)
    machine = Machine.of(model, given)
    linkage = machine.linkage
    assert linkage is not None
    edges = [t for pair in pairwise(machine.edges(0.0, float(solution.t[-1]))) for t in pair]
    away = np.array([min(abs(t - edge) for edge in edges) for t in solution.t]) > 1e-9 * solution.t[-1]
    told: dict[str, list[object]] = {"ball.elastic_force": [], "ball.force": [], "drive_torque": [], "reaction.A.y": []}
    for t, x in zip(solution.t[away], solution.x[away], strict=True):
        elastic, total, _, _ = machine.balls(t, x)
        angle = linkage.start + linkage.speed * t
        hinge, torque = linkage.solve(angle, linkage.punching(angle))
        for values, value in zip(told.values(), (elastic, total, torque, hinge.imag), strict=True):
            values.append(value)
    worst = 0.0
    for name, values in told.items():
        expected = np.array(values)
        size = float(np.max(np.abs(expected))) or 1.0
        worst = max(worst, float(np.max(np.abs(solution[name][away] - expected))) / size)
    holds(worst, 1e-9, f"{int(np.sum(away))} samples")
