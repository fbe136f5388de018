"""Contenders that need no more than the project's own packages: its stepper, and CasADi's integrators."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ballpass.runtime.contract.method_registry import STEPPERS
from ballpass.runtime.native.stepper import End
from ballpass.runtime.request.locating import choose_kinks, stepper_for
from benchmarks.problem import POINTS, Cycle, Member

DECADES = tuple(10.0**-k for k in range(2, 11))
HALVES = tuple(10.0**-k for k in np.arange(1.5, 11.1, 0.5))

Solve = Callable[[Member, float], np.ndarray]


class UnavailableError(Exception):
    """A contender cannot run here; the message says why."""


@dataclass(frozen=True, kw_only=True)
class Contender:
    """Something that integrates the cycle.

    Attributes
    ----------
    label, group : its name in tables, and the name of its curve in the figure
    solve : function of member and tolerance; returns the states at the output points, shape (POINTS, 8)
    tolerances : all that are measured
    ready : raises `UnavailableError` where it cannot run
    """

    label: str
    group: str
    solve: Solve
    tolerances: tuple[float, ...] = DECADES
    ready: Callable[[], object] = lambda: None


class Kept:
    """What a contender prepares once per member."""

    def __init__(self, make: Callable[[Member], Any]) -> None:
        self._make = make
        self._made: dict[int, tuple[Member, Any]] = {}

    def __call__(self, member: Member) -> Any:
        if id(member) not in self._made:
            self._made[id(member)] = (member, self._make(member))
        return self._made[id(member)][1]


def stepped(cycle: Cycle, name: str, tolerance: float) -> np.ndarray:
    """States at the output points by one raw call of the stepper on prepared arrays; NaN after a failure."""
    stepper = stepper_for(cycle.model, choose_kinks(None, name, cycle.model.manifest, tolerance))
    states = np.empty((POINTS, len(cycle.start)))
    outcome = stepper.run(
        method=STEPPERS[name],
        tolerance=tolerance * cycle.magnitude,
        p=cycle.numbers.p,
        c=cycle.numbers.c,
        x=cycle.start.copy(),
        segments=cycle.segments,
        output_times=cycle.times,
        output_states=states,
    )
    if outcome.end is not End.DONE:
        states[outcome.written :] = np.nan
    return states


def _stepper(name: str) -> Contender:
    return Contender(
        label=name, group="ballpass", solve=lambda member, tol: stepped(member, name, tol), tolerances=HALVES
    )


def _simulated(method: str, outputs: list[str] | None) -> Solve:
    def solve(member: Member, tolerance: float) -> np.ndarray:
        solution = member.model.simulate(
            cycles=1, parameters=member.parameters, method=method, rtol=tolerance, samples_per_cycle=POINTS,
            initial=member.start, outputs=outputs, transient=0,
        )  # fmt: skip
        return np.asarray(solution.x[1:])

    return solve


def own_contenders() -> list[Contender]:
    """All of them, in the order of tables; first the plain `stepper`, to which ratios refer."""
    return [
        *(_stepper(name) for name in STEPPERS),
        Contender(label="model.simulate, outputs included", group="model.simulate", solve=_simulated("stepper", None),
                  tolerances=HALVES),
        Contender(label="CasADi cvodes, virtual machine", group="CasADi", solve=_simulated("cvodes", [])),
    ]  # fmt: skip
