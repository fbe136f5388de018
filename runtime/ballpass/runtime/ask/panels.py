"""Into which panels a run is cut for quadratures, as fine as its signals need.

In: edges of a run, and signals along the nodes of coarser panels.  Out: `Panels`, and the `Plan` of their nodes.

Panels have nothing to do with the samples of a run.  Gauss's rule of four nodes is exact for polynomials of degree
seven; how large the part of third degree is that its nodes see tells how many times finer a panel has to be.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.ask.nodes import Edges, Plan

Array = NDArray[np.float64]

#: Nodes of Gauss's rule in a panel, in fractions of it, and their weights, which add up to one.
_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(4)
GAUSS, WEIGHTS = 0.5 * (1.0 + _GAUSS), 0.5 * _WEIGHTS

#: What times the nodes' values gives the part of third degree (Legendre).
_THIRD = 7.0 * WEIGHTS * (2.5 * _GAUSS**3 - 1.5 * _GAUSS)

#: Fewest nodes in the time that counts.
FEWEST = 1024

#: Part of third degree that is allowed in a panel, relative to the channel's extent: at a vibration a quarter of a
#: radian a panel.  Derivatives, which nobody looks at here, are rougher by much: at 1e-3 that of the crank-shaper's rms
#: by the speed was 0.4 % off, where the value had nine digits.
ROUGH = 1e-4

#: Most parts of a panel in one pass.
PARTS = 8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Panels:
    """Panels within segments, in order of time: they hold for neighbouring parameters as well.

    Attributes
    ----------
    segment : segment of each, shape (panels,)
    low, high : ends in fractions of the segment, shape (panels,)
    """

    segment: NDArray[np.int_]
    low: Array
    high: Array

    def __len__(self) -> int:
        return len(self.segment)


def uniform_panels(edges: Edges, per_turn: int) -> Panels:
    """Panels of about one length over the time that counts.

    Parameters
    ----------
    per_turn : nodes in a turn; in the whole run where nothing turns
    """
    window = edges.window
    span = window.turn if math.isfinite(window.turn) else window.duration
    lengths = np.diff(edges.times)[edges.first :]
    density = max(per_turn / span, FEWEST / float(np.sum(lengths))) / len(GAUSS)
    counts = np.maximum(np.ceil(lengths * density), 1).astype(int)
    whole = np.arange(edges.first, len(edges.times) - 1)
    zeros, ones = np.zeros(len(whole)), np.ones(len(whole))
    return split(Panels(segment=whole.astype(np.int_), low=zeros, high=ones), counts)


def split(panels: Panels, parts: NDArray[np.int_]) -> Panels:
    """Each panel in so many equal parts."""
    first = np.repeat(np.cumsum(parts) - parts, parts)
    place = np.arange(int(np.sum(parts))) - first
    low, high, of = (np.repeat(item, parts) for item in (panels.low, panels.high, parts))
    ends = [np.where(k == of, high, low + (high - low) * k / of) for k in (place, place + 1)]
    return Panels(segment=np.repeat(panels.segment, parts), low=ends[0], high=ends[1])


def parts_needed(signals: Sequence[Array], rough: float) -> NDArray[np.int_]:
    """Into how many parts each panel is to be split, shape (panels,).

    Parameters
    ----------
    signals : channels at the nodes of the panels, shape (4 panels, columns) each
    rough : part of third degree that is allowed, relative to a channel's extent [1]
    """
    most = np.zeros(len(signals[0]) // len(GAUSS))
    for signal in signals:
        extent = float(np.max(signal) - np.min(signal))
        if extent > 0.0:
            third = np.einsum("i,pic->pc", _THIRD, signal.reshape(-1, len(GAUSS), signal.shape[1]))
            most = np.maximum(most, np.max(np.abs(third), axis=1) / extent)
    return np.clip(np.ceil(np.cbrt(most / rough)), 1, PARTS).astype(np.int_)


def between_kinks(panels: Panels, edges: Edges, broken: Edges) -> Panels:
    """The same panels where `broken` has further edges, at kinks."""
    left, right = edges.times[panels.segment], edges.times[panels.segment + 1]
    ends = left + panels.low * (right - left)
    segment, low, high = [], [], []
    for k in range(broken.first, len(broken.times) - 1):
        begin, end = float(broken.times[k]), float(broken.times[k + 1])
        near = 1e-9 * (end - begin)
        inner = (ends[(ends > begin + near) & (ends < end - near)] - begin) / (end - begin)
        cuts = [0.0, *inner.tolist(), 1.0]
        segment += [k] * (len(cuts) - 1)
        low += cuts[:-1]
        high += cuts[1:]
    return Panels(segment=np.array(segment, dtype=np.int_), low=np.array(low), high=np.array(high))


def plan_of(panels: Panels, edges: Edges) -> Plan:
    """Nodes of Gauss's rule in each panel, and both sides of each edge.

    In a segment that ends at a kink the rule is taken in s, where the fraction is ``s^2 (3 - 2 s)``: what grows like
    the square root of time behind the kink is smooth in s.
    """
    kinked = np.zeros(len(edges.times), dtype=bool)
    kinked[list(edges.kinks)] = True
    graded = (kinked[panels.segment] | kinked[panels.segment + 1])[:, None]
    low, high = (np.where(graded, _graded(end[:, None]), end[:, None]) for end in (panels.low, panels.high))
    s = low + (high - low) * GAUSS
    place = np.where(graded, s**2 * (3.0 - 2.0 * s), s)
    share = (high - low) * WEIGHTS * np.where(graded, 6.0 * s * (1.0 - s), 1.0)
    whole = np.arange(edges.first, len(edges.times) - 1)
    sides = np.concatenate([np.zeros(len(whole)), np.ones(len(whole))])
    segment = np.concatenate([np.repeat(panels.segment, len(GAUSS)), whole, whole]).astype(np.int_)
    fraction = np.concatenate([place.ravel(), sides])
    weight = np.concatenate([share.ravel(), 0.0 * sides])
    order = np.lexsort((fraction, segment))
    return Plan(segment=segment[order], fraction=fraction[order], weight=weight[order], segments=len(edges.times) - 1)


def _graded(fraction: Array) -> Array:
    """Where ``s^2 (3 - 2 s)`` is a fraction (Vieta)."""
    return np.asarray(0.5 - np.sin(np.arcsin(1.0 - 2.0 * fraction) / 3.0))
