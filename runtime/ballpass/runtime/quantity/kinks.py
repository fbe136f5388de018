"""Moments at which an output has a kink, so that integrals over it are taken piece by piece.

In: deflections of the balls and other signals along a run.  Out: times.

Where a ball comes into contact, its force starts like a power of time, under the tangent law with infinite slope.
Where a law damps one way only, the force has a corner.  Where another ball becomes the most loaded one, the largest
force has a corner.  At such a
moment the derivative of the force by a parameter jumps or is unbounded.  A quadrature that runs across it converges
slowly; one whose panels end there, and get finer towards it, converges fast.  The integrand does not jump there, so
that the panels need not move with the kink.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: The output that shows where contacts begin and end.
DEFLECTION = "ball.deflection"

#: Kinks nearer to each other, or to an edge, than this share of the time that counts are taken as one [1].
APART = 1e-9

#: Halvings that locate a kink on the cubic through four nodes.
HALVINGS = 45


def crossings(t: Array, segment: NDArray[np.int_], *signals: Array) -> Array:
    """Times at which signals change sign within a segment, those of the first signal first, each increasing.

    Parameters
    ----------
    t : times that increase within each segment, shape (n,) [s]
    segment : shape (n,)
    signals : shape (n,) each
    """
    same = (np.diff(segment) == 0) & (np.diff(t) > 0.0)
    places = [np.flatnonzero(same & (signal[:-1] * signal[1:] < 0.0)) for signal in signals]
    found = np.concatenate([np.zeros(0, dtype=np.int_), *places])
    if not len(found):
        return np.zeros(0)
    # four nodes around, all of the same segment; where there are too few, those at its end twice removed
    rows = np.clip(found - 1, 0, len(t) - 4)[:, None] + np.arange(4)
    whole = np.all(segment[rows] == segment[found][:, None], axis=1) & np.all(np.diff(t[rows], axis=1) > 0.0, axis=1)
    low, high, nodes = t[found].copy(), t[found + 1].copy(), t[rows]
    of = np.repeat(np.arange(len(signals)), [len(place) for place in places])
    table = np.stack(signals)
    values, ends = table[of[:, None], rows], np.stack([table[of, found], table[of, found + 1]], axis=1)
    start, line = np.sign(ends[:, 0]), np.stack([low, high], axis=1)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        straight = ends[:, 0] + (ends[:, 1] - ends[:, 0]) * (middle - line[:, 0]) / (line[:, 1] - line[:, 0])
        height = np.where(whole, _cubic(nodes, values, middle), straight)
        left = np.sign(height) == start
        low, high = np.where(left, middle, low), np.where(left, high, middle)
    return np.asarray(0.5 * (low + high))


def _cubic(nodes: Array, values: Array, at: Array) -> Array:
    """Cubics through four nodes each (Lagrange), one value each; equal nodes give numbers that are not used."""
    total = np.zeros(len(at))
    with np.errstate(divide="ignore", invalid="ignore"):
        for i in range(4):
            term = values[:, i].copy()
            for j in range(4):
                if j != i:
                    term = term * (at - nodes[:, j]) / (nodes[:, i] - nodes[:, j])
            total += term
    return total


def rate_of(t: Array, segment: NDArray[np.int_], signal: Array) -> Array:
    """Time derivative of signals along nodes by differences within each segment, shape of `signal`."""
    rate = np.zeros_like(signal)
    for k in np.unique(segment).tolist():
        rows = np.flatnonzero(segment == k)
        kept = rows[np.concatenate([[True], np.diff(t[rows]) > 0.0])]
        if len(kept) >= 3:
            found = np.gradient(signal[kept], t[kept], axis=0)
            rate[rows] = found[np.searchsorted(t[kept], t[rows], side="right") - 1]
    return rate


def find_kinks(
    t: Array,
    segment: NDArray[np.int_],
    deflections: Sequence[Array],
    ranked: Sequence[Array],
    *,
    one_sided: bool,
    length: float,
    edges: Array,
) -> list[float]:
    """Times of kinks of outputs of the balls, increasing, apart from each other and from the edges [s].

    Parameters
    ----------
    t, segment : nodes, shape (n,)
    deflections : of the balls of each bearing, shape (n, balls), and of each stop, shape (n, 1) [m]
    ranked : channels of which only the most loaded ball's value counts, shape (n, balls)
    one_sided : whether a damping law has a corner at rate zero
    length : of the time that counts [s]
    edges : times that are edges already [s]
    """
    signals = [column for table in deflections for column in table.T]
    if one_sided:
        signals += [column for table in deflections for column in rate_of(t, segment, table).T]
    for table in ranked:
        best = np.argmax(table, axis=1)
        pairs = {
            (int(best[k]), int(best[k + 1])) for k in np.flatnonzero((np.diff(best) != 0) & (np.diff(segment) == 0))
        }
        # a crossing of two less loaded balls is no kink; the extra cut does no harm
        signals += [table[:, a] - table[:, b] for a, b in sorted({(min(pair), max(pair)) for pair in pairs})]
    kept: list[float] = []
    for time in np.sort(crossings(t, segment, *signals)).tolist():
        last = kept[-1] if kept else -np.inf
        if time - last > APART * length and np.min(np.abs(edges - time)) > APART * length:
            kept.append(time)
    return kept
