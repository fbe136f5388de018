"""Time contenders in rounds, A B C A B C ..., so that other load on the machine slows all of them alike."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

#: Calls shorter than this are repeated within a visit, after one that does not count: warm, as in a loop [s].
SHORT = 5e-3
REPEATS = 3


def timed(call: Callable[[], object]) -> float:
    """Time of a call [s]: elapsed time without the time in which the system ran other programs."""
    processor, begun = time.process_time(), time.perf_counter()
    call()
    return min(time.perf_counter() - begun, time.process_time() - processor)


def visit(call: Callable[[], object]) -> float:
    """Time of a warm call [s]."""
    first = timed(call)
    return first if first > SHORT else float(np.median([timed(call) for _ in range(REPEATS)]))


def interleave(calls: Sequence[Callable[[], object]], rounds: int) -> np.ndarray:
    """Times of all calls, visited in turn; shape (rounds, calls) [s]."""
    return np.array([[visit(call) for call in calls] for _ in range(rounds)])


def spread(values: Sequence[float] | np.ndarray) -> tuple[float, float, float]:
    """Median, 10th and 90th percentile, to four digits: results stay small and readable."""
    low, middle, high = np.percentile(np.asarray(values, dtype=float), [10, 50, 90])
    return float(f"{middle:.4g}"), float(f"{low:.4g}"), float(f"{high:.4g}")
