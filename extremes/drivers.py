"""Cases of the other drivers: ensembles in lanes, sensitivities, the quasi-static model, outputs at many points.

Each at the same edges as single runs, against the press written down by hand: its states, forces and equilibria, and
differences of its motion.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache, partial
from itertools import pairwise
from typing import Any

import numpy as np

from ballpass.runtime import IntegrationError
from ballpass.runtime.contract.errors import RequestError
from extremes.case import Case, Finding
from extremes.methods import refused
from extremes.models import press, rotor
from extremes.physics import BEFORE_PUNCH, CRANK, OUTER, PUNCH, RATIO, ROD, ROD_CENTER, SPEED, START, WINDOW, difference
from extremes.reference import TURN, Machine

GROUP = "Other drivers"

#: Members that stand side by side in lanes, an extreme each.
MEMBERS: tuple[dict[str, float], ...] = (
    {},
    {SPEED: 60_000 * TURN / 60.0},
    {SPEED: -5000.0 * TURN / 60.0, START: math.radians(270.0)},
    {PUNCH: 0.0},
    {PUNCH: 1e6},
    {"bearing.clearance": -30e-6},
    {"bearing.clearance": 1e-3},
    {f"{OUTER}.mass": 1e4},
    {f"{OUTER}.stiffness": 0.0},
    {f"{OUTER}.stiffness": 1e10},
    {f"{OUTER}.damping": 0.0},
    {RATIO: 0.0},
    {RATIO: 7.9e-6},
    {CRANK: 5e-6, ROD: 5e-6 / 0.06, ROD_CENTER: 5e-6 / 0.12},
    {CRANK: 0.09999, START: math.radians(350.0)},
    {f"{WINDOW}.end": math.radians(237.0)},
    {"bearing.initial.inner.y": -205e-6},
)
#: Part of a turn that members run.
PART = 0.15
POSITIONS = ("inner.x", "inner.y", "outer.x", "outer.y")


def _numbers(member: Mapping[str, float]) -> dict[str, float]:
    return {START: BEFORE_PUNCH, **member}


@cache
def _by_hand(law: str, place: int) -> tuple[np.ndarray, float, float]:
    """By SciPy: positions at the end of a member's run, its highest elastic force of a ball, its mean of inner.y."""
    model, numbers = press(law), _numbers(MEMBERS[place])
    duration = PART * abs(model.period(numbers))
    machine, start = Machine.of(model, numbers), model.initial(numbers)
    times = np.linspace(0.0, duration, 4001)
    # sizes of the states, for the tolerance
    rough = machine.integrate(times[::200], start, rtol=1e-4)
    size = 1e-2 * np.max(np.abs(rough), axis=0) + 1e-12
    states = machine.integrate(times, start, rtol=1e-9, magnitude=size)
    forces = np.array([np.max(machine.balls(t, x)[0]) for t, x in zip(times, states, strict=True)])
    peak = float(np.max(forces))
    k = int(np.argmax(forces))
    if 0 < k < len(forces) - 1:  # the parabola through three samples
        before, after = peak - forces[k - 1], peak - forces[k + 1]
        peak += (after - before) ** 2 / (8.0 * (after + before)) if after + before > 0.0 else 0.0
    y = states[:, 1]
    mean = float(np.mean(0.5 * (y[1:] + y[:-1])))
    return states[-1, :4], peak, mean


def lanes(law: str, method: str, members: tuple[int, ...], bound: float) -> Finding:
    """Ends, highest forces and means of members that advance together, against SciPy for each."""
    model = press(law)
    rows = [_numbers(MEMBERS[k]) for k in members]
    table = {
        name: [row.get(name, model.parameters[name]) for row in rows]
        for name in dict.fromkeys(name for row in rows for name in row)
    }
    asked = [*(f"end:{name}" for name in POSITIONS), "max:ball.elastic_force", "mean:inner.y"]
    found = model.simulate_many(table, asked, cycles=PART, transient=0, rtol=1e-8, method=method, kinks="stepped-over")
    assert not found.failures, found.failures
    assert found.statistics.lanes > 1, found.statistics
    worst = 0.0
    for row, place in enumerate(members):
        end, peak, mean = _by_hand(law, place)
        size = float(np.max(np.abs(end)))
        ends = np.array([found[f"end:{name}"][row] for name in POSITIONS])
        worst = max(worst, float(np.max(np.abs(ends - end))) / size)
        worst = max(worst, abs(found["mean:inner.y"][row] - mean) / size)
        if peak > 0.0:
            worst = max(worst, abs(found["max:ball.elastic_force"][row] / peak - 1.0))
    return Finding(status="done", error=worst, bound=bound, note=f"{len(rows)} members")


