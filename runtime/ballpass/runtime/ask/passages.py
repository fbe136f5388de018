"""Moments at which a driver whose speed changes passes edges of windows, and how these move with the parameters.

In: a run along nodes.  Out: `Passages`.  A load begins or ends there: rates of states jump, and so may outputs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.ask.kinks import APART, crossings
from ballpass.runtime.ask.nodes import Nodes
from ballpass.runtime.ask.track import Stepping, Track, follow
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.run import inputs as clock
from ballpass.runtime.run.directions import Chain

Array = NDArray[np.float64]

#: What is told of an edge holds so much before it, in parts of a turn: well above rounding, so that states and rates
#: there are of one side.
BEFORE = 1e-8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Passages:
    """Moments just before edges, in order.

    Attributes
    ----------
    times : shape (passages,) [s]
    slopes : their derivatives along the directions, shape (passages, directions) [s/unit]
    near : what is so near to one of the times is there [s]
    """

    times: Array
    slopes: Array
    near: float


def find_passages(
    model: LoadedModel, numbers: Numbers, track: Track, stepping: Stepping, chain: Chain | None
) -> Passages:
    """Passages of all edges along a track; none where no window counts on an angle that is a state."""
    manifest, window, nodes = model.manifest, track.edges.window, track.nodes
    directions = 0 if chain is None else len(chain.names)
    before = BEFORE * min(window.turn, window.duration)
    found: list[tuple[float, str]] = []
    if manifest.edges and manifest.mechanism is not None:
        driver = model.states.index(manifest.mechanism.angle)
        for edge in dict.fromkeys(manifest.edges):
            behind = np.sin(0.5 * (track.x[:, driver] - numbers.values[edge]))
            found += [(time, edge) for time in crossings(nodes.t, nodes.segment, behind).tolist()]
    apart = max(APART * window.duration, 10.0 * before)
    found = [item for item in sorted(found) if np.min(np.abs(track.edges.times - item[0])) > apart]
    if not found:
        return Passages(times=np.zeros(0), slopes=np.zeros((0, directions)), near=0.0)
    times = np.array([time for time, _ in found])
    still = np.zeros((len(times), directions))
    there = Nodes(
        t=times,
        weight=np.zeros(len(times)),
        segment=np.searchsorted(track.edges.times, times) - 1,
        slope=still,
        weight_slope=still,
    )
    seen = follow(model, numbers, track.edges, there, stepping, chain)
    angle, speed = seen.x[:, driver], seen.x[:, len(model.states) // 2 + driver]
    left = [math.remainder(numbers.values[edge] - a, clock.TURN) for (_, edge), a in zip(found, angle, strict=True)]
    slopes = still
    if chain is not None:
        # angle and speed do not jump at an edge: either side tells
        moved = np.array([chain.derivative(edge) for _, edge in found])
        slopes = (moved - seen.slope[:, driver]) / speed[:, None]
    return Passages(times=times + np.array(left) / speed - before, slopes=slopes, near=10.0 * before)
