"""Moments at which angles that the motion decides pass edges of windows, and how these move with the parameters.

In: a run along nodes.  Out: `Passages`; for users, `passing_times` of all edges of a run.  A load begins or ends there,
or a ball enters a spall or leaves it: rates of states jump, and so may outputs.
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
from ballpass.runtime.quantity.kinks import APART, crossings
from ballpass.runtime.quantity.nodes import Edges, fixed_nodes, make_edges, place
from ballpass.runtime.quantity.panels import GAUSS, panels_between, plan_of
from ballpass.runtime.quantity.track import ChannelValues, Track, follow
from ballpass.runtime.run.directions import Chain
from ballpass.runtime.run.loop import segments_of, steps_of
from ballpass.runtime.run.request import Request, check_memory
from ballpass.runtime.run.resolve import Run, resolve
from ballpass.runtime.time import timeline
from ballpass.runtime.time.turning import TURN

Array = NDArray[np.float64]

#: Data of an edge are taken this part of a turn before it: well above rounding, so that states and rates are of one
#: side.
BEFORE = 1e-8

#: Sines of angles that are zero but for rounding, and Newton's steps to where an angle jumps.
ROUNDING, NEWTON = 1e-12, 3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Passages:
    """Moments just before edges, in order.

    Attributes
    ----------
    times : shape (passages,) [s]
    forward : whether the angle grows then, shape (passages,)
    edges : parameter or constant that is the angle of each edge
    columns : place of each edge among all of the model
    before : how long before the edges [s]
    """

    times: Array
    forward: NDArray[np.bool_]
    edges: tuple[str, ...]
    columns: NDArray[np.int_]
    before: float

    @property
    def near(self) -> float:
        """Times as near as this to one of them count as equal [s]."""
        return 10.0 * self.before


def no_passages() -> Passages:
    """Of no edge."""
    return Passages(times=np.zeros(0), forward=np.zeros(0, bool), edges=(), columns=np.zeros(0, int), before=0.0)


class EdgeDistances(ChannelValues):
    """Angles beyond the edges of all windows [rad] along tracks, and their rates [rad/s]."""

    def __init__(self, model: LoadedModel) -> None:
        super().__init__(model, ())
        count = model.symbolic("windows").size1_out(0)
        self._columns = [("distance", count), ("rate", count)]

    def _all_rows(self, inputs: Mapping[str, casadi.SX]) -> list[casadi.SX]:
        graph = self._model.symbolic("windows")
        return list(graph.call([inputs[name] for name in graph.name_in()]))

    def outputs_at(self, count: int, given: Mapping[str, Array]) -> dict[str, Array]:
        """Both at points, each of shape (points, edges)."""
        found = Loop(self._function(self._all_rows), ("t", "x", "u"))(count, given)["g"]
        distance, rate = np.split(found, 2, axis=1)
        return {"distance": distance, "rate": rate}


def find_passages(run: Run, track: Track) -> Passages:
    """Passages of all edges along a track; none where no window has an angle that the motion decides."""
    manifest, nodes = run.model.manifest, track.nodes
    before = BEFORE * min(run.turn, run.duration)
    found: list[tuple[float, str]] = []
    if manifest.edges:
        distances = EdgeDistances(run.model)
        beyond = distances.along(track, run.numbers)["distance"].value
        for edge in dict.fromkeys(manifest.edges):
            behind = np.sin(0.5 * beyond[:, manifest.edges.index(edge)])
            found += [(time, edge) for time in crossings(nodes.t, nodes.segment, behind).tolist()]
    apart = max(APART * run.duration, 10.0 * before)
    found = [item for item in sorted(found) if np.min(np.abs(track.edges.times - item[0])) > apart]
    times = np.array([time for time, _ in found])
    columns = np.array([manifest.edges.index(edge) for _, edge in found], dtype=int)
    rates = np.zeros(len(found))
    if found:
        # by Newton, from the sign changes at the nodes
        seen, rows = distances.along(_there(run, track, times), run.numbers), np.arange(len(found))
        left = -np.angle(np.exp(1j * seen["distance"].value[rows, columns]))
        rates = seen["rate"].value[rows, columns]
        # of the fastest turn: one at the first speed of a run-up from rest has no end
        before = BEFORE / max(BEFORE / before, float(np.max(np.abs(rates))) / TURN)
        times = times + left / rates - before
    return Passages(
        times=times,
        forward=rates > 0.0,
        edges=tuple(edge for _, edge in found),
        columns=columns,
        before=before,
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
            for edge, times in timeline.edge_times(model.manifest, item, numbers.values, run.start, run.end):
                parts.setdefault(edge, []).append(times[(times >= run.start) & (times < run.end)])
    if model.manifest.edges:
        passed = _passages_of(run)
        at = passed.times + passed.before
        for edge in dict.fromkeys(model.manifest.edges):
            parts[edge].append(at[[name == edge for name in passed.edges]])
    return {edge: np.unique(np.concatenate(times)) for edge, times in parts.items()}


def entering_times(run: Run) -> dict[str, Array]:
    """Times at which a ball enters a spall, by what edges of the spall begin with [s].

    Of spalls whose edges are met when the motion decides.  A ball enters by either edge, as the rings turn.
    """
    passed = _passages_of(run)
    at = passed.times + passed.before
    spalls = dict.fromkeys(edge.rpartition(".")[0] for edge in run.model.manifest.edges if "defects." in edge)
    ways = ((".begin", True), (".end", False))
    return {
        spall: np.array(
            [
                time
                for time, edge, forward in zip(at.tolist(), passed.edges, passed.forward.tolist(), strict=True)
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
    return find_passages(run, follow(run, segments, edges, place(plan_of(panels, edges), edges), kept=kept))


def passage_slopes(run: Run, track: Track, passages: Passages, chain: Chain, sensitivity_rtol: float) -> Array:
    """Derivatives of the times of passages along the directions, shape (passages, directions) [s/unit]."""
    if not passages.edges:
        return np.zeros((0, len(chain.names)))
    seen = _there(run, track, passages.times, chain, sensitivity_rtol)
    # angles and their rates do not jump at an edge: either side gives them
    found, rows = EdgeDistances(run.model).along(seen, run.numbers, chain), np.arange(len(passages.edges))
    rate = found["rate"].value[rows, passages.columns]
    return np.asarray(-found["distance"].slope[rows, passages.columns] / rate[:, None])


def jumps_at(channel: str) -> float | None:
    """Angle at which a channel jumps by a turn, where a body makes whole turns [rad]; None of all but angles."""
    if channel == "drive_angle":
        return 0.0
    in_half_turns = channel.endswith(("cage.in_outer", "cage.in_inner"))
    return np.pi if in_half_turns or (channel.startswith("body.") and channel.endswith(".angle")) else None


def find_wraps(run: Run, track: Track, angle: ChannelValues, *, still: bool) -> Array:
    """Times at which an angle jumps by a turn, shape (wraps,) [s].

    Parameters
    ----------
    angle : the channel
    still : whether it follows from time alone
    """
    at = jumps_at(angle.channels[0])
    assert at is not None  # it is an angle
    past = angle.along(track, run.numbers)[angle.channels[0]].value[:, 0] - at
    # a body that stands at pi is on either side of it by rounding
    across = np.where((np.cos(past) > 0.0) & (np.abs(np.sin(past)) > ROUNDING), np.sin(past), 0.0)
    times = crossings(track.nodes.t, track.nodes.segment, across)
    for _ in range(NEWTON if len(times) else 0):
        value, rate = (found[:, 0] for found in angle.with_rates(_there(run, track, times, still=still), run.numbers))
        times = times - np.angle(np.exp(1j * (value - at))) / rate
    edges = track.edges.times
    return np.array([time for time in times.tolist() if np.min(np.abs(edges - time)) > APART * run.duration])


def wrap_slopes(
    run: Run, track: Track, times: Array, angle: ChannelValues, chain: Chain, sensitivity_rtol: float, *, still: bool
) -> Array:
    """Derivatives of the times of `find_wraps` along the directions, shape (wraps, directions) [s/unit]."""
    seen = _there(run, track, times, chain, sensitivity_rtol, still=still)
    _, rate = angle.with_rates(seen, run.numbers)
    return np.asarray(-angle.along(seen, run.numbers, chain)[angle.channels[0]].slope[:, 0] / rate)


def jumps_at_edges(
    run: Run,
    track: Track,
    edges: Edges,
    angle: ChannelValues,
    chain: Chain,
    sensitivity_rtol: float,
    *,
    still: bool,
) -> tuple[Edges, NDArray[np.bool_]]:
    """Edges where those at which an angle jumps by a turn move with the jump, and directions in which they do not.

    An angle that follows from time alone knows nothing of other edges than the run's ends.

    Parameters
    ----------
    edges : without those of `find_wraps`

    Returns
    -------
    edges, and whether the jump leaves an edge, shape (directions,)
    """
    at = jumps_at(angle.channels[0])
    assert at is not None  # it is an angle
    seen = _there(run, track, edges.times, chain, sensitivity_rtol, still=still)
    value, rate = angle.with_rates(seen, run.numbers)
    order = np.arange(len(edges.times))
    jump = (np.abs(np.exp(1j * (value[:, 0] - at)) - 1.0) <= APART * run.duration * np.abs(rate[:, 0])) & (
        order >= edges.first
    )
    if not np.any(jump):
        return edges, np.zeros(len(chain.names), dtype=bool)
    slopes = edges.slopes.copy()
    slopes[jump] = -angle.along(seen, run.numbers, chain)[angle.channels[0]].slope[jump, 0] / rate[jump]
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
    still: bool = False,
) -> Track:
    """The run at these fixed times."""
    held = np.clip(np.searchsorted(track.segments.times, times) - 1, 0, None)
    nodes = fixed_nodes(times, held, held, 0 if chain is None else len(chain.names))
    return follow(run, track.segments, track.edges, nodes, chain, sensitivity_rtol, still=still)
