"""Panels of a run for quadratures: its own steps, cut finer where its signals need it.

In: ends of the steps of a run, and signals along the nodes of coarser panels.  Out: `Panels`, and the `NodePlan` of
their nodes.

The integrator chooses its steps so that the motion is smooth within each; where it ends them on the kinks of the laws,
so do the panels.  Outputs may be rougher than states: Gauss's rule of four nodes is exact for polynomials of degree
seven, and the size of the part of third degree at its nodes gives how many times finer a panel has to be.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.quantity.nodes import Edges, NodePlan, ordered_plan

Array = NDArray[np.float64]

#: Turns until times [s], both of one shape.
Turned = Callable[[Array], Array]

#: Nodes of Gauss's rule in a panel, in fractions of it, and their weights, which add up to one.
_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(4)
GAUSS, WEIGHTS = 0.5 * (1.0 + _GAUSS), 0.5 * _WEIGHTS

#: Weights of the nodes' values that give the part of third degree (Legendre).
_THIRD = 7.0 * WEIGHTS * (2.5 * _GAUSS**3 - 1.5 * _GAUSS)

#: Places in a panel between which a signal is taken to pass zero at most once.
BETWEEN = np.linspace(0.0, 1.0, 9)

#: Matrix that takes values at the nodes to these places, by the polynomial through them.
_TO_BETWEEN = np.vander(2.0 * BETWEEN - 1.0, 4) @ np.linalg.inv(np.vander(_GAUSS, 4))

#: Fewest panels in a turn where no steps are taken: of outputs that follow from time alone.
FEWEST = 256

#: Part of third degree that is allowed in a panel, relative to the channel's extent: at a vibration a quarter of a
#: radian a panel.  Derivatives, which are not evaluated here, are much rougher: at 1e-3 that of the crank-shaper's
#: rms by the speed was 0.4 % off, where the value had nine digits.
ROUGH = 1e-4

#: Most that an oscillation turns in a panel where it multiplies a signal: Gauss's rule is good to 1e-7 then [rad].
TURNING = 2.0

#: Most parts of a panel in one pass.
PARTS = 8

#: A step is too long for a square root at a kink beyond its end that is nearer than this share of its length [1].
NEAR_KINK = 0.5

#: Ends nearer to each other than this share of an interval are one [1].
APART = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Panels:
    """Panels within intervals between edges, in order of time.

    A panel is a part of a span in s, which goes from 0 to 1 over the span.  After a kink the place in the span is
    ``s^2``, before one ``1 - (1 - s)^2``, between two ``s^2 (3 - 2 s)``, else s: a function that grows like the square
    root of time after a kink is smooth in s.

    Attributes
    ----------
    segment : interval of each, shape (panels,)
    low, high : ends of its span in fractions of the interval, shape (panels,)
    kinked : whether a kink is at the low and at the high end of its span, shape (panels, 2)
    begin, end : of the panel in s, shape (panels,)
    """

    segment: NDArray[np.int_]
    low: Array
    high: Array
    kinked: NDArray[np.bool_]
    begin: Array
    end: Array

    def __len__(self) -> int:
        return len(self.segment)

    def at(self, part: Array) -> tuple[Array, Array]:
        """Fractions of the interval at parts of each panel, and how fast they grow with the part.

        Parameters
        ----------
        part : from 0 to 1, shape (parts,)

        Returns
        -------
        shape (panels, parts) each
        """
        width = (self.end - self.begin)[:, None]
        s = self.begin[:, None] + width * part
        low, high = self.kinked[:, :1], self.kinked[:, 1:]
        place = np.select([low & high, low, high], [s**2 * (3.0 - 2.0 * s), s**2, 1.0 - (1.0 - s) ** 2], s)
        rate = np.select([low & high, low, high], [6.0 * s * (1.0 - s), 2.0 * s, 2.0 * (1.0 - s)], 1.0)
        span = (self.high - self.low)[:, None]
        return self.low[:, None] + span * place, span * width * rate


def uniform_panels(edges: Edges, turn: float) -> Panels:
    """Panels of about one length over the time that counts.

    Parameters
    ----------
    turn : time of a turn, infinite where nothing turns [s]
    """
    lengths = np.diff(edges.times)[edges.first :]
    counts = np.maximum(np.ceil(lengths * FEWEST / min(turn, float(np.sum(lengths)))), 1).astype(int)
    whole = np.arange(edges.first, len(edges.times) - 1)
    return split(_spans(whole, np.zeros(len(whole)), np.ones(len(whole)), np.zeros((len(whole), 2))), counts)


def panels_of_steps(edges: Edges, ends: Array, kinks: NDArray[np.bool_], turn: float, turned: Turned | None) -> Panels:
    """Panels that are steps; parts of them where a step is longer than a panel of `uniform_panels`.

    A step is as long as its states allow, which may be turns where a table gives the speed and nothing else moves.

    Parameters
    ----------
    ends : of the steps, increasing, shape (steps,) [s]
    kinks : whether outputs have a kink there, shape (steps,)
    turn : time of a turn, infinite where nothing turns [s]
    turned : turns of a driver whose speed changes, until times; None where it does not change
    """
    panels, lengths = panels_between(edges, ends, kinks), np.diff(edges.times)
    longest = min(turn, float(np.sum(lengths[edges.first :]))) / FEWEST
    places = panels.at(np.array([0.0, 0.5, 1.0]))[0] * lengths[panels.segment][:, None]
    parts = (places[:, 2] - places[:, 0]) / longest
    if turned is not None:
        times = edges.times[panels.segment][:, None] + places
        # both halves: the driver may turn back within a step
        parts = np.maximum(parts, FEWEST * np.sum(np.abs(np.diff(turned(times), axis=1)), axis=1))
    return split(panels, np.maximum(np.ceil(parts * (1.0 - 1e-9)), 1).astype(int))


def _spans(segment: NDArray[np.int_], low: Array, high: Array, kinked: Array) -> Panels:
    """Panels that are whole spans; those at a kink in two."""
    zeros, sides = np.zeros(len(segment)), kinked.astype(bool)
    panels = Panels(segment=segment, low=low, high=high, kinked=sides, begin=zeros, end=zeros + 1.0)
    return split(panels, np.where(np.any(sides, axis=1), 2, 1))


def panels_between(edges: Edges, cuts: Array, kinks: NDArray[np.bool_]) -> Panels:
    """Panels over the time that counts that end at `cuts` and at the edges.

    Parameters
    ----------
    cuts : increasing, shape (cuts,) [s]
    kinks : whether outputs have a kink there, shape (cuts,)
    """
    segment, low, high, kinked = [], [], [], []
    for k in range(edges.first, len(edges.times) - 1):
        left, right = float(edges.times[k]), float(edges.times[k + 1])
        near = APART * (right - left)
        first, last = np.searchsorted(cuts, [left - near, right + near])
        inner, kink = cuts[first:last], kinks[first:last]
        free = (inner > left + near) & (inner < right - near)
        places, on_kink = _distinct(inner[free], kink[free], near)
        ends = np.concatenate([[0.0], (places - left) / (right - left), [1.0]])
        at = np.concatenate(
            [[bool(np.any(kink[inner <= left + near]))], on_kink, [bool(np.any(kink[inner >= right - near]))]]
        )
        kept = _apart_from_kinks(ends, at)
        ends, at = ends[kept], at[kept]
        segment.append(np.full(len(ends) - 1, k))
        low.append(ends[:-1])
        high.append(ends[1:])
        kinked.append(np.stack([at[:-1], at[1:]], axis=1))
    return _spans(np.concatenate(segment), np.concatenate(low), np.concatenate(high), np.concatenate(kinked))


def _distinct(places: Array, kinks: NDArray[np.bool_], near: float) -> tuple[Array, NDArray[np.bool_]]:
    """Increasing places, those that are nearer to each other than `near` as one, which is a kink if one of them is."""
    if not len(places):
        return places, kinks
    first = np.flatnonzero(np.diff(places, prepend=-np.inf) > near)
    return places[first], np.logical_or.reduceat(kinks, first)


def _apart_from_kinks(ends: Array, at: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Ends to keep, shape of `ends`.

    Steps end on kinks, and the last step before one may be much shorter than those before it.  A function that grows
    like the square root of time at the kink is then not smooth in the longer step beside it, and one span of both
    steps, over which s is taken, resolves it.
    """
    kept, last = np.ones(len(ends), dtype=bool), len(ends) - 1
    for kink in np.flatnonzero(at).tolist():
        for way in (-1, 1):
            k = kink + way
            while 0 < k < last and not at[k] and abs(ends[k] - ends[kink]) < NEAR_KINK * abs(ends[k + way] - ends[k]):
                kept[k] = False
                k += way
    return kept


