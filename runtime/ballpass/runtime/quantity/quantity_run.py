"""Evaluate quantities of a run, with or without their derivatives.

In: a model and quantities (`QuantityRun`); a `Run`.  Out: `Values`.

A plain run reduces what its steps give: extremes, means and life of states and ball forces are there, the same bits in
every command.  All else is evaluated along nodes within the very steps of that run (`panels`); extremes are searched
between them.  A run with derivatives along the same nodes gives those.
"""

from __future__ import annotations

import math
import time as clocks
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.reduction_rows import reduction_rows
from ballpass.runtime.native.stepper import Segments
from ballpass.runtime.quantity.between_nodes import Extreme, Wanted, find_extremes
from ballpass.runtime.quantity.kinks import DEFLECTION, find_kinks
from ballpass.runtime.quantity.location import Moment, place_of, place_slope
from ballpass.runtime.quantity.nodes import (
    Edges,
    NodePlan,
    Nodes,
    find,
    make_edges,
    no_nodes,
    place,
    with_passages,
    with_points,
)
from ballpass.runtime.quantity.panels import (
    GAUSS,
    ROUGH,
    Panels,
    cut_at,
    panels_between,
    parts_needed,
    plan_of,
    split,
    uniform_panels,
)
from ballpass.runtime.quantity.passages import Passages, find_passages, passage_slopes
from ballpass.runtime.quantity.records import Estimate, Kind, Mark, Quantity, ReducedRuns, View
from ballpass.runtime.quantity.registry import KINDS
from ballpass.runtime.quantity.track import ChannelValues, Signal, Track, depends, follow, jumps
from ballpass.runtime.run.directions import Chain
from ballpass.runtime.run.locating import LOCATED, stepper_for
from ballpass.runtime.run.loop import ReductionRow, Sink, StepEnds, start_run
from ballpass.runtime.run.request import check_memory
from ballpass.runtime.run.resolve import Run
from ballpass.runtime.run.segments import joined_segments, run_windows

Array = NDArray[np.float64]

#: Fractions nearer than this to an edge are at it.
AT_EDGE = 1e-12

#: Numbers that a node takes for each state, and those that each direction adds: states, channels, and what they are
#: made of, on the way from the driver to the quantities.  Lanes without a direction are counted where they are made.
VALUES, SLOPES = 16, 8

#: Passes that make panels finer, and the most nodes that they may come to.
PASSES, MOST = 6, 2**17

#: Distance of the nodes around an extreme, as a share of its panel; what is nearer to its end is at a kink [1].
AROUND, NEAREST = 0.1, 1e-3

#: Nodes on either side of such an extreme.
BESIDE = 3

#: Time of this thread on its processor where the system counts it finely: other programs do not enter.
_now = clocks.thread_time if clocks.get_clock_info("thread_time").resolution < 1e-5 else clocks.perf_counter


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Values:
    """Quantities of a run.

    Attributes
    ----------
    estimates : one for each quantity
    track : states along the nodes; None where the reductions of the steps give all
    row : reductions, None where nothing was run
    seconds : of the plain integration alone [s]
    steps, rejected : it took
    """

    estimates: tuple[Estimate, ...]
    track: Track | None = None
    row: Array | None = None
    seconds: float = 0.0
    steps: int = 0
    rejected: int = 0

    @property
    def values(self) -> Array:
        """Shape (quantities,)."""
        return np.array([item.value for item in self.estimates])

    @property
    def slopes(self) -> Array:
        """Shape (quantities, directions)."""
        return np.array([item.slope for item in self.estimates])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Laid:
    """Nodes of a run.

    Attributes
    ----------
    segments : of the driver
    edges, passages, panels, plan : where nodes lie
    track, signals : states and channels along them
    extremes : by quantity and "max" or "min", the best first
    """

    segments: Segments
    edges: Edges
    passages: Passages
    panels: Panels
    plan: NodePlan
    track: Track
    signals: Mapping[str, Signal]
    extremes: Mapping[tuple[str, str], list[Extreme]]


