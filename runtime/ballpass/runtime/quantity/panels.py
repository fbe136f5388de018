"""Panels of a run for quadratures: its own steps, cut finer where its signals need it.

In: ends of the steps of a run, and signals along the nodes of coarser panels.  Out: `Panels`, and their `Nodes`.

The integrator chooses its steps so that the motion is smooth within each; where it ends them on the kinks of the laws,
so do the panels.  Outputs may be rougher than states: Gauss's rule of four nodes is exact for polynomials of degree
seven, and the size of the part of third degree at its nodes gives how many times finer a panel has to be.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.quantity.nodes import APART, Cuts, Nodes, place

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

#: How far a signal may lie there beyond its values at the nodes, over the range of these [1].
_BEYOND = 0.5 * (float(np.max(np.sum(np.abs(_TO_BETWEEN), axis=1))) - 1.0)

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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Panels:
    """Panels within intervals between cuts, in order of time.

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

    def some(self, rows: NDArray[np.int_]) -> Panels:
        """Some of them."""
        return Panels(**{item.name: getattr(self, item.name)[rows] for item in fields(self)})

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
        place, rate, (low, high) = s.copy(), np.ones_like(s), self.kinked.T
        after, before, between = low & ~high, high & ~low, low & high
        place[after], rate[after] = s[after] ** 2, 2.0 * s[after]
        place[before], rate[before] = 1.0 - (1.0 - s[before]) ** 2, 2.0 * (1.0 - s[before])
        place[between] = s[between] ** 2 * (3.0 - 2.0 * s[between])
        rate[between] = 6.0 * s[between] * (1.0 - s[between])
        span = (self.high - self.low)[:, None]
        return self.low[:, None] + span * place, span * width * rate


def panels_of_steps(cuts: Cuts, ends: Array, kinks: NDArray[np.bool_], turn: float, turned: Turned | None) -> Panels:
    """Panels that are steps; parts of them where a step is longer than a panel of even ones.

    A step is as long as its states allow, which may be turns where a table gives the speed and nothing else moves.

    Parameters
    ----------
    ends : of the steps, increasing, shape (steps,) [s]
    kinks : whether outputs have a kink there, shape (steps,)
    turn : time of a turn, infinite where nothing turns [s]
    turned : turns of a driver whose speed changes, until times; None where it does not change
    """
    panels, lengths = cut_at(whole_panels(cuts), cuts, ends, kinks), np.diff(cuts.times)
    longest = min(turn, float(np.sum(lengths[cuts.first :]))) / FEWEST
    places = panels.at(np.array([0.0, 0.5, 1.0]))[0] * lengths[panels.segment][:, None]
    parts = (places[:, 2] - places[:, 0]) / longest
    if turned is not None:
        times = cuts.times[panels.segment][:, None] + places
        # both halves: the driver may turn back within a step
        parts = np.maximum(parts, FEWEST * np.sum(np.abs(np.diff(turned(times), axis=1)), axis=1))
    return split(panels, np.maximum(np.ceil(parts * (1.0 - 1e-9)), 1).astype(int))


def whole_panels(cuts: Cuts) -> Panels:
    """A panel for each interval of the time that counts."""
    whole = np.arange(cuts.first, len(cuts.times) - 1)
    zeros, ones, none = np.zeros(len(whole)), np.ones(len(whole)), np.zeros((len(whole), 2), dtype=bool)
    return Panels(segment=whole, low=zeros, high=ones, kinked=none, begin=zeros, end=ones)