def split(panels: Panels, parts: NDArray[np.int_]) -> Panels:
    """Each panel in so many equal parts."""
    if np.all(parts == 1):
        return panels  # itself
    first = np.repeat(np.cumsum(parts) - parts, parts)
    place = np.arange(int(np.sum(parts))) - first
    begin, end, of = (np.repeat(item, parts) for item in (panels.begin, panels.end, parts))
    ends = [np.where(k == of, end, begin + (end - begin) * k / of) for k in (place, place + 1)]
    return Panels(
        segment=np.repeat(panels.segment, parts),
        low=np.repeat(panels.low, parts),
        high=np.repeat(panels.high, parts),
        kinked=np.repeat(panels.kinked, parts, axis=0),
        begin=ends[0],
        end=ends[1],
    )


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


def parts_of_oscillation(panels: Panels, edges: Edges, frequency: float) -> NDArray[np.int_]:
    """Into how many parts each panel is to be split where a signal is multiplied with an oscillation, shape (panels,).

    Parameters
    ----------
    frequency : of the oscillation [Hz]
    """
    lengths = np.diff(panels.at(np.array([0.0, 1.0]))[0])[:, 0] * np.diff(edges.times)[panels.segment]
    return np.maximum(np.ceil(lengths * (2.0 * np.pi * frequency / TURNING)), 1).astype(np.int_)


