"""Part 1: error and time of one cycle, for every contender and tolerance, over an ensemble.

First a look: each contender at each tolerance solves two members, or one where that is slow.  It tells which
tolerances the figures at the errors compared will rest on, and what a run costs.  Then visits, interleaved over all
contenders and tolerances: each takes the next member, its time counts and its error as well.  Quick runs, and those
that figures rest on, visit all members; slow ones that only draw a curve further, and those that would take minutes, as
many as their budget allows.  Where the visits show that a figure rests on a tolerance that visited few, that one visits
the others too, beside the stepper.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from ballpass.runtime.model import Model
from benchmarks import hand_rate
from benchmarks.curves import LEVELS, basis
from benchmarks.own import Contender, Unavailable, own_contenders
from benchmarks.peers import imported, jax_rate, numba_rate, numpy_rate, peers
from benchmarks.press import disagreement
from benchmarks.problem import (
    POINTS,
    REFERENCE_TOLERANCE,
    TRANSIENT,
    Case,
    Errors,
    Member,
    errors,
    parameter_sets,
    set_references,
)
from benchmarks.timing import REPEATS, SHORT, Entry, digits, interleave

#: Largest difference of the right-hand sides written by hand from the generated one [1].
RATE_AGREEMENT = 1e-12


#: Visits of plain `stepper` in a round: every ratio is to its time.
STEPPER_TURNS = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How much is measured.

    Attributes
    ----------
    members : size of the ensemble, and rounds of visits
    looked_at : members that the first look solves, where one takes no longer than `slow`
    slow : [s]
    budget : time that a tolerance may use for its visits [s]
    budget_of_figures : the same, where a figure at one of the errors compared rests on it; if all members would take
        longer, it has `budget_of_slow`
    longest : a tolerance whose run took longer is the last that a contender tries [s]
    tolerances : every so many of the tolerances of a contender
    """

    members: int = 32
    looked_at: int = 2
    slow: float = 0.2
    budget: float = 0.4
    budget_of_figures: float = 10.0
    budget_of_slow: float = 4.0
    longest: float = 3.0
    tolerances: int = 1


QUICK = Effort(
    members=2, looked_at=1, budget=0.02, budget_of_figures=0.02, budget_of_slow=0.02, longest=0.5, tolerances=3
)


@dataclass(slots=True, kw_only=True)
class Run:
    """A contender at a tolerance.

    Attributes
    ----------
    alone : time of a run as the first look found it [s]
    errors : by number of the member
    fault : why it cannot be used
    counts : what it counts, medians over the members
    entry : its visits
    """

    contender: Contender
    tolerance: float
    alone: float = math.nan
    errors: dict[int, Errors] = field(default_factory=dict)
    fault: str = ""
    counts: dict[str, float] = field(default_factory=dict)
    entry: Entry = field(default_factory=lambda: Entry(call=lambda _: None))

    def judge(self, members: Sequence[Member], number: int, states: np.ndarray) -> None:
        """Errors of a run of the member that visit `number` takes."""
        number %= len(members)
        if number not in self.errors:
            self.errors[number] = errors(members[number], states)
            if not math.isfinite(self.errors[number].worst):
                self.fault = "a run ended early or is not finite"

    @property
    def error(self) -> float:
        """Median of the errors so far [1]."""
        return float(np.median([one.worst for one in self.errors.values()]))

    def record(self) -> dict[str, Any]:
        """For JSON."""
        row: dict[str, Any] = {"tolerance": digits(self.tolerance)}
        fault = self.fault or self.entry.fault
        if fault:
            return {**row, "fault": fault}
        found = [self.errors[number] for number in sorted(self.errors)]
        row["errors"] = [digits(one.worst, 3) for one in found]
        row["times"] = [digits(t) for t in self.entry.times]
        row |= {name: digits(np.median([getattr(e, name) for e in found]), 3) for name in ("motion", "peak", "rms")}
        return {**row, "counts": self.counts} if self.counts else row


def contenders() -> list[Contender]:
    """Everything that takes part, installed or not."""
    return [*own_contenders(), *peers()]


def measure(case: Case, model: Model, effort: Effort, say: Callable[[str], None]) -> dict[str, Any]:
    """Results of a case, for JSON."""
    taking_part, absent = _ready()
    members = [Member(case, model, p) for p in parameter_sets(case, model, effort.members)]
    rates = check_rates(members[0])
    by_key = {c.key: c for c in taking_part}
    independent = by_key.get("scipy-dop853-numba")
    check = independent.label if independent else "stepper-dop853, kinks located"
    say(f"{case.key}: reference by {check} and stepper-rodas5p, kinks located")
    set_references(members, independent.solve if independent else None)

    runs: dict[str, list[Run]] = {}
    for contender in taking_part:
        say(f"{case.key}: {contender.label}")
        runs[contender.key] = _look(contender, members, effort)
    everything = [run for some in runs.values() for run in some if not run.fault]
    _visit(everything, _figures(runs), members, effort, say)
    for _ in range(3):  # medians over all members may move a figure to its neighbour
        late = [run for run in _figures(runs) if len(run.entry.times) < _share(run, True, effort)]
        if not late:
            break
        say(f"{case.key}: figures rest on {len(late)} more")
        _visit([*runs["stepper"], *late], late, members, effort, say)
    agreement = [m.agreement for m in members]
    return {
        "case": case.key,
        "words": case.words,
        "members": effort.members,
        "points": POINTS,
        "effort": asdict(effort),
        "transient_cycles": TRANSIENT,
        "reference": {
            "methods": [check, "stepper-rodas5p, kinks located"],
            "tolerance": REFERENCE_TOLERANCE,
            "median_agreement": digits(np.median(agreement), 2),
            "worst_agreement": digits(max(agreement), 2),
        },
        "rate_agreement": {name: digits(value, 2) for name, value in rates.items()},
        "contenders": [
            {
                "key": c.key,
                "label": c.label,
                "group": c.group,
                "tolerances": [digits(tol) for tol in c.tolerances[:: effort.tolerances]],
                "runs": [run.record() for run in runs[c.key]],
            }
            if c.key in runs
            else {"key": c.key, "label": c.label, "group": c.group, "absent": absent[c.key]}
            for c in contenders()
        ],
    }


