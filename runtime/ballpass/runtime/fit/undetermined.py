"""What of the unknowns of a fit the data do not determine, and what combination of them they do.

In: a `Misfit` and the best search.  Out: `UndeterminedGroup`s.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import null_space

from ballpass.runtime.fit.least_squares import Fitted
from ballpass.runtime.fit.misfit import Misfit


@dataclass(frozen=True, slots=True, kw_only=True)
class UndeterminedGroup:
    """Numbers that the data do not determine each.

    Attributes
    ----------
    names : of the numbers
    words : what is not determined
    combination : what of them is, as ``a · b``; empty where there is no single one
    value, deviation : of the combination, SI, and its standard deviation as a share of it; NaN where there is none

    Examples
    --------
    >>> run = model.simulate(duration=0.05, sample_rate=10e3)
    >>> noise = 1e-8 * np.random.default_rng(1).standard_normal(len(run.t))
    >>> data = {"time": run.t, "inner.y": run["inner.y"] + noise}
    >>> inertia = "mechanism.bodies.crank.inertia=1 kg*mm^2:900 kg*mm^2"
    >>> (group,) = model.fit(data, [inertia, "bearing.clearance=5 um:30 um"]).undetermined
    >>> group.names
    ('mechanism.bodies.crank.inertia',)
    """

    names: tuple[str, ...]
    words: str
    combination: str
    value: float
    deviation: float


def undetermined_groups(misfit: Misfit, best: Fitted) -> tuple[UndeterminedGroup, ...]:
    """Groups of unknowns that share a direction which the data do not determine."""
    left, groups = list(best.blind), []
    while left:
        some, members = [left.pop(0)], set()
        while True:
            members = {k for one in some for k in one.unknowns}
            more = [one for one in left if members & set(one.unknowns)]
            if not more:
                break
            some += more
            left = [one for one in left if one not in more]
        places = sorted(members)
        rows = np.zeros((len(some), len(places)))
        for row, one in zip(rows, some, strict=True):
            row[[places.index(k) for k in one.unknowns]] = one.changes
        groups.append(_group(misfit, best, places, rows))
    return tuple(groups)


def _group(misfit: Misfit, best: Fitted, places: Sequence[int], rows: np.ndarray) -> UndeterminedGroup:
    """A group of unknowns, with the directions that are not determined as rows."""
    unknowns = [misfit.unknowns[k] for k in places]
    names = tuple(one.name for one in unknowns)
    across = null_space(rows)
    every = ", ".join(names[:-1]) + f" and {names[-1]}" if len(names) > 1 else names[0]
    if not across.shape[1]:
        words = f"The data do not determine {every}: other values within the bounds fit as well."
        return UndeterminedGroup(names=names, words=words, combination="", value=math.nan, deviation=math.nan)
    ways = []
    for row in rows:
        moves = [
            f"{one.name} {'grows' if change > 0 else 'falls'} by {abs(change):.3g} %"
            + ("" if one.relative else " of its range")
            for one, change in zip(unknowns, row.tolist(), strict=True)
            if change
        ]
        ways.append(f"where {' and '.join(moves)}, nothing changes beyond the noise")
    words = f"The data do not determine {every} each: {'; '.join(ways)}."
    if across.shape[1] > 1 or not all(one.relative for one in unknowns):
        return UndeterminedGroup(names=names, words=words, combination="", value=math.nan, deviation=math.nan)
    exponents = across[:, 0] / across[np.argmax(np.abs(across[:, 0])), 0]
    values = misfit.values(best.counts)
    gradient = np.zeros(len(values))
    for k, exponent in zip(places, exponents.tolist(), strict=True):
        gradient[k] = exponent * misfit.unknowns[k].slope(float(best.counts[k])) / values[k]
    plain = [float(round(e)) if abs(e - round(e)) < 0.02 else float(f"{e:.3g}") for e in exponents.tolist()]
    return UndeterminedGroup(
        names=names,
        words=words,
        combination=" · ".join(n if e == 1.0 else f"{n}^{e:g}" for n, e in zip(names, plain, strict=True)),
        value=float(np.prod([abs(values[k]) ** e for k, e in zip(places, plain, strict=True)])),
        deviation=float(np.sqrt(gradient @ best.covariance @ gradient)),
    )
