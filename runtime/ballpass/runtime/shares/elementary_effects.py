"""Elementary effects of inputs (Morris 1991): how much a result changes where one input moves by half of its values.

In: results of members, NaN for those without; infinite ones are left out as well.  Out: `ElementaryEffect`.

Each base member has one further member for each input, whose share of smaller values is moved by a half: the radial
design of Campolongo, Saltelli and Cariboni 2011 with one step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

#: Distance between a base member and the one that is compared with it, in shares of smaller values [1].
STEP = 0.5

#: Resamples of a bootstrap.
RESAMPLES = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class ElementaryEffect:
    """Changes of a result by one input, over the whole of its distribution.

    Attributes
    ----------
    size, size_low, size_high : mean of the changes without their signs, and 95 % interval
    mean : of the changes
    deviation : of the changes among base members; zero for an input that acts linearly and by itself
    rows : pairs of members that both had results; with fewer than two the rest is NaN

    Examples
    --------
    >>> found = model.morris("bearing.clearance=5 um:15 um", "rms:inner.y", cycles=3, base=8)
    >>> (effect,) = found.quantities[0].effects
    >>> effect.rows, effect.size_low <= effect.size <= effect.size_high
    (8, True)
    """

    size: float
    size_low: float
    size_high: float
    mean: float
    deviation: float
    rows: int


def moved(shares: np.ndarray) -> np.ndarray:
    """Shares of the members that are compared with base members, shape (inputs, members, inputs)."""
    count = shares.shape[1]
    return np.where(np.eye(count, dtype=bool)[:, None, :], (shares + STEP) % 1.0, shares)


def elementary_effects(shares: np.ndarray, base: np.ndarray, other: np.ndarray, seed: int) -> list[ElementaryEffect]:
    """Effects of all inputs.

    Parameters
    ----------
    shares : of the base members, shape (members, inputs)
    base : their results, shape (members,)
    other : results of the members of `moved`, shape (inputs, members)
    seed : of the bootstrap
    """
    random = np.random.default_rng(seed)
    found = []
    for column, one in zip(shares.T, other, strict=True):
        known = np.isfinite(one) & np.isfinite(base)
        changes = (one[known] - base[known]) / ((column + STEP) % 1.0 - column)[known]
        values = dict.fromkeys(_NUMBERS, math.nan)
        if len(changes) > 1:
            size = np.abs(changes)
            again = np.mean(random.choice(size, (RESAMPLES, len(changes))), axis=1)
            low, high = np.percentile(again, (2.5, 97.5)).tolist()
            numbers = (np.mean(size), low, high, np.mean(changes), np.std(changes))
            values = dict(zip(_NUMBERS, map(float, numbers), strict=True))
        found.append(ElementaryEffect(**values, rows=len(changes)))
    return found


_NUMBERS = ("size", "size_low", "size_high", "mean", "deviation")
