"""Moments at which an output has a kink, so that integrals over it are taken piece by piece.

In: deflections of the balls, their rates and other signals along a run.  Out: times.

Where a ball comes into contact, its force starts like a power of time, under the tangent law with infinite slope.
Where a law damps one way only, the force has a corner.  Where another ball becomes the most loaded one, the largest
force has a corner.  At such a
moment the derivative of the force by a parameter jumps or is unbounded.  A quadrature that runs across it converges
slowly; one whose panels end there, and get finer towards it, converges fast.  The integrand does not jump there, so
that the panels need not move with the kink.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: The output that shows where contacts begin and end.
DEFLECTION = "ball.deflection"

#: Halvings that locate a kink on the cubic through four nodes.
HALVINGS = 45


def crossings(t: Array, segment: NDArray[np.int_], *signals: Array, counts: NDArray[np.bool_] | None = None) -> Array:
    """Times at which signals change sign within a segment, those of the first signal first, each increasing.

    Parameters
    ----------
    t : times that increase within each segment, shape (n,) [s]
    segment : shape (n,)
    signals : shape (n,) each
    counts : at which places each signal counts, shape (signals, n); None: at all
    """
    same = (np.diff(segment) == 0) & (np.diff(t) > 0.0)
    places = [np.flatnonzero(same & (signal[:-1] * signal[1:] < 0.0)) for signal in signals]
    if counts is not None:
        places = [place[here[place] | here[place + 1]] for place, here in zip(places, counts, strict=True)]
    found = np.concatenate([np.zeros(0, dtype=np.int_), *places])
    if not len(found):
        return np.zeros(0)
    # four nodes of the same segment around; a straight line where it has fewer
    first, last = np.searchsorted(segment, segment[found]), np.searchsorted(segment, segment[found], side="right")
    begin = np.clip(np.minimum(np.maximum(found - 1, first), last - 4), 0, max(len(t) - 4, 0))
    rows = np.minimum(begin[:, None] + np.arange(4), len(t) - 1)
    whole = np.all(segment[rows] == segment[found][:, None], axis=1) & np.all(np.diff(t[rows], axis=1) > 0.0, axis=1)
    low, high, nodes = t[found].copy(), t[found + 1].copy(), t[rows]
    of = np.repeat(np.arange(len(signals)), [len(place) for place in places])
    table = np.stack(signals)
    values, ends = table[of[:, None], rows], np.stack([table[of, found], table[of, found + 1]], axis=1)
    start, cubics = np.sign(ends[:, 0]), _cubics(nodes, values)
    # a straight line is a cubic without its higher parts
    cubics[~whole] = 0.0
    nodes[~whole, 0], cubics[~whole, 0] = low[~whole], ends[~whole, 0]
    cubics[~whole, 1] = ((ends[:, 1] - ends[:, 0]) / (high - low))[~whole]
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        height = cubics[:, 3]
        for k in (2, 1, 0):
            height = cubics[:, k] + (middle - nodes[:, k]) * height
        left = np.sign(height) == start
        low, high = np.where(left, middle, low), np.where(left, high, middle)
    return np.asarray(0.5 * (low + high))


def _cubics(nodes: Array, values: Array) -> Array:
    """Cubics through four nodes each (Newton's divided differences); equal nodes give numbers that are not used."""
    found = values.copy()
    with np.errstate(divide="ignore", invalid="ignore"):
        for k in range(1, 4):
            found[:, k:] = (found[:, k:] - found[:, k - 1 : -1]) / (nodes[:, k:] - nodes[:, :-k])
    return found


def rank_differences(segment: NDArray[np.int_], table: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Differences that pass zero where another ball becomes the most loaded one, and where one of both is that ball.

    Parameters
    ----------
    table : forces of the balls, shape (n, balls)

    Returns
    -------
    shape (n, pairs) each
    """
    best = np.argmax(table, axis=1)
    changes = np.flatnonzero((np.diff(best) != 0) & (np.diff(segment) == 0))
    pairs = sorted(
        {(min(pair), max(pair)) for pair in zip(best[changes].tolist(), best[changes + 1].tolist(), strict=True)}
    )
    one, other = np.array(pairs, dtype=np.int_).reshape(-1, 2).T
    return table[:, one] - table[:, other], (best[:, None] == one) | (best[:, None] == other)