def cut_at(panels: Panels, cuts: Cuts, times: Array, kinks: NDArray[np.bool_] | None = None) -> Panels:
    """The same panels, cut at further times; those that are not near to one keep their bits.

    Parameters
    ----------
    times : shape (times,) [s]
    kinks : whether channels have a kink there, shape (times,).  Default: at all
    """
    if not len(times):
        return panels
    kinks = np.ones(len(times), dtype=bool) if kinks is None else kinks
    segment, fraction = cuts.find(times)
    inside = (segment >= cuts.first) & (fraction > APART) & (fraction < 1.0 - APART)
    lengths = np.diff(cuts.times)
    sides = np.zeros((len(lengths), 2), dtype=bool)  # whether a kink is at the low and at the high end
    for shift in (-1, 0, 1):  # one beside a cut is at the ends of both intervals that it parts
        k = np.clip(segment[kinks] + shift, 0, len(lengths) - 1)[:, None] + np.arange(2)
        np.logical_or.at(sides, k[:, 0], np.abs(times[kinks][:, None] - cuts.times[k]) <= APART * lengths[k[:, :1]])
    last, first = panels.end == 1.0, np.diff(panels.segment, prepend=-1) > 0
    ends = np.where(last, panels.high, panels.at(np.ones(1))[0][:, 0])
    low, high = (panels.kinked | sides[panels.segment] & np.stack([first, ends == 1.0], axis=1)).T
    return _spans(
        np.concatenate([panels.segment[first], panels.segment, segment[inside]]),
        np.concatenate([panels.low[first], ends, fraction[inside]]),
        np.concatenate([low[first], high & last, kinks[inside]]),
    )


def _spans(segment: NDArray[np.int_], ends: Array, at: NDArray[np.bool_]) -> Panels:
    """Panels between ends; those at a kink in two.

    Parameters
    ----------
    segment, ends : intervals and fractions of them, 0 and 1 of each among them, in any order
    at : whether a kink is there
    """
    order = np.lexsort((ends, segment))
    segment, ends, at = segment[order], ends[order], at[order]
    # those nearer to each other than APART are one, which is a kink if one of them is
    first = np.flatnonzero((np.diff(ends, prepend=-1.0) > APART) | (np.diff(segment, prepend=-1) > 0))
    segment, ends, at = segment[first], ends[first], np.logical_or.reduceat(at, first)
    kept = _apart_from_kinks(segment, ends, at)
    segment, ends, at = segment[kept], ends[kept], at[kept]
    low = np.flatnonzero(np.diff(segment) == 0)
    zeros, sides = np.zeros(len(low)), np.stack([at[low], at[low + 1]], axis=1)
    panels = Panels(segment=segment[low], low=ends[low], high=ends[low + 1], kinked=sides, begin=zeros, end=zeros + 1.0)
    return split(panels, np.where(np.any(sides, axis=1), 2, 1))


