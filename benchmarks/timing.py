"""How time is taken: in rounds, A B C A B C ..., so that whatever else the machine does meets all alike.

In: named calls.  Out: for each the times of its visits.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

#: Calls shorter than this are repeated within a visit, after one that does not count: warm, as in a loop [s].
SHORT = 5e-3

#: Calls of a visit.
REPEATS = 3


@dataclass(slots=True, kw_only=True)
class Entry:
    """One thing to time.

    Attributes
    ----------
    call : takes the number of the visit
    look : takes the number of the visit and what the call gave, outside the time taken
    turns : visits in each round; what all others are divided by deserves more than one
    times : median of the calls of each visit [s]
    fault : what went wrong, if anything did; it is then left out of the further rounds
    """

    call: Callable[[int], Any]
    look: Callable[[int, Any], None] | None = None
    turns: int = 1
    times: list[float] = field(default_factory=list)
    fault: str = ""


def interleave(entries: Sequence[Entry], *, rounds: int, first: int = 0) -> None:
    """Visit all entries in turn, `rounds` times; `first` is the number of the first round."""
    for number in range(first, first + rounds):
        for entry in _order(entries, number):
            if not entry.fault:
                try:
                    _visit(entry)
                except (RuntimeError, ArithmeticError, ValueError) as fault:
                    entry.fault = f"{type(fault).__name__}: {fault}"


def _order(entries: Sequence[Entry], number: int) -> list[Entry]:
    """One round: each round begins one further on, and who has several turns has them evenly among the others."""
    once_each = [entry for entry in entries if entry.turns == 1]
    several = [entry for entry in entries if entry.turns > 1]
    shift = number % max(len(once_each), 1)
    order = [*once_each[shift:], *once_each[:shift]]
    for entry in several:
        gap = len(order) / entry.turns
        for turn in reversed(range(entry.turns)):
            order.insert(round(turn * gap), entry)
    return order


def _visit(entry: Entry) -> None:
    number = len(entry.times)
    taken, given = _timed(entry.call, number)
    if taken <= SHORT:
        taken = float(np.median([once(entry.call, number) for _ in range(REPEATS)]))
    entry.times.append(taken)
    if entry.look is not None:
        entry.look(number, given)


def once(call: Callable[[int], object], number: int) -> float:
    """Time of one call [s]: what passes, less the time in which the system ran other programs instead.

    On a quiet machine that is what passes.  On a shared one, calls longer than a slice of the scheduler would appear
    many times slower than they are, and shorter ones not.
    """
    return _timed(call, number)[0]


def _timed(call: Callable[[int], Any], number: int) -> tuple[float, Any]:
    processor, begun = time.process_time(), time.perf_counter()
    given = call(number)
    passed = time.perf_counter() - begun
    return min(passed, time.process_time() - processor), given


def spread(values: Sequence[float] | np.ndarray) -> dict[str, float]:
    """Median and 10th and 90th percentile, to four digits."""
    low, middle, high = np.percentile(np.asarray(values, dtype=float), [10, 50, 90])
    return {"median": digits(middle), "p10": digits(low), "p90": digits(high)}


def digits(value: float, count: int = 4) -> float:
    """A number rounded to significant digits: results stay small and readable."""
    return float(f"{float(value):.{count}g}")