def failing_neighbours() -> Finding:
    """Members that fail beside members that do not: NaN and a message here, the bits of a run alone there."""
    model = press()
    force = [8964.8, 1e300, 0.0, 1e6, 1e300, 8964.8, 1e-3, 1e300, 5e3]
    asked = ["end:inner.y", "max:ball.force"]
    found = model.simulate_many({PUNCH: force}, asked, cycles=1, transient=0)
    failed = [k for k, value in enumerate(force) if value == 1e300]
    assert [item.member for item in found.failures] == failed, found.failures
    for item in found.failures:
        assert item.status in ("NOT_FINITE", "STEP_TOO_SMALL"), item
        assert item.message, item
        assert 0.0 < item.time < model.period(), item
    worst = 0.0
    for k, value in enumerate(force):
        if k in failed:
            assert all(math.isnan(found[name][k]) for name in asked)
            continue
        alone = model.simulate_many({PUNCH: [value]}, asked, cycles=1, transient=0)
        worst = max(worst, *(abs(found[name][k] - alone[name][0]) for name in asked))
    return Finding(status="done", error=worst, bound=0.0, note=f"{len(failed)} of {len(force)} members fail")


#: Parameters by which runs are differentiated, and the steps of the differences.
BY = {"bearing.clearance": 1e-9, CRANK: 1e-8, f"{WINDOW}.start": 1e-6}