def interpolated(panels: Panels, edges: Edges, signals: Array) -> tuple[Array, NDArray[np.int_], Array]:
    """Times of places in each panel, both ends among them, the panels' indices, and signals there.

    Parameters
    ----------
    signals : at the nodes of the panels, smooth in each, shape (4 panels, columns)

    Returns
    -------
    shapes (places,) [s], (places,) and (places, columns)
    """
    left, right = edges.times[panels.segment], edges.times[panels.segment + 1]
    times = left[:, None] + panels.at(BETWEEN)[0] * (right - left)[:, None]
    values = _TO_BETWEEN @ signals.reshape(len(panels), len(GAUSS), -1)
    return times.ravel(), np.repeat(np.arange(len(panels)), len(BETWEEN)), values.reshape(times.size, -1)


def cut_at(panels: Panels, edges: Edges, times: Array) -> Panels:
    """The same panels, cut at kinks."""
    if not len(times):
        return panels
    left, right = edges.times[panels.segment], edges.times[panels.segment + 1]
    ends = left + panels.at(np.ones(1))[0][:, 0] * (right - left)
    every = np.concatenate([ends, times])
    kinks = np.concatenate([panels.kinked[:, 1] & (panels.end == 1.0), np.ones(len(times), dtype=bool)])
    order = np.argsort(every, kind="stable")
    return panels_between(edges, every[order], kinks[order])


def plan_of(panels: Panels, edges: Edges) -> NodePlan:
    """Nodes of Gauss's rule in each panel, and both sides of each edge."""
    place, rate = panels.at(GAUSS)
    whole = np.arange(edges.first, len(edges.times) - 1)
    sides = np.concatenate([np.zeros(len(whole)), np.ones(len(whole))])
    segment = np.concatenate([np.repeat(panels.segment, len(GAUSS)), whole, whole]).astype(np.int_)
    fraction = np.concatenate([place.ravel(), sides])
    weight = np.concatenate([(WEIGHTS * rate).ravel(), 0.0 * sides])
    return ordered_plan(segment, fraction, weight)
