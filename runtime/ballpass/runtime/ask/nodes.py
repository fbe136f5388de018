"""Where a run is looked at: points at fixed fractions of its segments, which move with the parameters.

In: a model, numbers, the length of a run.  Out: `Edges` with their derivatives, a `Plan` of nodes, and `Nodes`, the
plan put onto the edges.

A load switches at an edge, and outputs may jump there; speed and windows move the edges.  Nodes that keep their
fraction of a segment never cross one, so that whatever is summed over nodes is a smooth function of the parameters:
integrals by Gauss's rule on panels within the segments (`panels.py`), values at both sides of each edge for extremes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.run import inputs as clock
from ballpass.runtime.run.segments import segment_edges

Array = NDArray[np.float64]

#: Derivative of a parameter or derived constant along the directions, shape (directions,).
Slopes = Callable[[str], Array]


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """Time that counts: all of a run behind its transient.

    Attributes
    ----------
    duration : of the run [s]
    start : end of the transient [s]
    turn : time of a turn, infinite when nothing turns [s]
    cycles : turns of the run; None where its duration is given in seconds
    transient : turns of the transient
    """

    duration: float
    start: float
    turn: float
    cycles: float | None
    transient: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Edges:
    """Ends of the segments of a run.

    Attributes
    ----------
    times : begin, breakpoints, whole turns, end of the transient, end; shape (edges,) [s]
    slopes : their derivatives along the directions, shape (edges, directions) [s/unit]
    first : index of the edge at which the time that counts begins
    window : the time that counts
    kinks : indices of edges that are kinks of outputs, or passages of windows' edges, within a segment of the driver
    """

    times: Array
    slopes: Array
    first: int
    window: Window
    kinks: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plan:
    """Nodes as fractions of segments: a plan made for one set of parameters holds for its neighbours.

    Attributes
    ----------
    segment : segment of each node, shape (nodes,)
    fraction : place within it, 0 and 1 being its sides of the edges, shape (nodes,)
    weight : share of the segment's length that counts in integrals, shape (nodes,)
    segments : number of segments it was made for
    """

    segment: NDArray[np.int_]
    fraction: Array
    weight: Array
    segments: int

    def __len__(self) -> int:
        return len(self.segment)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Nodes:
    """Nodes in time.

    Attributes
    ----------
    t : shape (nodes,) [s]
    weight : weights of integrals over time, shape (nodes,) [s]
    segment : the segment whose inputs hold, shape (nodes,)
    slope, weight_slope : derivatives of both along the directions, shape (nodes, directions)
    """

    t: Array
    weight: Array
    segment: NDArray[np.int_]
    slope: Array
    weight_slope: Array

    def __len__(self) -> int:
        return len(self.t)


def make_edges(
    model: LoadedModel, numbers: Numbers, window: Window, slopes: Slopes | None = None, directions: int = 0
) -> Edges:
    """Edges of a run and their derivatives along `directions`.

    Raises
    ------
    RequestError
        Several loads switch at one time, each of which could move on its own.
    """
    manifest, values = model.manifest, numbers.values
    turn, near = window.turn, 1e-9 * min(window.turn, window.duration)
    times = segment_edges(model, numbers, 0.0, window.duration, turn)
    if window.start > 0.0 and np.min(np.abs(times - window.start)) > near:
        times = np.sort(np.append(times, window.start))
    first = int(np.argmin(np.abs(times - window.start)))
    columns = np.zeros((len(times), directions))
    if slopes is not None:
        turning = turn_slope(model, numbers, slopes)
        for k, time in enumerate(times[1:-1].tolist(), start=1):
            moved = clock.breakpoint_derivative(manifest.inputs, values, time)
            if moved and k != first:
                columns[k] = sum(slope * slopes(name) for name, slope in moved)
            elif math.isfinite(turn):
                columns[k] = time / turn * turning
        if window.cycles is not None:
            columns[-1] = window.cycles * turning
    return Edges(times=times, slopes=columns, first=first, window=window)


def with_kinks(edges: Edges, kinks: Sequence[float], times: Array, own: Array) -> Edges:
    """Edges with further ones, in order: kinks, that keep their place between the edges, and `times`, that move.

    Nothing jumps at a kink, so that any motion of it is right; this one spares turns that get longer from being cut.

    Parameters
    ----------
    own : derivatives of `times` along the directions, shape (times, directions) [s/unit]
    """
    if not len(kinks) + len(times):
        return edges
    times = np.concatenate([kinks, times])
    every = np.concatenate([edges.times, times])
    segment = np.searchsorted(edges.times, times) - 1
    part = ((times - edges.times[segment]) / np.diff(edges.times)[segment])[:, None]
    between = edges.slopes[segment] + part * (edges.slopes[segment + 1] - edges.slopes[segment])
    slopes = np.concatenate([edges.slopes, between[: len(kinks)], own])
    order = np.argsort(every, kind="stable")
    places = np.flatnonzero(order >= len(edges.times))
    return Edges(
        times=every[order],
        slopes=slopes[order],
        first=int(np.flatnonzero(order == edges.first)[0]),
        window=edges.window,
        kinks=tuple(places.tolist()),
    )


def turn_slope(model: LoadedModel, numbers: Numbers, slopes: Slopes) -> Array:
    """Derivative of the time of a turn, shape (directions,) [s/unit]; zero when nothing turns."""
    manifest = model.manifest
    speed = clock.shaft_speed(manifest, numbers.values)
    name = clock.speed_name(manifest)
    if name is None or speed == 0.0:
        return np.zeros(0) if name is None else 0.0 * slopes(name)
    return np.asarray(-clock.period(manifest, numbers.values) / speed * slopes(name))


def with_points(plan: Plan, points: Sequence[tuple[int, float]]) -> Plan:
    """A plan with further nodes (segment, fraction) that carry no weight, in order of time."""
    if not points:
        return plan
    segment = np.concatenate([plan.segment, [point[0] for point in points]]).astype(np.int_)
    fraction = np.concatenate([plan.fraction, [point[1] for point in points]])
    weight = np.concatenate([plan.weight, np.zeros(len(points))])
    order = np.lexsort((fraction, segment))
    return Plan(segment=segment[order], fraction=fraction[order], weight=weight[order], segments=plan.segments)


def place(plan: Plan, edges: Edges) -> Nodes:
    """A plan put onto edges.

    Raises
    ------
    RequestError
        The edges are not in the order that the plan was made for: a load has come to switch before another.
    """
    if len(edges.times) - 1 != plan.segments:
        raise RequestError(
            f"The run has {len(edges.times) - 1} segments between breakpoints, and {plan.segments} were expected: with "
            "these parameters the loads switch in another order. Sensitivities need a neighbourhood without that."
        )
    left, right = edges.times[plan.segment], edges.times[plan.segment + 1]
    left_slope, right_slope = edges.slopes[plan.segment], edges.slopes[plan.segment + 1]
    inner = plan.fraction[:, None]
    t = np.where(plan.fraction == 1.0, right, left + plan.fraction * (right - left))
    return Nodes(
        t=t,
        weight=plan.weight * (right - left),
        segment=plan.segment,
        slope=left_slope + inner * (right_slope - left_slope),
        weight_slope=plan.weight[:, None] * (right_slope - left_slope),
    )


def find(edges: Edges, time: float) -> tuple[int, float]:
    """Segment and fraction of a time; an edge belongs to what follows."""
    last = len(edges.times) - 2
    k = min(max(int(np.searchsorted(edges.times, time, side="right")) - 1, 0), last)
    left, right = float(edges.times[k]), float(edges.times[k + 1])
    return k, min(max((time - left) / (right - left), 0.0), 1.0)
