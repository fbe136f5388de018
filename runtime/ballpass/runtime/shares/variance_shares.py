"""Shares of the inputs in the variance of a result (Sobol' indices), and shares of members within limits.

In: results of members, NaN for those without.  Out: `VarianceShare`, intervals.

Base members have inputs A and B, drawn independently; further ones have those of A but for one input, which is that of
B.  The estimators are those of Saltelli et al. 2010, as in `scipy.stats.sobol_indices`, which takes no failed members.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.stats import binomtest

#: Resamples of a bootstrap, and fewest rows that have shares: half of the fewest base samples.
RESAMPLES, FEWEST = 500, 8


@dataclass(frozen=True, slots=True, kw_only=True)
class VarianceShare:
    """Shares of one input in the variance of a result.

    Attributes
    ----------
    first, first_low, first_high : what the variance would lose on average if the input were known, and 95 % interval
    total, total_low, total_high : what is left of it if all others were known
    rows : base members of which all three needed members had results; with fewer than `FEWEST` the rest is NaN

    Examples
    --------
    >>> clearance = "bearing.clearance=5 um:15 um"
    >>> found = model.sobol(clearance, "rms:inner.y", cycles=3, samples=32)
    >>> (share,) = found.quantities[0].shares
    >>> share.rows, 0.5 < share.total < 1.5
    (32, True)
    """

    first: float
    first_low: float
    first_high: float
    total: float
    total_low: float
    total_high: float
    rows: int

    @property
    def borne(self) -> VarianceShare:
        """The same within what shares can be: estimates from few members lie outside 0 and 1, or first above total.

        Examples
        --------
        >>> clearance = "bearing.clearance=5 um:15 um"
        >>> found = model.sobol(clearance, "rms:inner.y", cycles=3, samples=32)
        >>> found.quantities[0].shares[0].borne.total_high
        1.0
        """
        total_high = float(np.clip(self.total_high, 0.0, 1.0))
        first_low, first_high = np.clip((self.first_low, self.first_high), 0.0, total_high).tolist()
        total_low = float(np.clip(self.total_low, first_low, total_high))
        first_now = float(np.clip(self.first, first_low, first_high))
        total_now = float(np.clip(self.total, total_low, total_high))
        numbers = (first_now, first_low, first_high, total_now, total_low, total_high)
        return VarianceShare(**dict(zip(_NUMBERS, numbers, strict=True)), rows=self.rows)


def variance_shares(a: np.ndarray, b: np.ndarray, mixed: np.ndarray, seed: int) -> tuple[VarianceShare, ...]:
    """Shares of all inputs.

    A failed member takes the two that it is compared with along, and no others.

    Parameters
    ----------
    a, b : results with inputs A and B, shape (rows,)
    mixed : with A but for one input, shape (inputs, rows)
    seed : of the bootstrap
    """
    random = np.random.default_rng(seed)
    found = []
    for one in mixed:
        known = np.isfinite(a) & np.isfinite(b) & np.isfinite(one)
        rows = int(np.count_nonzero(known))
        if rows < FEWEST:
            found.append(VarianceShare(**dict.fromkeys(_NUMBERS, math.nan), rows=rows))
            continue
        parts = np.stack([a[known], b[known], one[known]])
        draws = random.integers(0, rows, (RESAMPLES, rows))
        again = np.array([_shares(parts[:, draw]) for draw in draws])
        low, high = np.nanpercentile(again, (2.5, 97.5), axis=0).tolist()
        first, total = _shares(parts)
        values = (first, low[0], high[0], total, low[1], high[1])
        found.append(VarianceShare(**dict(zip(_NUMBERS, values, strict=True)), rows=rows))
    return tuple(found)


_NUMBERS = ("first", "first_low", "first_high", "total", "total_low", "total_high")


def _shares(parts: np.ndarray) -> tuple[float, float]:
    """First and total share from results with A, with B and with A but for one input, shape (3, rows)."""
    a, b, one = parts - np.mean(parts[:2])
    variance = np.var(parts[:2])
    if variance == 0.0:
        return math.nan, math.nan
    return float(np.mean(b * (one - a)) / variance), float(0.5 * np.mean((a - one) ** 2) / variance)


def wilson(hits: int, members: int) -> tuple[float, float]:
    """95 % interval of a share by Wilson (1927), from independent members."""
    if not members:
        return 0.0, 1.0
    interval = binomtest(hits, members).proportion_ci(method="wilson")
    return float(interval.low), float(interval.high)
