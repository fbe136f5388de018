"""A case of the tour, and what running it gave."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from ballpass.runtime.contract.errors import BallpassError


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """What a case gave.

    Attributes
    ----------
    status : "done", or how the request was refused
    error : against the reference or invariant, in the case's own measure [1]; None for a refusal
    bound : what `error` may be [1]
    note : a few words more, such as steps
    """

    status: str
    error: float | None = None
    bound: float | None = None
    note: str = ""

    @property
    def holds(self) -> bool:
        """Whether the error is within its bound; a refusal always, for its case has checked the words."""
        if self.error is None or self.bound is None:
            return True
        return self.error <= self.bound  # not a number is no pass


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A place at the edge.

    Attributes
    ----------
    group : section of the page
    name : what is extreme
    method : the integrator, or what else does the work
    against : the independent reference or invariant, and the measure of the error
    run : does it
    quick : part of the test suite
    long : millions of steps: left out under sanitizers, where shorter ones take the same code
    """

    group: str
    name: str
    method: str
    against: str
    run: Callable[[], Finding]
    quick: bool = False
    long: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A case that was run: its finding, or what went wrong, and the time it took [s]."""

    case: Case
    finding: Finding | None
    fault: str
    seconds: float

    @property
    def holds(self) -> bool:
        return self.finding is not None and self.finding.holds


def run_case(case: Case) -> Row:
    """Run a case; whatever it raises is the row's fault."""
    started = time.perf_counter()
    finding, fault = None, ""
    try:
        finding = case.run()
    except (BallpassError, ArithmeticError, AssertionError, LookupError, TypeError, ValueError, RuntimeError):
        fault = traceback.format_exc()
    return Row(case=case, finding=finding, fault=fault, seconds=time.perf_counter() - started)


def select(cases: Iterable[Case], words: Iterable[str]) -> list[Case]:
    """Cases whose group, name or method holds one of the words; all without words."""
    wanted = [word.lower() for word in words]
    return [
        case
        for case in cases
        if not wanted or any(word in f"{case.group} {case.name} {case.method}".lower() for word in wanted)
    ]
