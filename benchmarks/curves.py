"""From results to curves, and from curves to times at equal error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

#: Errors at which contenders are compared [1].
LEVELS = (1e-3, 1e-5, 1e-7)

Curve = Sequence[tuple[float, float]]


def curve(contender: dict[str, Any]) -> Curve:
    """(error, time) of a contender's tolerances, from loose to tight; medians."""
    return [
        (row["error"]["worst"]["median"], row["time"]["median"])
        for row in contender.get("runs", ())
        if "error" in row and "time" in row
    ]


def lower(curves: Sequence[Curve]) -> Curve:
    """The lower envelope of several contenders, at the errors of any of them."""
    errors = sorted({e for some in curves for e, _ in some}, reverse=True)
    found = []
    for error in errors:
        times = [t for t in (time_at(some, error) for some in curves) if t is not None]
        if times:
            found.append((error, min(times)))
    return found


def time_at(points: Curve, error: float) -> float | None:
    """Time to an error [s], between neighbouring tolerances log against log; None where it is not reached.

    A tolerance that is more accurate than asked for counts as it is, if nothing cheaper reaches the error.
    """
    times = [t for e, t in points if e <= error]
    for (e0, t0), (e1, t1) in pairwise(points):
        if min(e0, e1) <= error <= max(e0, e1) and e0 != e1 and min(e0, e1) > 0.0:
            share = math.log(error / e0) / math.log(e1 / e0)
            times.append(t0 * (t1 / t0) ** share)
    return min(times, default=None)


def tolerance_at(contender: dict[str, Any], error: float) -> dict[str, Any] | None:
    """The run of a contender whose error is nearest to `error`."""
    rows = [row for row in contender.get("runs", ()) if "error" in row and "time" in row]
    return min(rows, key=lambda row: abs(math.log(max(row["error"]["worst"]["median"], 1e-16) / error)), default=None)
