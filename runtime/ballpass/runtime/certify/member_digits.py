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
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.quantity.grammar import parse_quantity
from ballpass.runtime.quantity.registry import KINDS
from ballpass.runtime.report.digits import SCATTER, further, uncertainty

#: States at the end apart by so much of their range: motions that have parted [1].
PARTED = 3e-4


def ends_of(model: LoadedModel, asked: Sequence[str]) -> list[str]:
    """Quantities that show whether motions part: range and end of each state; none where all is asked at rest."""
    kinds = [KINDS[parse_quantity(model.manifest, name).kind] for name in asked]
    if all(kind.at_rest is not None for kind in kinds):
        return []
    return [f"{kind}:{state}" for kind in ("range", "end") for state in model.states]


def parted(two: np.ndarray, asked: int) -> np.ndarray:
    """Whether two answers differ in the numbers that are asked for, or their motions at the end.

    Two answers may share a number by luck, or have it before errors have grown.

    Parameters
    ----------
    two : numbers of both, those asked for and those of `ends_of` behind them, shape (2, numbers, ...)
    asked : how many are asked for
    """
    apart = np.abs(two[1] - two[0])
    sizes, ends = np.split(np.abs(two[0][asked:]), 2)[0], np.split(apart[asked:], 2)[1]
    own = np.any(2.0 * apart[:asked] > SCATTER * np.abs(two[0][:asked]), axis=0)
    return np.asarray(own | np.any(ends > PARTED * sizes, axis=0))


def simulate_members(
    model: LoadedModel, table: Table, observables: str | Sequence[str], run: Callable[..., EnsembleResult]
) -> EnsembleResult:
    """Run an ensemble, and its members again: all at a tighter tolerance, those whose motions part at more.

    Parameters
    ----------
    run : `simulate_many` of a table, with all else given; takes `observables`, `rtol` and `kinks`
    """
    asked = [observables] if isinstance(observables, str) else list(observables)
    names = list(dict.fromkeys(asked))
    every = [*names, *ends_of(model, names)]
    result = run(table, observables=every)
    first = np.array([result[name] for name in every])
    left, interrupted = np.flatnonzero(np.isfinite(first).any(axis=0)), result.interrupted

    def again(rtol: float) -> np.ndarray:
        nonlocal interrupted
        found = np.full_like(first, np.nan)
        if len(left) and not interrupted:
            rows = {name: values[left] for name, values in result.parameters.items()}
            some = run(rows, observables=every, rtol=rtol, kinks=result.statistics.kinks)
            found[:, left] = [some[name] for name in every]
            interrupted = some.interrupted
        return found

    def scattered(two: Sequence[np.ndarray]) -> bool:
        """Leave the members whose numbers differ."""
        nonlocal left
        left = left[parted(np.array(two)[:, :, left], len(names))]
        return len(left) > 0

    runs = np.array(further(first, again, result.statistics.rtol, scattered))[:, : len(names)]
    apart = [[_apart(values) for values in row] for row in np.moveaxis(runs, 0, -1)]
    uncertain = dict(zip(names, np.array(apart), strict=True))
    kept = {name: result[name] for name in names}
    return replace(result, observables=kept, interrupted=interrupted, uncertainty=uncertain)


def _apart(values: np.ndarray) -> float:
    """± of a number from the runs that give it; not a number where there is one alone."""
    known = values[np.isfinite(values)].tolist()
    return uncertainty(known) if len(known) > 1 else math.nan