class QuantityRun:
    """Quantities along runs of one model.

    Parameters
    ----------
    model : the model
    quantities : what is asked for
    rough : see `panels.parts_needed` [1]
    along_nodes : evaluate along nodes also what reductions hold: integrals are then cut where balls change rank
    motion : reduce all states as well, for `Values.row`
    """

    def __init__(
        self,
        model: LoadedModel,
        quantities: Sequence[Quantity],
        *,
        rough: float = ROUGH,
        along_nodes: bool = False,
        motion: bool = False,
    ) -> None:
        self.model = model
        self.quantities = tuple(quantities)
        self._rough, self._motion, self._along_nodes = rough, motion, along_nodes
        self._moving = [item for item in quantities if _kind(item).at_rest is None]
        self._reduced = {} if along_nodes else {item.name: item for item in self._moving if is_reduced(model, item)}
        self._noded = [item for item in self._moving if item.name not in self._reduced]
        channels = [item.channel for item in self._moving]
        channels += [
            item.channel.removesuffix("ball.force") + name for item in self._moving for name in _kind(item).beside
        ]
        self._channels = ChannelValues(model, channels)
        every = self._channels.channels
        # outputs that follow from time alone need no integration
        self._still = all(name not in model.states and not depends(model, name, "x") for name in every)

    def measure(self, run: Run) -> Values:
        """Values of all quantities.

        Raises
        ------
        RequestError
            A place that the run does not reach, or nothing left of it behind the transient.
        SimulationError
            The computation failed.
        """
        return self._measure(run, self._noded)[0]

    def differentiate(self, run: Run, names: Sequence[str], sensitivity_rtol: float) -> Values:
        """Values of all quantities, those of `measure`, and their derivatives along parameters.

        Parameters
        ----------
        sensitivity_rtol : tolerance of the derivatives in the choice of step sizes [1]

        Raises
        ------
        RequestError
            An unknown parameter, several loads that switch at one time, or an extreme of an output that jumps at the
            edge of a window whose time the motion decides.
        SimulationError
            The computation failed.
        """
        for item in self._moving:
            if _kind(item).extremes and jumps(self.model, item.channel):
                raise RequestError(
                    f"{item.name}: the driver's angle is a state, and {item.channel} jumps where a load within a "
                    "window of that angle begins or ends; on which side of the jump the extreme is, is not followed. "
                    "Allowed: extremes of states, forces of balls and all else that does not jump; means and integrals "
                    "of all. Or give the load as a table over the angle, with flanks as steep as they are."
                )
        chain = Chain(self.model, run.numbers, names)
        if not self._moving:
            return Values(estimates=tuple(self._estimate(None, item, run, chain) for item in self.quantities))
        found, laid = self._measure(run, self._moving, len(names))
        assert laid is not None  # something moves
        edges = make_edges(run, laid.segments, chain)
        if len(laid.passages.times):
            slopes = passage_slopes(run, laid.track, laid.passages, chain, sensitivity_rtol)
            edges = with_passages(edges, laid.passages.times, slopes)
        around = {
            item.name: _around(laid, laid.extremes[item.name, kind][0])
            for item in self._moving
            for kind in _kind(item).extremes
            if _kind(item).around
        }
        extremes = [(item.segment, item.fraction) for some in laid.extremes.values() for item in some]
        points = list(dict.fromkeys([*extremes, *(point for some in around.values() for point in some)]))
        integrated = any(not (_kind(item).extremes or _kind(item).at_moment) for item in self._moving)
        plan = with_points(laid.plan if integrated else no_nodes(), points)
        nodes, marks = self._nodes(run, laid, edges, plan, chain)
        track = follow(run, laid.segments, edges, nodes, chain, sensitivity_rtol, still=self._still)
        for key, some in laid.extremes.items():
            first, *others = (_mark(item, plan) for item in some)
            beside = tuple(_node(plan, point) for point in around.get(key[0], ()))
            marks[key] = replace(first, competing=tuple(others), around=beside)
        view = View(
            run=run,
            nodes=nodes,
            signals=self._channels.along(track, run.numbers, chain),
            marks=marks,
            slopes=chain.derivative,
            names=chain.names,
        )
        estimates = []
        for item, plain in zip(self.quantities, found.estimates, strict=True):
            one = self._estimate(view, item, run, chain)
            estimates.append(replace(one, value=plain.value, time=plain.time, ball=plain.ball))
        return replace(found, estimates=tuple(estimates), track=track)

    def _measure(self, run: Run, noded: Sequence[Quantity], directions: int = 0) -> tuple[Values, _Laid | None]:
        """Values, and the nodes on which `noded` are evaluated; those that reductions hold are taken from there.

        Parameters
        ----------
        directions : along which derivatives are taken at these nodes
        """
        if not self._moving and not self._motion:
            found = tuple(self._estimate(None, item, run, None) for item in self.quantities)
            return Values(estimates=found), None
        run.check_steady()
        row = self._row(run)
        ends = StepEnds()
        steps = rejected = 0
        seconds, state = 0.0, run.initial
        if not self._still or self._motion:
            sinks: list[Sink] = [ReductionRow(row=row), *([ends] if noded else [])]
            going = start_run(run, sinks)
            stepper_for(run.model, run.kinks)  # compiled before it is timed
            begin = _now()
            going.go_on()
            seconds, steps, rejected, state = _now() - begin, going.steps, going.rejected, going.state
        run = replace(run, progress=None)
        view, laid = None, None
        if noded:
            every = ends.all
            self._check_memory(len(GAUSS) * max(len(every), math.ceil(run.cycles)), directions)
            laid = self._lay(run, every, row, noded)
            nodes, marks = self._nodes(run, laid, laid.edges, laid.plan, None)
            signals = laid.signals
            if len(nodes) > len(laid.plan):
                there = follow(run, laid.segments, laid.edges, nodes, still=self._still)
                signals = self._channels.along(there, run.numbers)
            for key, some in laid.extremes.items():
                marks[key] = _plain_mark(some[0])
            view = View(run=run, nodes=nodes, signals=signals, marks=marks, slopes=lambda _: np.zeros(0), names=())
        runs = ReducedRuns(
            manifest=self.model.manifest, rows=row[None, :], end=state[None, :], values=run.numbers.values
        )
        estimates = tuple(
            _of_reductions(runs, item) if item.name in self._reduced else self._estimate(view, item, run, None)
            for item in self.quantities
        )
        track = None if laid is None else laid.track
        return Values(estimates=estimates, track=track, row=row, seconds=seconds, steps=steps, rejected=rejected), laid

    def _lay(self, run: Run, ends: Array, row: Array, noded: Sequence[Quantity]) -> _Laid:
        """Lay nodes within the steps of a run, as fine as the signals need, and follow it along them."""
        windows = run_windows(run.model, run.numbers, (run.begin, run.end), run.turn, run.start)
        (segments,) = joined_segments(windows, all_=True)
        edges = make_edges(run, segments, None)
        # what is resolved: integrals, and extremes that the reductions do not hold
        channels = dict.fromkeys(item.channel for item in noded if not self._is_found(item))
        steep = [item.channel for item in noded if _kind(item).steep]
        # states are smooth where contacts begin
        kinks = (ends[:, 1] > 0.0) & any(name not in self.model.states for name in channels)
        panels = uniform_panels(edges, run.turn) if self._still else panels_between(edges, ends[:, 0], kinks)
        passages = Passages(times=np.zeros(0), edges=(), near=0.0)
        for _ in range(PASSES):
            plan = plan_of(panels, edges)
            track = follow(run, segments, edges, place(plan, edges), still=self._still)
            signals = self._channels.along(track, run.numbers)
            if not channels or passages.edges:
                break
            parts = self._parts(panels, signals, track.nodes, channels, steep)
            finer = split(panels, parts)
            found = find_passages(run, track)
            times = self._kinks(track, signals, noded, run)
            if found.edges:
                passages = found
                edges = with_passages(edges, passages.times, np.zeros((len(passages.times), 0)))
                finer = panels_between(edges, ends[:, 0], kinks)
            finer = cut_at(finer, edges, times)
            if finer is panels:
                break
            panels = finer
            if not self._still:  # steps are fine enough to tell how fine they have to be
                plan = plan_of(panels, edges)
                track = follow(run, segments, edges, place(plan, edges))
                signals = self._channels.along(track, run.numbers)
                break
        asked = [(item, kind) for item in noded for kind in _kind(item).extremes]
        extremes = self._extremes(run, asked, track, signals, row)
        if passages.edges:
            extremes = {key: [_beside(one, edges, passages) for one in some] for key, some in extremes.items()}
        return _Laid(
            segments=segments,
            edges=edges,
            passages=passages,
            panels=panels,
            plan=plan,
            track=track,
            signals=signals,
            extremes=extremes,
        )

    def _parts(
        self,
        panels: Panels,
        signals: Mapping[str, Signal],
        nodes: Nodes,
        channels: Iterable[str],
        steep: Iterable[str],
    ) -> NDArray[np.int_]:
        """Into how many parts each panel is to be split; none where there would be too many."""
        within = np.flatnonzero(nodes.weight)
        each = [signals[name].value[within] for name in channels]
        # what is integrated of loads is steeper than they are
        each += [np.maximum(signals[name].value[within], 0.0) ** 3 for name in steep]
        parts = parts_needed(each, self._rough)
        return parts if len(GAUSS) * np.sum(parts) <= max(MOST, 2 * len(GAUSS) * len(panels)) else np.ones_like(parts)

    def _is_found(self, quantity: Quantity) -> bool:
        """Whether its moments are known before nodes are laid: places, and extremes that the steps hold.

        The most loaded ball carries least where two change rank, which steps do not end on.
        """
        kind = _kind(quantity)
        if kind.at_moment:
            return True
        top = set(kind.extremes) <= {"max"} or quantity.channel in self.model.states
        return bool(kind.extremes) and top and self._is_held(quantity)

    def _is_held(self, quantity: Quantity) -> bool:
        return is_reduced(self.model, quantity) and not (self._still or self._along_nodes)

    def _check_memory(self, nodes: int, directions: int) -> None:
        """Refuse nodes that would not fit into memory, before any is laid."""
        derivatives = f" and derivatives by {directions} parameters" if directions else ""
        check_memory(
            f"{nodes} nodes, with states{derivatives}, of",
            nodes,
            max(len(self.model.states), 1) * (VALUES + SLOPES * directions),
            "Take a shorter run, or fewer parameters at a time.",
        )

    def _row(self, run: Run) -> Array:
        """An empty row of reductions, of what the quantities need."""
        needed = {name for item in self._moving if is_reduced(self.model, item) for name in needs(item)}
        if self._motion:
            needed |= set(self.model.states)
        return np.asarray(reduction_rows(self.model.manifest).empty(1, run.start, needed)[0])

    def _estimate(self, view: View | None, quantity: Quantity, run: Run, chain: Chain | None) -> Estimate:
        kind = _kind(quantity)
        if kind.at_rest is not None:
            return kind.at_rest(self.model, run.numbers, quantity, chain)
        assert kind.evaluate is not None
        assert view is not None  # something moves
        return kind.evaluate(view, quantity)

    def _nodes(
        self, run: Run, laid: _Laid, edges: Edges, plan: NodePlan, chain: Chain | None
    ) -> tuple[Nodes, dict[tuple[str, str], Mark]]:
        """Nodes of a plan and of the places asked for."""
        nodes = place(plan, edges)
        marks: dict[tuple[str, str], Mark] = {}
        manifest = self.model.manifest
        for item in self._moving if chain is not None else self._noded:
            if not _kind(item).at_moment:
                continue
            time, moment = place_of(manifest, run.numbers, run.end, item)
            slope = edges.slopes[-1]
            if chain is not None:
                slope = place_slope(manifest, run.numbers, moment, time, slope, chain.derivative)
            marks[item.name, "place"] = Mark(node=len(nodes), time=time, value=math.nan, ball=0)
            nodes = _appended(nodes, edges, time, slope, moment)
        return nodes, marks

    def _kinks(self, track: Track, signals: Mapping[str, Signal], noded: Sequence[Quantity], run: Run) -> Array:
        """Times of kinks of channels that are integrated, beside those that steps end on [s]."""
        summed = [item for item in noded if not (_kind(item).extremes or _kind(item).at_moment)]
        channels = [item.channel for item in summed if item.channel not in self.model.states]
        if self._still or not channels:
            return np.zeros(0)
        of_balls = [item for item in summed if ".ball." in f".{item.channel}"]
        ranked = dict.fromkeys(item.channel for item in of_balls if item.ball is None and not _kind(item).steep)
        tables = [signals[name].value for name in ranked]
        bearings, stops = self.model.manifest.bearings, self.model.manifest.stops
        # a corner of the damping at rest is in the force of each ball, and not in the motion
        corner = bool(of_balls) and any(bearing.damping.corner_at_rest for bearing in bearings)
        deflections: list[Array] = []
        if run.kinks != LOCATED or corner:
            # among the quantities of every bearing, whether or not the scene's outputs name it
            names = [bearing.prefix + DEFLECTION for bearing in bearings] + [*stops]
            found = ChannelValues(self.model, names).along(track, run.numbers)
            deflections = [found[name].value for name in names]
        nodes = track.nodes
        return np.array(
            find_kinks(
                nodes.t,
                nodes.segment,
                deflections,
                tables,
                one_sided=corner,
                length=run.duration,
                edges=track.edges.times,
            )
        )

    def _extremes(
        self,
        run: Run,
        asked: Sequence[tuple[Quantity, str]],
        track: Track,
        signals: Mapping[str, Signal],
        row: Array,
    ) -> dict[tuple[str, str], list[Extreme]]:
        """Extremes of all quantities that need some, and the next ones."""
        rows = reduction_rows(self.model.manifest)

        def wanted(item: Quantity, kind: str) -> Wanted:
            seen = float(row[rows.column(f"{kind}_time", item.channel)]) if self._is_held(item) else None
            ball = None if item.ball is None else item.ball - 1
            sign = 1.0 if kind == "max" else -1.0
            return Wanted(channel=item.channel, ball=ball, sign=sign, seen=seen, exact=self._is_found(item))

        def look(nodes: Nodes) -> Mapping[str, Signal]:
            seen = follow(run, track.segments, track.edges, nodes, still=self._still)
            return self._channels.along(seen, run.numbers)

        if not asked:
            return {}
        each = [wanted(item, kind) for item, kind in asked]
        distinct = list(dict.fromkeys(each))
        found = dict(zip(distinct, find_extremes(distinct, track, signals, look), strict=True))
        return {(item.name, kind): found[one] for (item, kind), one in zip(asked, each, strict=True)}


