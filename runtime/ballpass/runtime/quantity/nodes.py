"""Nodes at which a run is evaluated: at fixed fractions of its segments, which move with the parameters.

In: a run.  Out: `Edges` with their derivatives, a `NodePlan`, and `Nodes`, the plan put onto the edges.

A load switches at an edge, and outputs may jump there; speed and windows move the edges.  Nodes that keep their
fraction of a segment never cross one, so that sums over nodes are smooth functions of the parameters:
integrals by Gauss's rule on panels within the segments (`panels.py`), values at both sides of each edge for extremes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.native.stepper import Segments
from ballpass.runtime.request.resolve import Run
from ballpass.runtime.run.directions import Chain
from ballpass.runtime.time import timeline

Array = NDArray[np.float64]

#: The resolution of cuts: times nearer to each other than this share of an interval, or of the run, are one [1].
APART = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Edges:
    """Ends of the intervals of a run within which nodes keep their place.

    Attributes
    ----------
    times : ends of the driver's segments, and passages of windows' edges between them; shape (edges,) [s]
    slopes : their derivatives along the directions, shape (edges, directions) [s/unit]
    segment : of the driver, of each interval, shape (edges - 1,)
    first : index of the edge at which the time that counts begins
    """

    times: Array
    slopes: Array
    segment: NDArray[np.int_]
    first: int

    @property
    def length(self) -> float:
        """Of the run [s]."""
        return float(self.times[-1] - self.times[0])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NodePlan:
    """Nodes as fractions of segments: a plan made for one set of parameters holds for its neighbours.

    Attributes
    ----------
    segment : interval of each node, shape (nodes,)
    fraction : place within it, 0 and 1 being its sides of the edges, shape (nodes,)
    weight : share of the interval's length that counts in integrals, shape (nodes,)
    """

    segment: NDArray[np.int_]
    fraction: Array
    weight: Array

    def __len__(self) -> int:
        return len(self.segment)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Nodes:
    """Nodes in time.

    Attributes
    ----------
    t : shape (nodes,) [s]
    weight : weights of integrals over time, shape (nodes,) [s]
    segment, fraction : interval between edges, and place within it, shape (nodes,)
    held : segment of the driver whose inputs hold, shape (nodes,)
    slope, weight_slope : derivatives of both along the directions, shape (nodes, directions)
    """

    t: Array
    weight: Array
    segment: NDArray[np.int_]
    fraction: Array
    held: NDArray[np.int_]
    slope: Array
    weight_slope: Array

    def __len__(self) -> int:
        return len(self.t)


def make_edges(run: Run, segments: Segments, chain: Chain | None) -> Edges:
    """Edges of a run and their derivatives along the directions of a chain.

    Parameters
    ----------
    segments : all of the run

    Raises
    ------
    RequestError
        Several loads switch at one time, and a parameter moves one of them away from another.
    """
    times, near = segments.times, APART * min(run.stretch, run.duration)
    first = int(np.argmin(np.abs(times - run.start)))
    columns = np.zeros((len(times), 0 if chain is None else len(chain.names)))
    if chain is not None:
        even = timeline.is_even(run.model.manifest, run.numbers.values) and math.isfinite(run.stretch)
        for k, time in enumerate(times[1:-1].tolist(), start=1):
            moved, counts = chain.breakpoint(time), abs(time - run.start) <= near
            if moved is not None and not counts:
                columns[k] = moved
            elif counts or even:
                columns[k] = chain.after(time)
        if run.span.asked is not None:
            columns[-1] = chain.after(run.end, run.begin)
    return Edges(times=times, slopes=columns, segment=np.arange(len(times) - 1), first=first)


def with_passages(edges: Edges, times: Array, slopes: Array) -> Edges:
    """Edges with further ones that move, in order.

    Parameters
    ----------
    slopes : derivatives of `times` along the directions, shape (times, directions) [s/unit]
    """
    every = np.concatenate([edges.times, times])
    inside = edges.segment[np.searchsorted(edges.times, times) - 1]
    order = np.argsort(every, kind="stable")
    segment = np.concatenate([edges.segment, [-1], inside])[order][:-1]
    return Edges(
        times=every[order],
        slopes=np.concatenate([edges.slopes, slopes])[order],
        segment=segment,
        first=int(np.flatnonzero(order == edges.first)[0]),
    )


def no_nodes() -> NodePlan:
    """A plan without nodes."""
    return NodePlan(segment=np.zeros(0, dtype=np.int_), fraction=np.zeros(0), weight=np.zeros(0))


def with_points(plan: NodePlan, points: Sequence[tuple[int, float]]) -> NodePlan:
    """A plan with further nodes (segment, fraction) that carry no weight, in order of time."""
    if not points:
        return plan
    segment = np.concatenate([plan.segment, [point[0] for point in points]]).astype(np.int_)
    fraction = np.concatenate([plan.fraction, [point[1] for point in points]])
    weight = np.concatenate([plan.weight, np.zeros(len(points))])
    return ordered_plan(segment, fraction, weight)


def ordered_plan(segment: NDArray[np.int_], fraction: Array, weight: Array) -> NodePlan:
    """A plan with these nodes in order of time."""
    order = np.lexsort((fraction, segment))
    return NodePlan(segment=segment[order], fraction=fraction[order], weight=weight[order])


def place(plan: NodePlan, edges: Edges) -> Nodes:
    """A plan put onto edges."""
    left, right = edges.times[plan.segment], edges.times[plan.segment + 1]
    left_slope, right_slope = edges.slopes[plan.segment], edges.slopes[plan.segment + 1]
    inner = plan.fraction[:, None]
    t = np.where(plan.fraction == 1.0, right, left + plan.fraction * (right - left))
    return Nodes(
        t=t,
        weight=plan.weight * (right - left),
        segment=plan.segment,
        fraction=plan.fraction,
        held=edges.segment[plan.segment],
        slope=left_slope + inner * (right_slope - left_slope),
        weight_slope=plan.weight[:, None] * (right_slope - left_slope),
    )


def fixed_nodes(t: Array, segment: NDArray[np.int_], held: NDArray[np.int_], directions: int = 0) -> Nodes:
    """Nodes at fixed times, without weight: for values there."""
    zeros, still = np.zeros(len(t)), np.zeros((len(t), directions))
    return Nodes(t=t, weight=zeros, segment=segment, fraction=zeros, held=held, slope=still, weight_slope=still)


def joined_nodes(parts: Sequence[Nodes]) -> Nodes:
    """Nodes of several plans, one behind the other."""
    return Nodes(**{item.name: np.concatenate([getattr(part, item.name) for part in parts]) for item in fields(Nodes)})


def part_of_nodes(nodes: Nodes, part: slice | NDArray[np.int_]) -> Nodes:
    """Some of the nodes."""
    return Nodes(**{item.name: getattr(nodes, item.name)[part] for item in fields(Nodes)})


def find(edges: Edges, time: float) -> tuple[int, float]:
    """Interval and fraction of a time; an edge belongs to the interval after it."""
    last = len(edges.times) - 2
    k = min(max(int(np.searchsorted(edges.times, time, side="right")) - 1, 0), last)
    left, right = float(edges.times[k]), float(edges.times[k + 1])
    return k, min(max((time - left) / (right - left), 0.0), 1.0)
