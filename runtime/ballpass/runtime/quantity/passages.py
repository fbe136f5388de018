"""Moments at which a driver whose speed changes passes edges of windows, and how these move with the parameters.

In: a run along nodes.  Out: `Passages`.  A load begins or ends there: rates of states jump, and so may outputs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.quantity.kinks import APART, crossings
from ballpass.runtime.quantity.nodes import Nodes
from ballpass.runtime.quantity.track import Track, follow
from ballpass.runtime.run import driver_angle
from ballpass.runtime.run.directions import Chain
from ballpass.runtime.run.resolve import Run

Array = NDArray[np.float64]

#: Data of an edge are taken this part of a turn before it: well above rounding, so that states and rates are of one
#: side.
BEFORE = 1e-8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Passages:
    """Moments just before edges, in order.

    Attributes
    ----------
    times : shape (passages,) [s]
    edges : parameter that is the angle of each edge
    near : times as near as this to one of them count as equal [s]
    """

    times: Array
    edges: tuple[str, ...]
    near: float


def find_passages(run: Run, track: Track) -> Passages:
    """Passages of all edges along a track; none where no window has an angle that is a state."""
    manifest, nodes = run.model.manifest, track.nodes
    before = BEFORE * min(run.turn, run.duration)
    found: list[tuple[float, str]] = []
    if manifest.edges and manifest.mechanism is not None:
        driver = run.model.states.index(manifest.mechanism.angle)
        for edge in dict.fromkeys(manifest.edges):
            behind = np.sin(0.5 * (track.x[:, driver] - run.numbers.values[edge]))
            found += [(time, edge) for time in crossings(nodes.t, nodes.segment, behind).tolist()]
    apart = max(APART * run.duration, 10.0 * before)
    found = [item for item in sorted(found) if np.min(np.abs(track.edges.times - item[0])) > apart]
    times = np.array([time for time, _ in found])
    if found:
        # by Newton, from the sign changes at the nodes
        seen = _there(run, track, times)
        angle, speed = seen.x[:, driver], seen.x[:, len(run.model.states) // 2 + driver]
        left = [
            math.remainder(run.numbers.values[edge] - a, driver_angle.TURN)
            for (_, edge), a in zip(found, angle, strict=True)
        ]
        times = times + np.array(left) / speed - before
    return Passages(times=times, edges=tuple(edge for _, edge in found), near=10.0 * before)


def passage_slopes(run: Run, track: Track, passages: Passages, chain: Chain, sensitivity_rtol: float) -> Array:
    """Derivatives of the times of passages along the directions, shape (passages, directions) [s/unit]."""
    if not passages.edges:
        return np.zeros((0, len(chain.names)))
    assert run.model.manifest.mechanism is not None  # its angle passes the edges
    driver = run.model.states.index(run.model.manifest.mechanism.angle)
    seen = _there(run, track, passages.times, chain, sensitivity_rtol)
    # angle and speed do not jump at an edge: either side gives them
    moved = np.array([chain.derivative(edge) for edge in passages.edges])
    speed = seen.x[:, len(run.model.states) // 2 + driver]
    return np.asarray((moved - seen.slope[:, driver]) / speed[:, None])


def _there(
    run: Run, track: Track, times: Array, chain: Chain | None = None, sensitivity_rtol: float | None = None
) -> Track:
    """The run at these fixed times."""
    still = np.zeros((len(times), 0 if chain is None else len(chain.names)))
    held = np.searchsorted(track.segments.times, times) - 1
    zeros = np.zeros(len(times))
    nodes = Nodes(t=times, weight=zeros, segment=held, fraction=zeros, held=held, slope=still, weight_slope=still)
    return follow(run, track.segments, track.edges, nodes, chain, sensitivity_rtol)