def check_rates(member: Member) -> dict[str, float]:
    """Differences of the right-hand sides written by hand from the generated one.

    Raises
    ------
    ArithmeticError
        One of them is more than rounding: it is another model, and its times would mean nothing.
    """
    rates = {"NumPy": numpy_rate(member.press.tangent == 1.0), "C": hand_rate.make(member)}
    with contextlib.suppress(Unavailable):
        rates["numba"] = hand_rate.returning(numba_rate())
    with contextlib.suppress(Unavailable):
        rates["JAX"] = imported("jax").jit(jax_rate(member.press.tangent == 1.0))
    found = {
        name: disagreement(member.model, member.parameters, rate, member.magnitude) for name, rate in rates.items()
    }
    for name, value in found.items():
        if not value <= RATE_AGREEMENT:
            raise ArithmeticError(
                f"The right-hand side in {name} differs from the generated one by {value:.1e}; {RATE_AGREEMENT:g} is "
                "allowed. One of them is wrong: see benchmarks/press.py and benchmarks/hand_written.c."
            )
    return found


def _ready() -> tuple[list[Contender], dict[str, str]]:
    there, absent = [], {}
    for contender in contenders():
        try:
            contender.ready()
            there.append(contender)
        except Unavailable as reason:
            absent[contender.key] = str(reason)
    return there, absent


def _look(contender: Contender, members: Sequence[Member], effort: Effort) -> list[Run]:
    """A first look at each tolerance, behind a call that does not count, for it may compile."""
    found: list[Run] = []
    for tolerance in contender.tolerances[:: effort.tolerances]:
        run = Run(contender=contender, tolerance=tolerance)
        found.append(run)
        try:
            if len(found) == 1:
                contender.solve(members[0], tolerance)
            for number in range(effort.looked_at):
                begun = time.perf_counter()
                run.judge(members, number, contender.solve(members[number], tolerance))
                run.alone = time.perf_counter() - begun
                if run.alone > effort.slow:
                    break
            if contender.counts is not None:
                counts = [contender.counts(member, tolerance) for member in members]
                run.counts = {name: digits(np.median([c[name] for c in counts])) for name in counts[0]}
        except (RuntimeError, ArithmeticError, ValueError) as fault:
            run.fault = f"{type(fault).__name__}: {str(fault).splitlines()[0][:200]}"
            continue
        run.entry = Entry(
            call=_call(contender, members, tolerance),
            look=lambda number, states, run=run: run.judge(members, number, states),  # type: ignore[misc]
            turns=STEPPER_TURNS if contender.key == "stepper" else 1,
        )
        if len(found) > 1 and run.alone > effort.longest:
            break  # tighter ones take longer still
    return found


def _figures(runs: dict[str, list[Run]]) -> list[Run]:
    """Runs that the times at the errors compared rest on, as far as is known."""
    found = []
    for some in runs.values():
        usable = [run for run in some if not run.fault and not run.entry.fault]
        points = [(run.error, float(np.median(run.entry.times)) if run.entry.times else run.alone) for run in usable]
        used = {k for level in LEVELS for k, _ in basis(points, level)}
        found += [usable[k] for k in sorted(used)]
    return found


def _share(run: Run, of_a_figure: bool, effort: Effort) -> int:
    """Visits that a run gets."""
    visit = run.alone if run.alone > SHORT else (1 + REPEATS) * run.alone
    if visit * effort.members <= (effort.budget_of_figures if of_a_figure else effort.budget):
        return effort.members
    if of_a_figure:
        return max(2, int(effort.budget_of_slow / visit))
    return max(1, int(effort.budget / visit))


def _visit(
    runs: Sequence[Run], figures: Sequence[Run], members: Sequence[Member], effort: Effort, say: Callable[[str], None]
) -> None:
    """Rounds over all runs, until each has its visits."""
    say(f"{members[0].case.key}: {len(runs)} contenders and tolerances, in turn")
    of_figures = {id(run) for run in figures}
    left = {id(run): _share(run, id(run) in of_figures, effort) for run in runs}
    done = {id(run): len(run.entry.times) if run.entry.turns == 1 else 0 for run in runs}
    for number in range(max(left[id(run)] - done[id(run)] for run in runs)):
        interleave([run.entry for run in runs if done[id(run)] + number < left[id(run)]], rounds=1, first=number)


def _call(contender: Contender, members: Sequence[Member], tolerance: float) -> Callable[[int], object]:
    return lambda number: contender.solve(members[number % len(members)], tolerance)
