"""Cuts of a run, and the nodes between them at which it is evaluated.

In: a run.  Out: `Cuts`, and `Nodes` at fixed fractions of the intervals between cuts, which move with the parameters.

A load switches at a cut, and outputs may jump there; speed and windows move the cuts.  Nodes that keep their
fraction of an interval never cross one, so that sums over nodes are smooth functions of the parameters:
integrals by Gauss's rule on panels within the intervals (`panels.py`), values at both sides of each cut for extremes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.native.stepper import Segments
from ballpass.runtime.request.resolve import Run

Array = NDArray[np.float64]

#: The resolution of cuts: times nearer to each other than this share of an interval, or of the run, are one [1].
APART = 1e-9


class Cause(IntEnum):
    """Why panels of a quantity end at a time.

    Nodes are on both sides of the first three, and move with them; a channel is continuous across the others.
    """

    SCHEDULE = 0  # known before the run: row of a table, edge of a window, whole turn, begin and end of what counts
    WINDOW = 1  # the motion passes the edge of a window, or a ball that of a spall
    JUMP = 2  # an angle comes back by a turn
    KINK = 3  # a contact or stop begins or ends, or a law has a corner
    RANK = 4  # another ball becomes the most loaded one


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cuts:
    """Cuts of a run that move with the parameters, in order.

    Attributes
    ----------
    times : shape (cuts,) [s]
    cause : a `Cause` each, shape (cuts,)
    angle : which of the angles of its cause passes there, shape (cuts,)
    slopes : derivatives of `times` along the directions, shape (cuts, directions) [s/unit]
    segment : of the driver, of each interval between two, shape (cuts - 1,)
    first : index of the cut at which the time that counts begins
    """

    times: Array
    cause: NDArray[np.int_]
    angle: NDArray[np.int_]
    slopes: Array
    segment: NDArray[np.int_]
    first: int

    @property
    def length(self) -> float:
        """Of the run [s]."""
        return float(self.times[-1] - self.times[0])

    def find(self, times: Array) -> tuple[NDArray[np.int_], Array]:
        """Intervals of times, and fractions of them; a cut belongs to the interval after it."""
        k = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2)
        left, right = self.times[k], self.times[k + 1]
        return k, np.clip((times - left) / (right - left), 0.0, 1.0)

    def more(self, times: Array, cause: Cause, angle: NDArray[np.int_]) -> Cuts:
        """The same with further ones of one cause, whose derivatives are not known."""
        order = np.argsort(np.concatenate([self.times, times]), kind="stable")
        inside = self.segment[np.searchsorted(self.times, times) - 1]
        more = {"times": times, "cause": np.full(len(times), cause), "angle": angle}
        joined = {name: np.concatenate([getattr(self, name), added])[order] for name, added in more.items()}
        return Cuts(
            **joined,
            slopes=np.zeros((len(order), 0)),
            segment=np.concatenate([self.segment, [-1], inside])[order][:-1],
            first=int(np.flatnonzero(order == self.first)[0]),
        )


def scheduled_cuts(run: Run, segments: Segments) -> Cuts:
    """Cuts of a run that are known before it.

    Parameters
    ----------
    segments : all of the run
    """
    count = len(segments.times)
    return Cuts(
        times=segments.times,
        cause=np.full(count, Cause.SCHEDULE),
        angle=np.zeros(count, dtype=np.int_),
        slopes=np.zeros((count, 0)),
        segment=np.arange(count - 1),
        first=int(np.argmin(np.abs(segments.times - run.start))),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Nodes:
    """Nodes in time.

    Attributes
    ----------
    t : shape (nodes,) [s]
    weight : weights of integrals over time, shape (nodes,) [s]
    segment, fraction : interval between cuts, and place within it, shape (nodes,)
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


def place(cuts: Cuts, segment: NDArray[np.int_], fraction: Array, share: Array) -> Nodes:
    """Nodes between cuts, which move with these.

    Parameters
    ----------
    segment, fraction : interval and place within it, 0 and 1 being its sides of the cuts, shape (nodes,)
    share : of the interval's length, which counts in integrals, shape (nodes,)
    """
    left, right = cuts.times[segment], cuts.times[segment + 1]
    left_slope, right_slope = cuts.slopes[segment], cuts.slopes[segment + 1]
    return Nodes(
        t=np.where(fraction == 1.0, right, left + fraction * (right - left)),
        weight=share * (right - left),
        segment=segment,
        fraction=fraction,
        held=cuts.segment[segment],
        slope=left_slope + fraction[:, None] * (right_slope - left_slope),
        weight_slope=share[:, None] * (right_slope - left_slope),
    )


def moved(nodes: Nodes, cuts: Cuts, points: Sequence[tuple[int, float]]) -> tuple[Nodes, dict[tuple[int, float], int]]:
    """Nodes between cuts whose derivatives are known, with further ones (segment, fraction) of no weight.

    Returns
    -------
    nodes, and which one each of the points is
    """
    segment = np.append(nodes.segment, [point[0] for point in points]).astype(np.int_)
    fraction = np.append(nodes.fraction, [point[1] for point in points])
    share = np.append(nodes.weight / np.diff(cuts.times)[nodes.segment], np.zeros(len(points)))
    order = np.lexsort((fraction, segment))
    found = np.argsort(order)[len(nodes) :].tolist()
    return place(cuts, segment[order], fraction[order], share[order]), dict(zip(points, found, strict=True))


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