def _kind(quantity: Quantity) -> Kind:
    return KINDS[quantity.kind]


def needs(quantity: Quantity) -> tuple[str, ...]:
    """Channels that are reduced for a quantity."""
    kind = _kind(quantity)
    return kind.needs(quantity.channel) if kind.needs is not None else (quantity.channel,)


def is_reduced(model: LoadedModel, quantity: Quantity) -> bool:
    """Whether the reductions of a run hold a quantity."""
    if _kind(quantity).reduced is None or quantity.ball is not None or not model.states:
        return False
    known = reduction_rows(model.manifest)
    return set(needs(quantity) or (quantity.channel,)) <= set(known.channels if needs(quantity) else known.states)


def _of_reductions(runs: ReducedRuns, quantity: Quantity) -> Estimate:
    kind = _kind(quantity)
    assert kind.reduced is not None
    time = ball = None
    if kind.extremes:
        which = kind.extremes[0]
        if len(kind.extremes) == 1:
            time = float(runs.entry(f"{which}_time", quantity.channel)[0])
            ball = int(runs.entry(f"{which}_ball", quantity.channel)[0]) or None
    return Estimate(value=float(kind.reduced(runs, quantity)[0]), slope=np.zeros(0), time=time, ball=ball)


def _appended(nodes: Nodes, edges: Edges, time: float, slope: Array, moment: Moment) -> Nodes:
    """Nodes with one more at a time of its own; at an edge the loads behind it hold, at the end those before."""
    segment, _ = find(edges, time)
    return Nodes(
        t=np.append(nodes.t, edges.times[-1] if moment.kind == "end" else time),
        weight=np.append(nodes.weight, 0.0),
        segment=np.append(nodes.segment, segment),
        fraction=np.append(nodes.fraction, math.nan),
        held=np.append(nodes.held, edges.segment[segment]),
        slope=np.vstack([nodes.slope, slope[None, :]]),
        weight_slope=np.vstack([nodes.weight_slope, np.zeros((1, len(slope)))]),
    )


