"""± of the numbers of an ensemble, from runs of its members at tighter tolerances.

In: a table of members, and how to run it.  Out: the ensemble with the uncertainty of its observables.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ballpass.runtime.many.ensemble import EnsembleResult
from ballpass.runtime.many.members import Table
from ballpass.runtime.report.digits import SCATTER, further, uncertainty


def simulate_members(table: Table, run: Callable[..., EnsembleResult]) -> EnsembleResult:
    """Run an ensemble, and its members again: all at a tighter tolerance, those whose numbers scatter at more.

    Parameters
    ----------
    run : `simulate_many` of a table, with all else given; takes `rtol` and `kinks`
    """
    result = run(table)
    first = np.array(list(result.observables.values()))
    left, interrupted = np.flatnonzero(np.isfinite(first).any(axis=0)), result.interrupted

    def again(rtol: float) -> np.ndarray:
        nonlocal interrupted
        found = np.full_like(first, np.nan)
        if len(left) and not interrupted:
            rows = {name: values[left] for name, values in result.parameters.items()}
            some = run(rows, rtol=rtol, kinks=result.statistics.kinks)
            found[:, left] = [some[name] for name in result]
            interrupted = some.interrupted
        return found

    def scattered(two: Sequence[np.ndarray]) -> bool:
        """Leave the members whose numbers differ."""
        nonlocal left
        differ = 2.0 * np.abs(two[1] - two[0]) > SCATTER * np.abs(first)
        left = left[np.any(differ[:, left], axis=0)]
        return len(left) > 0

    runs = np.array(further(first, again, result.statistics.rtol, scattered))
    every = [[_apart(values) for values in row] for row in np.moveaxis(runs, 0, -1)]
    uncertain = dict(zip(result, np.array(every), strict=True))
    return replace(result, interrupted=interrupted, uncertainty=uncertain)


def _apart(values: np.ndarray) -> float:
    """± of a number from the runs that give it; not a number where there is one alone."""
    known = values[np.isfinite(values)].tolist()
    return uncertainty(known) if len(known) > 1 else math.nan
