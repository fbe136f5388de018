"""How time is taken: in rounds, A B C A B C ..., so that whatever else the machine does meets all alike.

In: named calls.  Out: for each the times of its visits.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

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
    call : takes the number of the round
    times : median of the calls of each visit [s]
    spent : time of all its visits [s]
    fault : what went wrong, if anything did; it is then left out of the further rounds
    """

    call: Callable[[int], object]
    times: list[float] = field(default_factory=list)
    spent: float = 0.0
    fault: str = ""


def interleave(entries: Sequence[Entry], *, rounds: int, budget: float, least: int = 2) -> None:
    """Visit all entries in turn, `rounds` times; one that has used up its budget [s] sits out after `least` visits."""
    for number in range(rounds):
        shift = number % max(len(entries), 1)
        for entry in (*entries[shift:], *entries[:shift]):
            if entry.fault or (entry.spent > budget and len(entry.times) >= least):
                continue
            begun = time.perf_counter()
            try:
                entry.times.append(_visit(entry.call, number))
            except (RuntimeError, ArithmeticError, ValueError) as fault:
                entry.fault = f"{type(fault).__name__}: {fault}"
            entry.spent += time.perf_counter() - begun


def _visit(call: Callable[[int], object], number: int) -> float:
    first = once(call, number)
    if first > SHORT:
        return first
    return float(np.median([once(call, number) for _ in range(REPEATS)]))


def once(call: Callable[[int], object], number: int) -> float:
    """Time of one call [s]: what passes, less the time in which the system ran other programs instead.

    On a quiet machine that is what passes.  On a shared one, calls longer than a slice of the scheduler would appear
    many times slower than they are, and shorter ones not.
    """
    processor, begun = time.process_time(), time.perf_counter()
    call(number)
    passed = time.perf_counter() - begun
    return min(passed, time.process_time() - processor)


def spread(values: Sequence[float] | np.ndarray) -> dict[str, float]:
    """Median and 10th and 90th percentile, to four digits."""
    low, middle, high = np.percentile(np.asarray(values, dtype=float), [10, 50, 90])
    return {"median": digits(middle), "p10": digits(low), "p90": digits(high)}


def digits(value: float, count: int = 4) -> float:
    """A number rounded to significant digits: results stay small and readable."""
    return float(f"{float(value):.{count}g}")
