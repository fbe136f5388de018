"""Moments at which angles that the motion decides pass edges of windows, and how these move with the parameters.

In: a run along nodes.  Out: `Passages`; for users, `passing_times` of all edges of a run.  A load begins or ends there,
or a ball enters a spall or leaves it: rates of states jump, and so may outputs.  An angle that is integrated jumps by a
turn, which is a passage as well.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import casadi
import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.kernel import Loop
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.quantity.kinks import crossings
from ballpass.runtime.quantity.nodes import APART, Edges, fixed_nodes, make_edges, place
from ballpass.runtime.quantity.panels import GAUSS, panels_between, plan_of
from ballpass.runtime.quantity.track import ChannelValues, Track, follow
from ballpass.runtime.request.request import Request, check_memory
from ballpass.runtime.request.resolve import Run, resolve
from ballpass.runtime.run.directions import Chain
from ballpass.runtime.run.loop import segments_of, steps_of
from ballpass.runtime.time.breakpoints import edge_times
from ballpass.runtime.time.turning import TURN

Array = NDArray[np.float64]

#: Data of an edge are taken this part of a turn before it: well above rounding, so that states and rates are of one
#: side.
BEFORE = 1e-8

#: Sines of angles that are zero but for rounding, and Newton's steps to where an angle jumps.
ROUNDING, NEWTON = 1e-12, 3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Passages:
    """Moments at which angles pass zero, in order.

    Attributes
    ----------
    times : shape (passages,) [s]
    forward : whether the angle grows then, shape (passages,)
    columns : which angle, shape (passages,)
    before : how long before zero the moments are [s]
    angles : those that pass
    """

    times: Array
    forward: NDArray[np.bool_]
    columns: NDArray[np.int_]
    before: float
    angles: EdgeDistances | JumpDistance

    @property
    def near(self) -> float:
        """Times as near as this to one of them count as equal [s]."""
        return 10.0 * self.before


class EdgeDistances(ChannelValues):
    """Angles beyond the edges of all windows [rad] along tracks, and their rates [rad/s]."""

    def __init__(self, model: LoadedModel) -> None:
        super().__init__(model, ())
        count = model.symbolic("windows").size1_out(0)
        self._columns = [("distance", count), ("rate", count)]
        edges = model.manifest.edges
        self.which, self.before = [edges.index(edge) for edge in dict.fromkeys(edges)], BEFORE

    def _all_rows(self, inputs: Mapping[str, casadi.SX]) -> list[casadi.SX]:
        graph = self._model.symbolic("windows")
        return list(graph.call([inputs[name] for name in graph.name_in()]))

    def outputs_at(self, count: int, given: Mapping[str, Array]) -> dict[str, Array]:
        """Both at points, each of shape (points, edges)."""
        found = Loop(self._function(self._all_rows), ("t", "x", "u"))(count, given)["g"]
        distance, rate = np.split(found, 2, axis=1)
        return {"distance": distance, "rate": rate}

    def past(self, track: Track, numbers: Numbers) -> tuple[Array, Array]:
        """Both along a track, shape (nodes, edges) each."""
        found = self.along(track, numbers)
        return found["distance"].value, found["rate"].value

    def slopes(self, track: Track, numbers: Numbers, chain: Chain) -> Array:
        """Derivatives of the angles, shape (nodes, edges, directions)."""
        return self.along(track, numbers, chain)["distance"].slope


class JumpDistance:
    """The angle of a channel beyond the place where it jumps by a turn, as `EdgeDistances`."""

    def __init__(self, angle: ChannelValues) -> None:
        (self._channel,), self._angle = angle.channels, angle
        at = jumps_at(self._channel)
        assert at is not None  # it is an angle
        self._at, self.which, self.before = at, [0], 0.0

    def past(self, track: Track, numbers: Numbers) -> tuple[Array, Array]:
        """As of `EdgeDistances`."""
        value, rate = self._angle.with_rates(track, numbers)
        return value - self._at, rate

    def slopes(self, track: Track, numbers: Numbers, chain: Chain) -> Array:
        """As of `EdgeDistances`."""
        return self._angle.along(track, numbers, chain)[self._channel].slope


def find_passages(
    run: Run, track: Track, angles: EdgeDistances | JumpDistance, kept: Array, *, still: bool
) -> Passages:
    """Passages of angles along a track, apart from its edges.

    Parameters
    ----------
    kept : steps of the run
    still : whether the angles follow from time alone
    """
    beyond, _ = angles.past(track, run.numbers)
    # what stands at half a turn is on either side of it by rounding
    across = np.where((np.cos(beyond) > 0.0) & (np.abs(np.sin(beyond)) > ROUNDING), np.sin(beyond), 0.0)
    each = [crossings(track.nodes.t, track.nodes.segment, across[:, k]) for k in angles.which]
    times, columns = np.concatenate([np.zeros(0), *each]), np.repeat(angles.which, [len(one) for one in each])
    rates = np.zeros(len(times))
    for _ in range(NEWTON if len(times) else 0):
        order = np.argsort(times, kind="stable")
        times, columns, rows = times[order], columns[order], np.arange(len(times))
        past, every = angles.past(_there(run, track, times, kept=kept, still=still), run.numbers)
        rates = every[rows, columns]
        times = times - np.angle(np.exp(1j * past[rows, columns])) / rates
    # of the fastest turn: one at the first speed of a run-up from rest has no end
    fastest = float(np.max(np.abs(rates), initial=0.0)) / TURN
    before = angles.before / max(1.0 / min(run.stretch, run.duration), fastest)
    distance = np.min(np.abs(track.edges.times[:, None] - times), axis=0)
    kept_ones = distance > max(APART * run.duration, 10.0 * before)
    return Passages(
        times=times[kept_ones] - before,
        forward=rates[kept_ones] > 0.0,
        columns=columns[kept_ones],
        before=before,
        angles=angles,
    )


def passing_times(model: LoadedModel, numbers: Numbers, request: Request) -> dict[str, Array]:
    """Times at which a run passes edges of windows, by the edge, each increasing [s].

    Those of loads and spalls, whether known before the run or decided by the motion; after the transient.

    Raises
    ------
    RequestError
        A wrong request, or a run too long to keep its steps in memory.
    SimulationError
        The computation failed.
    """
    run = resolve(model, numbers, request).check_steady()
    parts: dict[str, list[Array]] = {edge: [] for edge in model.manifest.edges}
    for item in model.manifest.inputs:
        if item.kind == "gate":
            for edge, times in edge_times(model.manifest, item, numbers.values, run.start, run.end):
                parts.setdefault(edge, []).append(times[(times >= run.start) & (times < run.end)])
    if model.manifest.edges:
        passed = _passages_of(run)
        at = passed.times + passed.before
        for edge in dict.fromkeys(model.manifest.edges):
            parts[edge].append(at[passed.columns == model.manifest.edges.index(edge)])
    return {edge: np.unique(np.concatenate(times)) for edge, times in parts.items()}


def entering_times(run: Run) -> dict[str, Array]:
    """Times at which a ball enters a spall, by what edges of the spall begin with [s].

    Of spalls whose edges are met when the motion decides.  A ball enters by either edge, as the rings turn.
    """
    passed = _passages_of(run)
    at, names = passed.times + passed.before, [run.model.manifest.edges[k] for k in passed.columns]
    spalls = dict.fromkeys(edge.rpartition(".")[0] for edge in run.model.manifest.edges if "defects." in edge)
    ways = ((".begin", True), (".end", False))
    return {
        spall: np.array(
            [
                time
                for time, edge, forward in zip(at.tolist(), names, passed.forward.tolist(), strict=True)
                if (edge.removeprefix(spall), forward) in ways
            ]
        )
        for spall in spalls
    }


def _passages_of(run: Run) -> Passages:
    """Passages of all edges that the motion decides, of a run that is made for them."""
    kept, run = steps_of(run), replace(run, progress=None)
    cuts = kept[:, 0]
    count = 16 * len(run.model.states)
    check_memory("Edges along a run of", len(GAUSS) * len(cuts), count, "Run fewer cycles.")
    segments = segments_of(run)
    edges = make_edges(run, segments, None)
    panels = panels_between(edges, cuts, np.zeros(len(cuts), dtype=bool))
    track = follow(run, segments, edges, place(plan_of(panels, edges), edges), kept=kept)
    return find_passages(run, track, EdgeDistances(run.model), kept, still=False)


def passage_slopes(
    run: Run, track: Track, passages: Passages, chain: Chain, sensitivity_rtol: float, *, still: bool
) -> Array:
    """Derivatives of the times of passages along the directions, shape (passages, directions) [s/unit]."""
    seen = _there(run, track, passages.times, chain, sensitivity_rtol, still=still)
    # angles and their rates do not jump at an edge: either side gives them
    _, rates = passages.angles.past(seen, run.numbers)
    slopes, rows = passages.angles.slopes(seen, run.numbers, chain), np.arange(len(passages.times))
    return np.asarray(-slopes[rows, passages.columns] / rates[rows, passages.columns, None])


def jumps_at(channel: str) -> float | None:
    """Angle at which a channel jumps by a turn, where a body makes whole turns [rad]; None of all but angles."""
    if channel == "drive_angle":
        return 0.0
    in_half_turns = channel.endswith(("cage.in_outer", "cage.in_inner"))
    return np.pi if in_half_turns or (channel.startswith("body.") and channel.endswith(".angle")) else None


def jumps_at_edges(
    run: Run,
    track: Track,
    edges: Edges,
    angle: JumpDistance,
    chain: Chain,
    sensitivity_rtol: float,
    *,
    still: bool,
) -> tuple[Edges, NDArray[np.bool_]]:
    """Edges where those at which an angle jumps by a turn move with the jump, and directions in which they do not.

    An angle that follows from time alone knows nothing of other edges than the run's ends.

    Parameters
    ----------
    edges : without those of passages

    Returns
    -------
    edges, and whether the jump leaves an edge, shape (directions,)
    """
    seen = _there(run, track, edges.times, chain, sensitivity_rtol, still=still)
    past, rate = angle.past(seen, run.numbers)
    order = np.arange(len(edges.times))
    jump = (np.abs(np.exp(1j * past[:, 0]) - 1.0) <= APART * run.duration * np.abs(rate[:, 0])) & (order >= edges.first)
    if not np.any(jump):
        return edges, np.zeros(len(chain.names), dtype=bool)
    slopes = edges.slopes.copy()
    slopes[jump] = -angle.slopes(seen, run.numbers, chain)[jump, 0] / rate[jump]
    free = jump & still & (order > edges.first) & (order < order[-1])
    leaves = jump[:, None] & ~free[:, None] & ~np.isclose(slopes, edges.slopes, rtol=1e-6, atol=0.0)
    slopes[jump & ~free] = edges.slopes[jump & ~free]
    return replace(edges, slopes=slopes), np.any(leaves, axis=0)


def _there(
    run: Run,
    track: Track,
    times: Array,
    chain: Chain | None = None,
    sensitivity_rtol: float | None = None,
    *,
    kept: Array | None = None,
    still: bool,
) -> Track:
    """The run at these fixed times."""
    held = np.clip(np.searchsorted(track.segments.times, times) - 1, 0, None)
    nodes = fixed_nodes(times, held, held, 0 if chain is None else len(chain.names))
    return follow(run, track.segments, track.edges, nodes, chain, sensitivity_rtol, kept=kept, still=still)
