"""Part 1: error and time of one cycle, for every contender and tolerance, over an ensemble.

Errors first: each contender at each tolerance solves as many members as its budget allows.  Then times, interleaved
over all contenders and tolerances; a round takes the next member.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks import hand_rate
from benchmarks.own import Contender, Unavailable, own_contenders
from benchmarks.peers import imported, jax_rate, numba_rate, numpy_rate, peers
from benchmarks.press import disagreement
from benchmarks.problem import CASES, POINTS, TRANSIENT, Case, Member, errors, models, parameter_sets, set_references
from benchmarks.timing import Entry, digits, interleave, spread
from raceway.runtime.model import Model

#: Largest difference of the right-hand sides written by hand from the generated one [1].
RATE_AGREEMENT = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How much is measured.

    Attributes
    ----------
    members : size of the ensemble
    rounds : visits of each contender and tolerance
    error_budget, time_budget : time a contender may use at one tolerance, for errors and for times [s]
    longest : a tolerance at which the errors took longer is the last that a contender tries [s]
    tolerances : every so many of the tolerances of a contender
    """

    members: int = 32
    rounds: int = 32
    error_budget: float = 0.4
    time_budget: float = 0.3
    longest: float = 3.0
    tolerances: int = 1


QUICK = Effort(members=2, rounds=2, error_budget=0.05, time_budget=0.02, tolerances=3)


def contenders() -> list[Contender]:
    """Everything that takes part, installed or not."""
    return [*own_contenders(), *peers()]


def measure(case: Case, model: Model, effort: Effort, say: Callable[[str], None]) -> dict[str, Any]:
    """Results of a case, for JSON."""
    taking_part, absent = _ready()
    members = [Member(case, model, p) for p in parameter_sets(case, model, effort.members)]
    rates = check_rates(members[0])
    by_key = {c.key: c for c in taking_part}
    independent = by_key.get("scipy-dop853-numba", by_key["stepper-dop853"])
    say(f"{case.key}: reference by {independent.label} and stepper-rodas5p")
    set_references(members, independent.solve, by_key["stepper-rodas5p"].solve)

    found: dict[str, list[dict[str, Any]]] = {}
    timed: list[tuple[str, int, Entry]] = []
    for contender in taking_part:
        tolerances = contender.tolerances[:: effort.tolerances]
        say(f"{case.key}: {contender.label}")
        found[contender.key] = []
        for tol in tolerances:
            begun = time.perf_counter()
            found[contender.key].append(_errors(contender, members, tol, effort))
            if len(found[contender.key]) > 1 and time.perf_counter() - begun > effort.longest:
                break  # tighter ones take longer still
        for k, tol in enumerate(tolerances[: len(found[contender.key])]):
            if not found[contender.key][k].get("fault"):
                timed.append((contender.key, k, Entry(call=_call(contender, members, tol))))
    say(f"{case.key}: times of {len(timed)} contenders and tolerances, in turn")
    interleave([entry for *_, entry in timed], rounds=effort.rounds, budget=effort.time_budget)
    for key, k, entry in timed:
        row = found[key][k]
        if entry.fault:
            row["fault"] = entry.fault
        if entry.times:
            row["time"] = {**spread(entry.times), "visits": len(entry.times)}
    for contender in taking_part:
        if contender.errors_like in found:
            _borrow(found[contender.key], found[contender.errors_like])
    return {
        "case": case.key,
        "words": case.words,
        "members": effort.members,
        "points": POINTS,
        "transient_cycles": TRANSIENT,
        "reference": {
            "methods": [independent.label, "stepper-rodas5p"],
            "worst_agreement": digits(max(m.agreement for m in members), 2),
        },
        "rate_agreement": {name: digits(value, 2) for name, value in rates.items()},
        "contenders": [
            {"key": c.key, "label": c.label, "group": c.group, "errors_like": c.errors_like, "runs": found[c.key]}
            if c.key in found
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


def _errors(contender: Contender, members: Sequence[Member], tolerance: float, effort: Effort) -> dict[str, Any]:
    """Errors at one tolerance; the first call, which may compile, is not timed."""
    row: dict[str, Any] = {"tolerance": digits(tolerance)}
    own = not contender.errors_like
    found = []
    try:
        begun = time.perf_counter()
        found.append(errors(members[0], contender.solve(members[0], tolerance)))
        for member in members[1:] if own else ():
            found.append(errors(member, contender.solve(member, tolerance)))
            if time.perf_counter() - begun > effort.error_budget and len(found) >= 3:
                break
    except (RuntimeError, ArithmeticError, ValueError) as fault:
        return {**row, "fault": f"{type(fault).__name__}: {str(fault).splitlines()[0][:200]}"}
    if any(not math.isfinite(e.worst) for e in found):
        return {**row, "fault": "a run ended early or is not finite"}
    row["error"] = {
        "members": len(found),
        "worst": spread([e.worst for e in found]),
        **{name: digits(np.median([getattr(e, name) for e in found]), 3) for name in ("motion", "peak", "rms")},
    }
    if contender.counts is not None:
        counts = [contender.counts(member, tolerance) for member in members]
        row["counts"] = {name: digits(np.median([c[name] for c in counts])) for name in counts[0]}
    return row


def _call(contender: Contender, members: Sequence[Member], tolerance: float) -> Callable[[int], object]:
    return lambda number: contender.solve(members[number % len(members)], tolerance)


def _borrow(rows: list[dict[str, Any]], twins: list[dict[str, Any]]) -> None:
    """Put the errors of the faster twin in place of those of one member, which stay as a check."""
    by_tolerance = {row["tolerance"]: row for row in twins}
    for row in rows:
        twin = by_tolerance.get(row["tolerance"])
        if twin is not None and "error" in twin and "error" in row:
            row["first_member"] = row["error"]["worst"]["median"]
            row["error"] = twin["error"]


def cases() -> list[tuple[Case, Model]]:
    """Cases with their models."""
    by_scene = models()
    return [(case, by_scene[case.scene]) for case in CASES]
