"""Extremes of channels along a run, found between its nodes.

In: nodes, channels along them, and the times of the extremes in the driver's reductions.  Out: a `Mark` for each, of
equal ones the first.

Around the best nodes, and around the moment of the reductions, the run is evaluated again on finer and finer grids,
until a parabola through three points is exact to rounding.  Where two balls carry the same load, the largest ball force
has its minimum in a corner: there the two straight lines through the points are intersected instead.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.quantity.nodes import APART, Cuts, Nodes, fixed_nodes
from ballpass.runtime.quantity.records import Mark
from ballpass.runtime.quantity.track import Signal

Array = NDArray[np.float64]

#: Points of a grid, and how often it is refined: 1e-4 of a turn becomes 1e-8 of it.
GRID, ROUNDS = 65, 2

#: Most that a smooth extreme lies beyond the best point of its grid, over the range of values there [1].
SMOOTH = 1e-2

#: Most nodes to refine around: the best that no neighbour exceeds.  Then the first of those that are lower by less than
#: this share of the range of values, which an equal extreme between nodes may be.
CANDIDATES, FIRST, LOWER = 5, 64, 1e-2


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """A requested extreme.

    Attributes
    ----------
    channel : state or output
    ball : its column; None for the most loaded ball at each moment
    sign : 1 for the largest value, -1 for the smallest
    seen : its time in the reductions [s]; None where they do not hold it
    exact : whether that is the moment itself
    """

    channel: str
    ball: int | None
    sign: float
    seen: float | None
    exact: bool = False


@dataclass(slots=True, kw_only=True, eq=False)
class _Bracket:
    """An interval within one segment that holds an extreme, and its last grid."""

    wanted: Wanted
    segment: int
    low: float
    high: float
    times: Array
    values: Array


def find_extremes(
    wanted: Sequence[Wanted],
    cuts: Cuts,
    nodes: Nodes,
    signals: Mapping[str, Signal],
    look: Callable[[Nodes], Mapping[str, Signal]],
    equal: float,
) -> list[list[Mark]]:
    """Largest or smallest values over nodes of a run and between them, and the next ones elsewhere.

    Parameters
    ----------
    signals : the channels along the nodes
    look : function that gives the channels of the same run along other nodes
    equal : extremes that differ by less are equal, relative to the largest size of the channel [1]
    """
    brackets = [[] if item.exact else _brackets(item, cuts, nodes, signals[item.channel].value) for item in wanted]
    every = [bracket for some in brackets for bracket in some]
    for _ in range(ROUNDS if every else 0):
        for bracket in every:
            bracket.times = np.linspace(bracket.low, bracket.high, GRID)
        times = np.concatenate([bracket.times for bracket in every])
        segment = np.repeat([bracket.segment for bracket in every], GRID)
        seen = look(fixed_nodes(times, segment, cuts.segment[segment]))
        for k, bracket in enumerate(every):
            bracket.values = seen[bracket.wanted.channel].value[k * GRID : (k + 1) * GRID]
            best = _top(_height(bracket))
            bracket.low, bracket.high = bracket.times[max(best - 1, 0)], bracket.times[min(best + 1, GRID - 1)]
    return [
        _ranked(
            item,
            [_extreme(bracket, cuts) for bracket in some],
            cuts,
            equal * float(np.max(np.abs(signals[item.channel].value))),
        )
        if some
        else _seen(item, cuts, nodes, signals[item.channel].value)
        for item, some in zip(wanted, brackets, strict=True)
    ]


def _seen(wanted: Wanted, cuts: Cuts, nodes: Nodes, values: Array) -> list[Mark]:
    """The moment of the reductions, and the best nodes elsewhere without refinement, as competing extremes."""
    assert wanted.seen is not None  # it is exact
    height = wanted.sign * np.max(values, axis=1)
    found = [_at_node(nodes, values, int(k)) for k in _tops(nodes, height)[:CANDIDATES]]
    k = int(np.argmin(np.abs(nodes.t - wanted.seen)))
    place = cuts.find(np.array(wanted.seen))
    segment, fraction = int(place[0]), float(place[1])
    near = APART * cuts.length / float(cuts.times[segment + 1] - cuts.times[segment])
    fraction = 0.0 if fraction < near else 1.0 if 1.0 - fraction < near else fraction
    best = replace(_at_node(nodes, values, k), time=wanted.seen, segment=segment, fraction=fraction)
    apart = 4.0 * cuts.length / len(nodes)
    return [best, *(item for item in found if abs(item.time - best.time) > apart)]


def _at_node(nodes: Nodes, values: Array, k: int) -> Mark:
    column = int(np.argmax(values[k]))
    return Mark(
        value=float(values[k, column]),
        time=float(nodes.t[k]),
        segment=int(nodes.segment[k]),
        fraction=float(nodes.fraction[k]),
        ball=column,
    )


def _tops(nodes: Nodes, height: Array) -> NDArray[np.int_]:
    """Nodes that no neighbour in the same interval exceeds, the best first."""
    same = np.diff(nodes.segment) == 0
    before = np.concatenate([[-np.inf], np.where(same, height[:-1], -np.inf)])
    behind = np.concatenate([np.where(same, height[1:], -np.inf), [-np.inf]])
    tops = np.flatnonzero((height > before) & (height >= behind))
    return tops[np.argsort(-height[tops], kind="stable")]


def _brackets(wanted: Wanted, cuts: Cuts, nodes: Nodes, values: Array) -> list[_Bracket]:
    """Times around the best nodes that no neighbour in the same segment exceeds, and around that of the reductions."""
    height = wanted.sign * (values[:, wanted.ball] if wanted.ball is not None else np.max(values, axis=1))
    same, ranked = np.diff(nodes.segment) == 0, _tops(nodes, height)
    near = np.sort(ranked[np.max(height) - height[ranked] <= LOWER * np.ptp(height)])[:FIRST]
    found = []
    for k in dict.fromkeys([_top(height), *ranked[:CANDIDATES].tolist(), *near.tolist()]):
        low, high = (k - 1 if k and same[k - 1] else k), (k + 1 if k < len(same) and same[k] else k)
        found.append((int(nodes.segment[k]), float(nodes.t[low]), float(nodes.t[high])))
    if wanted.seen is not None:
        segment = int(cuts.find(np.array(wanted.seen))[0])
        left, right = float(cuts.times[segment]), float(cuts.times[segment + 1])
        k = int(np.clip(np.searchsorted(nodes.t, wanted.seen), 1, len(nodes.t) - 1))
        reach = min(float(nodes.t[k] - nodes.t[k - 1]), wanted.seen - left, right - wanted.seen)
        # the moment itself is a point of the grid, or the end of the segment that it lies at
        if reach > 0.0:
            found.append((segment, wanted.seen - reach, wanted.seen + reach))
    empty = np.zeros(0)
    return [_Bracket(wanted=wanted, segment=s, low=a, high=b, times=empty, values=empty) for s, a, b in found]


def _height(bracket: _Bracket) -> Array:
    values, ball = bracket.values, bracket.wanted.ball
    return np.asarray(bracket.wanted.sign * (values[:, ball] if ball is not None else np.max(values, axis=1)))


def _top(height: Array) -> int:
    """Place of the largest; of a plateau, as where no ball is loaded, its middle: beside it values are larger."""
    equal = np.flatnonzero(height == np.max(height))
    return int(equal[len(equal) // 2])


def _extreme(bracket: _Bracket, cuts: Cuts) -> Mark:
    """Extreme on the last grid of a bracket, by the parabola through its best point and both neighbours."""
    found, times, ball = bracket.values, bracket.times, bracket.wanted.ball
    left, right = float(cuts.times[bracket.segment]), float(cuts.times[bracket.segment + 1])
    k = _top(_height(bracket))
    column = ball if ball is not None else int(np.argmax(found[k]))

    def at(time: float, value: float) -> Mark:
        fraction = 0.0 if time <= left else 1.0 if time >= right else (time - left) / (right - left)
        return Mark(value=value, time=time, segment=bracket.segment, fraction=fraction, ball=column)

    result = at(float(times[k]), float(found[k, column]))
    if k in (0, GRID - 1):
        return result  # at an edge of the segment, or where the neighbour's bracket continues
    step = float(times[1] - times[0])
    around = np.argmax(found[k - 1 : k + 2], axis=1)
    if ball is None and around[0] != around[2]:
        return _crossing(bracket, k, (int(around[0]), int(around[2])), at, result)
    low, mid, high = (float(value) for value in found[k - 1 : k + 2, column])
    bend = low - 2.0 * mid + high
    shift = 0.5 * (low - high) / bend if bend != 0.0 else math.inf
    higher = 0.25 * (high - low) * shift
    # a parabola within the whole grid rises by 1/4096 of it there; across a jump it would by an eighth
    smooth = abs(shift) <= 1.0 and abs(higher) <= SMOOTH * float(np.ptp(found[:, column]))
    return at(result.time + shift * step, mid + higher) if smooth else result


def _crossing(
    bracket: _Bracket, k: int, pair: tuple[int, int], at: Callable[[float, float], Mark], result: Mark
) -> Mark:
    """Where the most loaded ball changes from one to another: lines through the neighbours, intersected."""
    found, times = bracket.values, bracket.times
    step = float(times[1] - times[0])
    a, b = pair
    rate_a, rate_b = ((float(found[k + 1, j]) - float(found[k - 1, j])) / (2.0 * step) for j in pair)
    shift = -float(found[k, a] - found[k, b]) / (rate_a - rate_b) if rate_a != rate_b else math.inf
    if abs(shift) > step:
        return result
    crossing = at(float(times[k]) + shift, float(found[k, a]) + rate_a * shift)
    return replace(crossing, ball=a, other=b, rate=rate_a, other_rate=rate_b)


def _ranked(wanted: Wanted, found: list[Mark], cuts: Cuts, equal: float) -> list[Mark]:
    """The best of several, of equal ones the first, and the next ones elsewhere."""
    found.sort(key=lambda item: -wanted.sign * item.value)
    first = min((item for item in found if abs(item.value - found[0].value) <= equal), key=lambda item: item.time)
    others = (item for item in found[: CANDIDATES + 1] if abs(item.time - first.time) > APART * cuts.length)
    return [first, *others]