def _node(plan: NodePlan, point: tuple[int, float]) -> int:
    """The node of a plan that has this interval and fraction."""
    return int(np.flatnonzero((plan.segment == point[0]) & (plan.fraction == point[1]))[0])


def _mark(extreme: Extreme, plan: NodePlan) -> Mark:
    """An extreme, with its node in a plan that has its point."""
    return replace(_plain_mark(extreme), node=_node(plan, (extreme.segment, extreme.fraction)))


def _plain_mark(extreme: Extreme) -> Mark:
    """An extreme whose node does not matter: no derivative is asked for."""
    return Mark(
        node=0,
        time=extreme.time,
        value=extreme.value,
        ball=extreme.column,
        other=extreme.other,
        rate=extreme.rate,
        other_rate=extreme.other_rate,
        at_edge=min(extreme.fraction, 1.0 - extreme.fraction) < AT_EDGE,
    )


def _around(laid: _Laid, extreme: Extreme) -> tuple[tuple[int, float], ...]:
    """Points before and behind an extreme, within its panel; none where that ends beside it."""
    panels = laid.panels
    ends = panels.at(np.array([0.0, 1.0]))[0]
    inside = (panels.segment == extreme.segment) & (ends[:, 0] <= extreme.fraction) & (extreme.fraction <= ends[:, 1])
    if not np.any(inside) or extreme.other is not None:
        return ()
    low, high = ends[int(np.flatnonzero(inside)[0])].tolist()
    distance = min(AROUND * (high - low), min(extreme.fraction - low, high - extreme.fraction) / (BESIDE + 0.1))
    if distance < NEAREST * (high - low):
        return ()
    return tuple((extreme.segment, extreme.fraction + j * distance) for j in range(-BESIDE, BESIDE + 1) if j)


def _beside(extreme: Extreme, edges: Edges, passages: Passages) -> Extreme:
    """An extreme where a load begins or ends is at the corner of what the load drives, and moves with it."""
    beside = np.flatnonzero(np.abs(passages.times - extreme.time) < passages.near)
    if not len(beside):
        return extreme
    edge = int(np.searchsorted(edges.times, passages.times[beside[0]]))
    return replace(extreme, segment=edge - 1, fraction=1.0)