def derivatives(numbers: Mapping[str, float], method: str, law: str, by: str, bound: float) -> Finding:
    """Derivatives of states along parameters, against differences of SciPy's runs of the hand-written press."""
    model = press(law)
    given = _numbers(numbers)
    found = model.sensitivities(
        list(BY), cycles=PART, parameters=given, method=method, rtol=1e-8, sensitivity_rtol=1e-7, samples_per_cycle=200
    )
    start = model.initial(given)
    size = 1e-2 * np.max(np.abs(found.solution.x), axis=0) + 1e-12
    times = found.solution.t[[0, len(found.solution.t) // 2, -1]]

    def moved(name: str, change: float) -> np.ndarray:
        p = {**model.parameters, **given}
        machine = Machine.of(model, {**given, name: p[name] + change})
        return machine.integrate(times, start, method=by, rtol=1e-10, magnitude=size)[1:]

    worst = 0.0
    picked = found.x[[len(found.solution.t) // 2, -1]]
    for k, (name, plain) in enumerate(BY.items()):
        # a parameter far from the shipped one moves in proportion
        step = plain * max(1.0, abs(given.get(name, 0.0) / (model.parameters[name] or 1.0)))
        expected = (moved(name, step) - moved(name, -step)) / (2.0 * step)
        for half in (slice(0, 4), slice(4, 8)):
            scale = np.max(np.abs(expected[:, half])) or 1.0
            worst = max(worst, float(np.max(np.abs(picked[:, half, k] - expected[:, half]))) / scale)
    return Finding(status="done", error=worst, bound=bound, note=f"{found.solution.statistics.steps} steps")


def equilibria(numbers: Mapping[str, float]) -> Finding:
    """The quasi-static model over a turn, against SciPy's root of the balance of forces at each sample."""
    model = press()
    solution = model.simulate(
        cycles=1, parameters=numbers, method="quasi-static", samples_per_cycle=360, rtol=1e-8, transient=0
    )
    machine = Machine.of(model, numbers)
    linkage = machine.linkage
    assert linkage is not None
    worst = 0.0
    size = float(np.max(np.abs(solution.x[:, :4])))
    edges = machine.edges(0.0, float(solution.t[-1]))
    for t, x in zip(solution.t[1::7], solution.x[1::7], strict=True):
        if min(abs(t - edge) for edge in edges) < 1e-9 * edges[-1]:
            continue  # rounding decides whether the punch is on
        end = machine.equilibrium(t, linkage.punching(linkage.start + linkage.speed * t), x[:4])
        worst = max(worst, float(np.max(np.abs(x[:4] - end))) / size)
    return Finding(status="done", error=worst, bound=1e-6, note=f"{solution.statistics.steps} steps")


def no_equilibrium(numbers: Mapping[str, float]) -> object:
    return press().simulate(cycles=1, parameters=numbers, method="quasi-static", transient=0)


def jumping() -> object:
    return press("two-sided-gated").sensitivities(["bearing.clearance"], cycles=0.1)


def outputs(numbers: Mapping[str, float], law: str = "one-sided") -> Finding:
    """Forces of balls and hinge and the drive's torque at all samples, from the same states, by hand."""
    model = press(law)
    given = _numbers(numbers)
    solution = model.simulate(cycles=1, parameters=given, samples_per_cycle=500, transient=0)
    machine = Machine.of(model, given)
    linkage = machine.linkage
    assert linkage is not None
    told: dict[str, list[Any]] = {"ball.elastic_force": [], "ball.force": [], "drive_torque": [], "reaction.A.y": []}
    edges = machine.edges(0.0, float(solution.t[-1]))
    inner = [t for a, b in pairwise(edges) for t in (a, b)]
    away = np.array([min(abs(t - edge) for edge in inner) for t in solution.t]) > 1e-9 * solution.t[-1]
    for t, x in zip(solution.t[away], solution.x[away], strict=True):
        elastic, total, _, _ = machine.balls(t, x)
        angle = linkage.start + linkage.speed * t
        hinge, torque = linkage.solve(angle, linkage.punching(angle))
        for name, value in zip(told, (elastic, total, torque, hinge.imag), strict=True):
            told[name].append(value)
    worst = 0.0
    for name, values in told.items():
        expected = np.array(values)
        size = float(np.max(np.abs(expected))) or 1.0
        worst = max(worst, float(np.max(np.abs(solution[name][away] - expected))) / size)
    return Finding(status="done", error=worst, bound=1e-9, note=f"{int(np.sum(away))} samples")


def on_kinks(law: str) -> Finding:
    """Steps that end where balls find and lose contact, against SciPy."""
    model, numbers = press(law), _numbers({})
    duration = 0.1 * model.period(numbers)
    solution = model.simulate(
        duration=duration, parameters=numbers, kinks="located", rtol=1e-8, samples_per_cycle=2000, transient=0
    )
    size = 1e-2 * np.max(np.abs(solution.x), axis=0) + 1e-12
    expected = Machine.of(model, numbers).integrate(solution.t, solution.x[0], rtol=1e-9, magnitude=size)
    note = f"{solution.statistics.steps} steps"
    return Finding(status="done", error=difference(solution.x, expected), bound=1e-3, note=note)


def free_lanes() -> Finding:
    """Rotors that fly freely, too far from any ball to touch one: straight lines, over masses from 1 mg to 10 t."""
    model = rotor()
    masses = [1e-6, 1e-3, 0.032, 1.0, 20.0, 1e3, 1e4]
    table = {
        "bearing.inner_ring.mass": masses, "bearing.inner_ring.damping": [0.0] * len(masses),
        "bearing.clearance": [1.0] * len(masses), "load.force.x": [1e-6 * mass for mass in masses],
        "bearing.initial.inner.x": [0.0] * len(masses), "bearing.initial.inner.y": [0.0] * len(masses),
        "bearing.initial.inner_velocity.y": [1e-3] * len(masses),
    }  # fmt: skip
    asked = ["end:inner.x", "end:inner.y"]
    found = model.simulate_many(table, asked, duration=10.0, transient=0, rtol=1e-9, kinks="stepped-over")
    assert not found.failures, found.failures
    worst = max(
        float(np.max(np.abs(found["end:inner.x"] / (0.5 * 1e-6 * 100.0) - 1.0))),
        float(np.max(np.abs(found["end:inner.y"] / (1e-3 * 10.0) - 1.0))),
    )
    return Finding(status="done", error=worst, bound=1e-9, note=f"{len(masses)} members")


def cases() -> list[Case]:
    """All of this section."""
    scipy = "SciPy on the hand-written press"
    words = "words of the refusal"
    every = tuple(range(len(MEMBERS)))
    few = (0, 1, 2, 4, 5, 6, 8, 13, 15)
    fast, wide = {SPEED: 60_000 * TURN / 60.0}, {CRANK: 0.09999, START: math.radians(350.0)}
    press_on = {"bearing.clearance": -30e-6}
    slopes: list[tuple[str, dict[str, float], str, str, str, float, bool]] = [
        ("derivatives at 60 000 rpm", fast, "stepper-dop853", "one-sided", "DOP853", 3e-3, True),
        ("derivatives with -30 um of clearance", press_on, "stepper", "one-sided", "DOP853", 3e-3, False),
        ("derivatives with crank over rod 0.9999", wide, "stepper-rodas4", "one-sided", "DOP853", 3e-3, False),
    ]  # fmt: skip
    quiet = {f"{OUTER}.damping": 0.0}
    table: list[tuple[str, str, str, Any, bool]] = [
        ("extremes side by side in lanes", "ensemble", scipy, partial(lanes, "one-sided", "stepper", few, 2e-4), True),
        ("all extremes side by side in lanes", "ensemble", scipy,
         partial(lanes, "one-sided", "stepper", every, 2e-4), False),
        ("extremes side by side, law tangent", "ensemble, dp54", scipy,
         partial(lanes, "tangent", "stepper-dp54", (0, 1, 4, 5, 8), 1e-3), False),
        ("extremes side by side, law two-sided-gated", "ensemble, rodas5p", scipy,
         partial(lanes, "two-sided-gated", "stepper-rodas5p", (0, 1, 4, 5, 8), 1e-3), False),
        ("members that fail among members that do not", "ensemble", "each alone, bits", failing_neighbours, True),
        ("rings of 1 mg to 10 t in free flight", "ensemble", "closed form", free_lanes, True),
        *(
            (name, method, "differences of " + scipy, partial(derivatives, numbers, method, law, by, bound), quick)
            for name, numbers, method, law, by, bound, quick in slopes
        ),
        ("derivatives through a force that jumps", "request", words,
         partial(refused, jumping, RequestError, "discontinuous.*Take the law", place=False), True),
        *(
            (f"equilibria, {where}", "quasi-static", "SciPy's root of the balance of forces",
             partial(equilibria, numbers), quick)
            for where, numbers, quick in (
                ("1 rpm", {SPEED: TURN / 60.0}, True),
                ("60 000 rpm", fast, False),
                ("punch 1 MN", {PUNCH: 1e6}, True),
                ("clearance -30 um", press_on, False),
                ("housing stiffness 1e10 N/m", {f"{OUTER}.stiffness": 1e10}, False),
                ("housing stiffness 1e5 N/m", {f"{OUTER}.stiffness": 1e5}, False),
            )
        ),
        *(
            (name, "quasi-static", words,
             partial(refused, partial(no_equilibrium, numbers), IntegrationError, f"{cause}.*method stepper",
                     place=False), True)
            for name, numbers, cause in (
                ("equilibria without load", {"bearing.share": 0.0, "bearing.clearance": 1e-3}, "nothing holds a ring"),
                ("equilibria without housing", {f"{OUTER}.stiffness": 0.0}, "quasi-static model"),
            )
        ),
        *(
            (f"steps that end on kinks, law {law}", "stepper, located", scipy, partial(on_kinks, law), False)
            for law in ("one-sided", "tangent", "two-sided-gated")
        ),
        *(
            (f"outputs, {where}", "outputs", "the hand-written press at the same states",
             partial(outputs, numbers, law), quick)
            for where, numbers, law, quick in (
                ("60 000 rpm", fast, "one-sided", True),
                ("crank over rod 0.9999", wide, "tangent", False),
                ("crank 5 um, rod 83 um", MEMBERS[13], "one-sided", False),
                ("clearance 1 mm", {"bearing.clearance": 1e-3}, "two-sided-gated", True),
                ("no damping", quiet, "none", False),
            )
        ),
    ]  # fmt: skip
    return [
        Case(group=GROUP, name=name, method=method, against=against, run=run, quick=quick)
        for name, method, against, run, quick in table
    ]
