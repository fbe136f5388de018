"""From results to curves, and from curves to times at equal error.

A run of the results has its `errors`, one for each member from the first on, and its `times`, one for each visit;
visits take the members in turn.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

#: Errors at which contenders are compared [1].
LEVELS = (1e-3, 1e-5, 1e-7)

Curve = Sequence[tuple[float, float]]


def measured(contender: dict[str, Any]) -> list[dict[str, Any]]:
    """Runs of a contender that have errors and times, from loose to tight."""
    return [run for run in contender.get("runs", ()) if run.get("errors") and run.get("times")]


def error_of(run: dict[str, Any]) -> float:
    """Median error over the members [1]."""
    return float(np.median(run["errors"]))


def member_times(run: dict[str, Any]) -> list[float]:
    """Time of each member visited, the median of its visits [s]."""
    members = len(run["errors"])
    return [float(np.median(run["times"][k::members])) for k in range(min(members, len(run["times"])))]


def time_of(run: dict[str, Any]) -> float:
    """Median time over the members [s]."""
    return float(np.median(member_times(run)))


def curve(contender: dict[str, Any]) -> Curve:
    """(error, time) of a contender's tolerances, from loose to tight; medians."""
    return [(error_of(run), time_of(run)) for run in measured(contender)]


def written(error: float) -> str:
    """A power of ten as it is written in words: 1e-3."""
    return f"1e{round(math.log10(error))}"


def lower(curves: Sequence[Curve]) -> Curve:
    """The lower envelope of several contenders, at the errors of any of them: for figures."""
    errors = sorted({e for some in curves for e, _ in some}, reverse=True)
    found = []
    for error in errors:
        times = [t for t in (time_at(some, error) for some in curves) if t is not None]
        if times:
            found.append((error, min(times)))
    return found


def basis(points: Curve, error: float) -> tuple[tuple[int, float], ...]:
    """What the time to an error rests on: points of the curve and the share of each; none where it is not reached.

    Between neighbouring tolerances times are taken log against log.  A tolerance that is more accurate than asked for
    counts as it is, if nothing cheaper reaches the error.
    """
    found: list[tuple[float, tuple[tuple[int, float], ...]]]
    found = [(t, ((k, 1.0),)) for k, (e, t) in enumerate(points) if e <= error]
    for k, ((e0, t0), (e1, t1)) in enumerate(pairwise(points)):
        if min(e0, e1) <= error <= max(e0, e1) and e0 != e1 and min(e0, e1) > 0.0:
            share = math.log(error / e0) / math.log(e1 / e0)
            found.append((t0 * (t1 / t0) ** share, ((k, 1.0 - share), (k + 1, share))))
    return min(found, default=(math.inf, ()))[1]


def between(values: Sequence[float], shares: Sequence[tuple[int, float]]) -> float:
    """Geometric mean of the values with these shares."""
    return math.exp(sum(share * math.log(values[k]) for k, share in shares))


def time_at(points: Curve, error: float) -> float | None:
    """Time to an error [s], as `basis` says; None where it is not reached."""
    shares = basis(points, error)
    return between([t for _, t in points], shares) if shares else None


def tolerance_at(contender: dict[str, Any], error: float) -> dict[str, Any] | None:
    """The run of a contender whose error is nearest to `error`."""
    return min(measured(contender), key=lambda run: abs(math.log(max(error_of(run), 1e-16) / error)), default=None)
