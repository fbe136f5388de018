"""Extremes of a channel between the nodes of a run, found from the run itself.

In: a track, a channel.  Out: `Extreme`: segment, fraction, value.

Around the best nodes the model is integrated once more from the node before, on grids that get finer until a parabola
through three points is exact to rounding.  Where two balls change rank, which is where the most loaded ball carries
least, the two straight lines through the points are intersected instead.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.ask.track import Stepping, Track
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.stepper import End, Segments
from ballpass.runtime.run import inputs as clock
from ballpass.runtime.run.reduced_run import RunFailed

Array = NDArray[np.float64]

#: Points of a grid, and how often it is refined: 1e-4 of a turn becomes 1e-8 of it.
GRID, ROUNDS = 65, 2

#: Nodes that are looked at closely: the best that no neighbour exceeds.  Where the most loaded ball carries least the
#: channel has a sharp corner, and nodes tell less about its depth.
CANDIDATES, CORNERS = 5, 24


@dataclass(frozen=True, slots=True, kw_only=True)
class Extreme:
    """Largest or smallest value of a channel.

    Attributes
    ----------
    value : in the channel's unit
    time : [s]
    segment, fraction : where it lies
    column : ball, counted from 0
    other : ball that changes rank with it there, else None
    rate, other_rate : time derivatives of both where there is another [channel's unit / s]
    runner_up : relative distance to the best elsewhere; infinite where there is none
    """

    value: float
    time: float
    segment: int
    fraction: float
    column: int
    other: int | None = None
    rate: float = 0.0
    other_rate: float = 0.0
    runner_up: float = math.inf


def find_extreme(
    model: LoadedModel,
    numbers: Numbers,
    track: Track,
    values: Array,
    channel: str,
    *,
    sign: float,
    ball: int | None,
    stepping: Stepping,
) -> Extreme:
    """Largest (`sign` 1) or smallest (-1) value of a channel over the nodes of a track and between them.

    Parameters
    ----------
    values : the channel along the track, shape (nodes, columns)
    ball : column to look at; None for the most loaded ball at each moment
    """
    nodes, edges = track.nodes, track.edges
    shown = values[:, [ball]] if ball is not None else values
    height = sign * np.max(shown, axis=1)
    best: list[Extreme] = []
    count = CORNERS if sign < 0.0 and shown.shape[1] > 1 else CANDIDATES
    for k in _tops(height, nodes.segment, count):
        segment = int(nodes.segment[k])
        low = k - 1 if k > 0 and nodes.segment[k - 1] == segment else k
        high = k + 1 if k + 1 < len(nodes) and nodes.segment[k + 1] == segment else k
        if nodes.t[high] <= nodes.t[low]:
            low, high = min(low, k - 1 if k else k), max(high, k)
        best.append(_closely(model, numbers, track, channel, sign, ball, stepping, (low, high)))
    best.sort(key=lambda item: -sign * item.value)
    first = best[0]
    span = max(abs(first.value), 1e-300)
    apart = [item for item in best[1:] if abs(item.time - first.time) > 1e-9 * edges.window.duration]
    gap = min((abs(item.value - first.value) / span for item in apart), default=math.inf)
    return replace(first, runner_up=gap)


def _tops(height: Array, segment: NDArray[np.int_], count: int) -> list[int]:
    """The `count` largest nodes that no neighbour in the same segment exceeds, largest first."""
    before = np.concatenate([[-np.inf], np.where(np.diff(segment) == 0, height[:-1], -np.inf)])
    behind = np.concatenate([np.where(np.diff(segment) == 0, height[1:], -np.inf), [-np.inf]])
    tops = np.flatnonzero((height >= before) & (height >= behind))
    order = np.argsort(-height[tops], kind="stable")[:count]
    return [int(k) for k in tops[order]]


def _closely(
    model: LoadedModel,
    numbers: Numbers,
    track: Track,
    channel: str,
    sign: float,
    ball: int | None,
    stepping: Stepping,
    between: tuple[int, int],
) -> Extreme:
    """Extreme between two nodes of one segment."""
    nodes, edges = track.nodes, track.edges
    segment = int(nodes.segment[between[0]])
    left, right = float(edges.times[segment]), float(edges.times[segment + 1])
    begin, end = float(nodes.t[between[0]]), float(nodes.t[between[1]])
    x, low, high = track.x[between[0]], begin, end
    column = ball
    for turn in range(ROUNDS):
        times = np.linspace(low, high, GRID)
        found = _values(model, numbers, x, begin, times, (left, right), channel, stepping)
        height = sign * (found[:, ball] if ball is not None else np.max(found, axis=1))
        k = int(np.argmax(height))
        if turn < ROUNDS - 1:
            low, high = float(times[max(k - 1, 0)]), float(times[min(k + 1, GRID - 1)])
    if column is None:
        column = int(np.argmax(found[k]))
    result = Extreme(
        value=float(found[k, column]),
        time=float(times[k]),
        segment=segment,
        fraction=(float(times[k]) - left) / (right - left),
        column=column,
    )
    if k in (0, GRID - 1):
        # at an edge of the segment, or where the neighbour's bracket goes on: the node itself
        exact = 0.0 if times[k] <= left else 1.0 if times[k] >= right else result.fraction
        return replace(result, fraction=exact)
    step = float(times[1] - times[0])
    around = np.argmax(found[k - 1 : k + 2], axis=1) if ball is None else np.full(3, ball)
    if around[0] != around[2]:
        return _crossing(found, times, k, (int(around[0]), int(around[2])), result, (left, right))
    low_, mid, high_ = (float(value) for value in found[k - 1 : k + 2, column])
    bend = low_ - 2.0 * mid + high_
    if bend == 0.0:
        return result
    shift = 0.5 * (low_ - high_) / bend
    if abs(shift) > 1.0:
        return result
    time = result.time + shift * step
    return replace(
        result,
        value=mid + 0.25 * (high_ - low_) * shift,
        time=time,
        fraction=(time - left) / (right - left),
    )


def _crossing(
    found: Array, times: Array, k: int, pair: tuple[int, int], result: Extreme, ends: tuple[float, float]
) -> Extreme:
    """Where the most loaded ball changes from one to another: lines through the neighbours, intersected."""
    step = float(times[1] - times[0])
    a, b = pair
    first, last = found[k - 1], found[k + 1]
    rate_a, rate_b = ((float(last[j]) - float(first[j])) / (2.0 * step) for j in (a, b))
    middle = found[k]
    if rate_a == rate_b:
        return result
    shift = -float(middle[a] - middle[b]) / (rate_a - rate_b)
    if abs(shift) > step:
        return result
    time = float(times[k]) + shift
    return replace(
        result,
        value=float(middle[a]) + rate_a * shift,
        time=time,
        fraction=(time - ends[0]) / (ends[1] - ends[0]),
        column=a,
        other=b,
        rate=rate_a,
        other_rate=rate_b,
    )


def _values(
    model: LoadedModel,
    numbers: Numbers,
    x: Array,
    begin: float,
    times: Array,
    ends: tuple[float, float],
    channel: str,
    stepping: Stepping,
) -> Array:
    """A channel at times within one segment, from the state `x` at `begin`; shape (times, columns)."""
    inputs = model.manifest.inputs
    u = clock.inputs_at(inputs, numbers.values, begin, 0.5 * (ends[0] + ends[1]))
    states = np.empty((len(times), len(x)))
    if len(x) and times[-1] > begin:
        outcome = model.stepper.run(
            family=stepping.family,
            tolerance=stepping.rtol * stepping.magnitude,
            p=numbers.p,
            c=numbers.c,
            x=x.copy(),
            segments=Segments(
                times=np.array([begin, times[-1]]), inputs=np.ascontiguousarray(u[None, :]), restarts=np.array([True])
            ),
            output_times=times,
            output_states=states,
            largest_step=stepping.largest_step,
        )
        if outcome.end is not End.DONE:
            raise RunFailed(outcome.end, outcome.time, outcome.step)
    else:
        states[:] = x
    if channel in model.states:
        return states[:, [model.states.index(channel)]]
    loop = model.loop("outputs", ("t", "x", "u"))
    given = {
        "t": times - begin,
        "x": states,
        "u": np.repeat(u[None, :], len(times), axis=0),
        "p": numbers.p,
        "c": numbers.c,
    }
    names = [info.name for info in model.manifest.outputs]
    return np.asarray(list(loop(len(times), given).values())[names.index(channel)])