def _apart_from_kinks(segment: NDArray[np.int_], ends: Array, at: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Ends to keep, shape of `ends`.

    Steps end on kinks, and the last step before one may be much shorter than those before it.  A function that grows
    like the square root of time at the kink is then not smooth in the longer step beside it, and one span of both
    steps, over which s is taken, resolves it.
    """
    kept = np.ones(len(ends), dtype=bool)
    apart = np.diff(segment, prepend=-1, append=-1) != 0
    free = ~(at | apart[:-1] | apart[1:])  # neither a kink nor the end of an interval
    for way in (-1, 1):
        kink = np.flatnonzero(at)
        place = np.clip(kink + way, 0, len(ends) - 1)
        while len(place):
            kink, place = kink[free[place]], place[free[place]]
            near = np.abs(ends[place] - ends[kink]) < NEAR_KINK * np.abs(ends[place + way] - ends[place])
            kink, place = kink[near], place[near]
            kept[place] = False
            place = place + way
    return kept


def split(panels: Panels, parts: NDArray[np.int_]) -> Panels:
    """Each panel in so many equal parts."""
    if np.all(parts == 1):
        return panels  # itself
    of = np.repeat(np.arange(len(panels)), parts)
    each, parts, k = panels.some(of), parts[of], np.arange(len(of)) - np.repeat(np.cumsum(parts) - parts, parts)
    begin, width = each.begin, each.end - each.begin
    return replace(
        each, begin=begin + width * k / parts, end=np.where(k + 1 == parts, each.end, begin + width * (k + 1) / parts)
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


def parts_of_oscillation(panels: Panels, cuts: Cuts, frequency: float) -> NDArray[np.int_]:
    """Into how many parts each panel is to be split where a signal is multiplied with an oscillation, shape (panels,).

    Parameters
    ----------
    frequency : of the oscillation [Hz]
    """
    lengths = np.diff(panels.at(np.array([0.0, 1.0]))[0])[:, 0] * np.diff(cuts.times)[panels.segment]
    return np.maximum(np.ceil(lengths * (2.0 * np.pi * frequency / TURNING)), 1).astype(np.int_)


def interpolated(panels: Panels, cuts: Cuts, signals: Array) -> tuple[Array, NDArray[np.int_], Array]:
    """Times of places in each panel, both ends among them, the panels' indices, and signals there.

    Parameters
    ----------
    signals : at the nodes of the panels, smooth in each, shape (panels, 4, columns)

    Returns
    -------
    shapes (places,) [s], (places,) and (places, columns)
    """
    left, right = cuts.times[panels.segment], cuts.times[panels.segment + 1]
    times = left[:, None] + panels.at(BETWEEN)[0] * (right - left)[:, None]
    values = (_TO_BETWEEN @ signals).reshape(times.size, signals.shape[2])
    return times.ravel(), np.repeat(np.arange(len(panels)), len(BETWEEN)), values


def bounds(signals: Array) -> tuple[Array, Array]:
    """Least and largest values that signals may have at the places of `interpolated`, shape (panels, columns) each.

    Parameters
    ----------
    signals : at the nodes of the panels, shape (panels, 4, columns)
    """
    # in pairs: a reduction over so few is several times slower
    low = np.minimum(signals[:, :2], signals[:, 2:])
    high = np.maximum(signals[:, :2], signals[:, 2:])
    low, high = np.minimum(low[:, 0], low[:, 1]), np.maximum(high[:, 0], high[:, 1])
    beyond = _BEYOND * (high - low)
    return low - beyond, high + beyond


def nodes_of(panels: Panels, cuts: Cuts) -> Nodes:
    """Nodes of Gauss's rule in each panel, and both sides of each cut, in order of time."""
    part, rate = panels.at(GAUSS)
    whole = np.arange(cuts.first, len(cuts.times) - 1)
    count = len(GAUSS) * len(panels) + 2 * len(whole)
    segment, fraction, share = np.empty(count, dtype=np.int_), np.empty(count), np.zeros(count)
    inner = inner_nodes(panels)
    segment[inner], fraction[inner], share[inner] = panels.segment[:, None], part, WEIGHTS * rate
    for side in (0.0, 1.0):
        ends = np.searchsorted(panels.segment, whole, side="right" if side else "left") * len(GAUSS)
        ends += 2 * np.arange(len(whole)) + int(side)
        segment[ends], fraction[ends] = whole, side
    return place(cuts, segment, fraction, share)


def inner_nodes(panels: Panels) -> NDArray[np.int_]:
    """Places of the nodes of Gauss's rule in a plan of panels, shape (panels, 4)."""
    sides = 2 * (panels.segment - panels.segment[:1]) + 1
    return (len(GAUSS) * np.arange(len(panels)) + sides)[:, None] + np.arange(len(GAUSS))


def same_panels(panels: Panels, known: Panels) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Panels that are among others of the same intervals, to the bit: their places in both."""
    place = [one.segment + one.at(np.zeros(1))[0][:, 0] for one in (panels, known)]
    at = np.minimum(np.searchsorted(place[1], place[0]), len(known) - 1)
    same = np.all(panels.kinked == known.kinked[at], axis=1)
    for name in ("segment", "low", "high", "begin", "end"):
        same &= getattr(panels, name) == getattr(known, name)[at]
    return np.flatnonzero(same), at[same]
