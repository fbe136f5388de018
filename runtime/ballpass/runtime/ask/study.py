"""Evaluate quantities of interest along a run, with or without their derivatives.

In: a model, quantities, run settings (`Study`).  Out: `Estimate` for each quantity.

A plain run with reductions shows where the extremes and the kinks lie; the run that counts has nodes there, and with
`differentiate` derivatives along parameters.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.ask.between_nodes import Extreme, Wanted, find_extremes
from ballpass.runtime.ask.kinds import KINDS
from ballpass.runtime.ask.kinks import DEFLECTION, find_kinks
from ballpass.runtime.ask.nodes import (
    Edges,
    Nodes,
    Plan,
    Window,
    find,
    make_edges,
    place,
    with_kinks,
    with_points,
)
from ballpass.runtime.ask.panels import (
    GAUSS,
    ROUGH,
    Panels,
    between_kinks,
    parts_needed,
    plan_of,
    split,
    uniform_panels,
)
from ballpass.runtime.ask.passages import Passages, find_passages
from ballpass.runtime.ask.quantity_location import Place, place_of, place_slope
from ballpass.runtime.ask.quantity_records import Estimate, Mark, Quantity, View
from ballpass.runtime.ask.static import at_rest
from ballpass.runtime.ask.track import Outlook, Signal, Stepping, Track, depends, follow, jumps
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.reduction_rows import reduction_rows
from ballpass.runtime.run import inputs as clock
from ballpass.runtime.run.directions import Chain
from ballpass.runtime.run.reduced_run import check_span
from ballpass.runtime.run.request import check_memory

Array = NDArray[np.float64]

#: Fractions nearer than this to an edge are at it.
AT_EDGE = 1e-12

#: Numbers that a node takes for each state, and those that each direction adds: states, channels, and what they are
#: made of, on the way from the driver to the quantities.  Lanes without a direction are counted where they are made.
VALUES, SLOPES = 16, 8

#: Kinds that look at one moment, wherever nodes lie.
AT_A_MOMENT = ("value", "end")

#: Passes that make panels finer, and the most nodes that they may come to.
PASSES, MOST = 6, 2**17

#: Outputs with kinks where contacts begin and end.
BROKEN = ("ball.", "ring_force.")


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """How long to run: turns, or seconds; and how much of it is transient [turns]."""

    cycles: float | None
    duration: float | None
    transient: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Course:
    """A run and its quantities.

    Attributes
    ----------
    track : states along the nodes; None where all quantities are static, so that nothing was run
    estimates : one for each quantity
    """

    track: Track | None
    estimates: tuple[Estimate, ...]


class Study:
    """Quantities along runs of one model.

    Parameters
    ----------
    model : the model
    quantities : what is asked for
    span : how long to run
    per_turn : nodes in a turn to begin with; panels get finer where the signals need it
    rough : see `panels.parts_needed` [1]
    """

    def __init__(
        self, model: LoadedModel, quantities: Sequence[Quantity], span: Span, per_turn: int, *, rough: float = ROUGH
    ) -> None:
        self.model = model
        self.quantities = tuple(quantities)
        self.span = span
        self.per_turn = per_turn
        self.rough = rough
        self._panels: Panels | None = None
        self._moving = [quantity for quantity in quantities if not KINDS[quantity.kind].static]
        channels = [quantity.channel for quantity in self._moving]
        channels += [
            quantity.channel.removesuffix("ball.force") + name
            for quantity in self._moving
            for name in KINDS[quantity.kind].beside
        ]
        self._summed = list(dict.fromkeys(item.channel for item in self._moving if item.kind not in AT_A_MOMENT))
        self._loads = list(dict.fromkeys(item.channel for item in self._moving if KINDS[item.kind].of_loads))
        self._outlook = Outlook(model, channels)
        # outputs that follow from time alone need no integration
        self._still = all(name in model.outputs and not depends(model, name, "x") for name in channels)

    def window(self, numbers: Numbers) -> Window:
        """The time that counts.

        Raises
        ------
        RequestError
            Nothing turns, and turns were asked for.
        """
        turn = clock.period(self.model.manifest, numbers.values)
        span = self.span
        if not np.isfinite(turn) and (span.cycles is not None or span.transient > 0.0):
            raise RequestError("Nothing turns in this model (its speed is zero): give duration, and transient = 0.")
        duration = float(span.cycles) * turn if span.cycles is not None else float(span.duration or 0.0)
        start = check_span(duration, turn, span.transient)
        return Window(duration=duration, start=start, turn=turn, cycles=span.cycles, transient=span.transient)

    def measure(self, numbers: Numbers, stepping: Stepping) -> Course:
        """Values of all quantities.

        Raises
        ------
        RequestError
            A place that the run does not reach.
        SimulationError
            The computation failed.
        """
        return self._course(numbers, None, stepping)

    def differentiate(self, numbers: Numbers, names: Sequence[str], stepping: Stepping) -> Course:
        """Values of all quantities and their derivatives along parameters.

        Raises
        ------
        RequestError
            An unknown parameter, several loads that switch at one time, or an extreme of an output that jumps at the
            edge of a window whose time the motion decides.
        SimulationError
            The computation failed.
        """
        for item in self._moving:
            if KINDS[item.kind].extremes and jumps(self.model, item.channel):
                raise RequestError(
                    f"{item.name}: the driver's angle is a state, and {item.channel} jumps where a load within a "
                    "window of that angle begins or ends; on which side of the jump the extreme is, is not followed. "
                    "Allowed: extremes of states, forces of balls and all else that does not jump; means and integrals "
                    "of all. Or give the load as a table over the angle, with flanks as steep as they are."
                )
        return self._course(numbers, Chain(self.model, numbers, names), stepping)

    def _course(self, numbers: Numbers, chain: Chain | None, stepping: Stepping) -> Course:
        """Find extremes and kinks in a plain run, lay nodes accordingly, and run along them."""
        directions = 0 if chain is None else len(chain.names)
        if not self._moving:
            estimates = tuple(at_rest(self.model, numbers, item, chain) for item in self.quantities)
            return Course(track=None, estimates=estimates)
        window = self.window(numbers)
        self._check_memory(window, directions)
        edges = make_edges(self.model, numbers, window, None if chain is None else chain.derivative, directions)
        extremes: dict[tuple[str, str], list[Extreme]] = {}
        panels = uniform_panels(edges, self.per_turn) if self._panels is None else self._panels
        if self._summed:
            track, row, panels = self._resolve(numbers, edges, panels, stepping)
            asked = [(item, kind) for item in self._moving for kind in KINDS[item.kind].extremes]
            extremes = self._extremes(numbers, asked, track, row, stepping)
            if chain is None:  # the next ones matter to derivatives alone
                extremes = {key: some[:1] for key, some in extremes.items()}
            if self._kinked or self.model.manifest.edges:
                passages = find_passages(self.model, numbers, track, stepping, chain)
                kinks = self._kinks(numbers, track, passages.times) if self._kinked else []
                broken = with_kinks(edges, kinks, passages.times, passages.slopes)
                extremes = {
                    key: [_moved(item, edges, broken, passages) for item in some] for key, some in extremes.items()
                }
                edges, panels = broken, between_kinks(panels, edges, broken)
        points = list(dict.fromkeys((item.segment, item.fraction) for some in extremes.values() for item in some))
        plan = with_points(plan_of(panels, edges), points)
        nodes, marks = self._nodes(numbers, edges, plan, chain)
        for key, some in extremes.items():
            first, *others = (_mark(item, plan) for item in some)
            marks[key] = replace(first, rivals=tuple(others))
        track = follow(self.model, numbers, edges, nodes, stepping, chain, still=self._still)
        view = View(
            manifest=self.model.manifest,
            numbers=numbers,
            window=edges.window,
            nodes=nodes,
            signals=self._outlook.look(track, numbers, chain),
            marks=marks,
            slopes=chain.derivative if chain is not None else lambda _: np.zeros(0),
            names=() if chain is None else chain.names,
        )
        return Course(track=track, estimates=tuple(self._estimate(view, item, chain) for item in self.quantities))

    def _resolve(
        self, numbers: Numbers, edges: Edges, panels: Panels, stepping: Stepping
    ) -> tuple[Track, Array | None, Panels]:
        """A plain run, its reductions, and panels as fine as the signals need, unless they are fixed."""
        most = max(MOST, 2 * len(GAUSS) * len(panels))
        for _ in range(PASSES):
            row = None if self._still else self._row(edges.window)
            nodes = place(plan_of(panels, edges), edges)
            track = follow(self.model, numbers, edges, nodes, stepping, reduction=row, still=self._still)
            if self._panels is not None:
                break
            within = np.flatnonzero(nodes.weight)
            signals = self._outlook.look(track, numbers)
            each = [signals[name].value[within] for name in self._summed]
            # what is integrated of loads is steeper than they are
            each += [np.maximum(signals[name].value[within], 0.0) ** 3 for name in self._loads]
            parts = parts_needed(each, self.rough)
            if np.all(parts == 1) or len(GAUSS) * np.sum(parts) > most:
                break
            panels = split(panels, parts)
        return track, row, panels

    def fix(self, numbers: Numbers, stepping: Stepping) -> None:
        """Settle the panels by a run: neighbours are then cut alike, and quantities change smoothly between them.

        Not where outputs have kinks: panels that are fine where the kinks were would err by how far those have moved.
        """
        if self._summed and not self._kinked and not self.model.manifest.edges:
            edges = make_edges(self.model, numbers, self.window(numbers))
            _, _, self._panels = self._resolve(numbers, edges, uniform_panels(edges, self.per_turn), stepping)

    def _check_memory(self, window: Window, directions: int) -> None:
        """Refuse nodes that would not fit into memory, before any is laid."""
        length = window.duration - window.start
        nodes = self.per_turn * (length / window.turn if np.isfinite(window.turn) else length / window.duration)
        derivatives = f" and derivatives by {directions} parameters" if directions else ""
        check_memory(
            f"{nodes:.10g} nodes, with states{derivatives}, of",
            nodes,
            max(len(self.model.states), 1) * (VALUES + SLOPES * directions),
            f"Take a shorter run, samples_per_cycle below {self.per_turn}, or fewer parameters at a time.",
        )

    def _row(self, window: Window) -> Array:
        """An empty row of reductions from the end of the transient on, which may lie a rounding beside its edge."""
        channels = [item.channel for item in self._moving]
        start = window.start * (1.0 - AT_EDGE)
        return np.asarray(reduction_rows(self.model.manifest).empty(1, start, channels)[0])

    def _estimate(self, view: View, quantity: Quantity, chain: Chain | None) -> Estimate:
        evaluate = KINDS[quantity.kind].evaluate
        return at_rest(self.model, view.numbers, quantity, chain) if evaluate is None else evaluate(view, quantity)

    def _nodes(
        self, numbers: Numbers, edges: Edges, plan: Plan, chain: Chain | None
    ) -> tuple[Nodes, dict[tuple[str, str], Mark]]:
        """Nodes of a plan and of the places asked for."""
        nodes = place(plan, edges)
        marks: dict[tuple[str, str], Mark] = {}
        manifest = self.model.manifest
        for item in self._moving:
            if item.kind not in ("value", "end"):
                continue
            time, kind = place_of(manifest, numbers, edges.window, item)
            slope = edges.slopes[-1]
            if chain is not None:
                slope = place_slope(manifest, numbers, kind, time, edges.slopes[-1], chain.derivative)
            marks[item.name, "place"] = Mark(node=len(nodes), time=time, ball=0)
            nodes = _appended(nodes, edges, time, slope, kind)
        return nodes, marks

    @property
    def _kinked(self) -> bool:
        """Whether an integral over an output with kinks is asked for: of the balls, or any where a stop is."""
        stops = self.model.manifest.stops
        bearings = self.model.manifest.bearings
        broken = tuple(bearing.prefix + name for bearing in bearings for name in BROKEN)
        # powers of loads are smooth where contacts begin, but not where a law has a corner or jumps
        rough = any(b.damping.corner_at_rest or b.damping.in_deflection == "discontinuous" for b in bearings)
        return any(
            not KINDS[item.kind].extremes
            and (rough or not KINDS[item.kind].of_loads)
            and item.kind != "value"
            and (stops or item.channel.startswith(broken))
            for item in self._moving
        )

    def _kinks(self, numbers: Numbers, track: Track, passages: Array) -> list[float]:
        """Times of kinks of the outputs of the balls, and of those that a stop changes."""
        nodes, edges, bearings = track.nodes, track.edges, self.model.manifest.bearings
        ranked = {
            item.channel
            for item in self._moving
            if ".ball." in f".{item.channel}" and item.ball is None and not KINDS[item.kind].of_loads
        }
        # among the quantities of every bearing, whether or not the scene's outputs name it
        deflections = [bearing.prefix + DEFLECTION for bearing in bearings] + [*self.model.manifest.stops]
        signals = Outlook(self.model, [*sorted(ranked), *deflections]).look(track, numbers)
        return find_kinks(
            nodes.t,
            nodes.segment,
            [signals[name].value for name in deflections],
            [signals[name].value for name in sorted(ranked)],
            one_sided=any(bearing.damping.corner_at_rest for bearing in bearings),
            length=edges.window.duration,
            edges=np.concatenate([edges.times, passages]),
        )

    def _extremes(
        self,
        numbers: Numbers,
        asked: Sequence[tuple[Quantity, str]],
        track: Track,
        row: Array | None,
        stepping: Stepping,
    ) -> dict[tuple[str, str], list[Extreme]]:
        """Extremes of all quantities that need some, and the next ones."""
        rows = reduction_rows(self.model.manifest)

        def wanted(item: Quantity, kind: str) -> Wanted:
            held = row is not None and item.ball is None and item.channel in rows.channels
            seen = float(row[rows.column(f"{kind}_time", item.channel)]) if row is not None and held else None
            ball = None if item.ball is None else item.ball - 1
            return Wanted(channel=item.channel, ball=ball, sign=1.0 if kind == "max" else -1.0, seen=seen)

        def look(nodes: Nodes) -> Mapping[str, Signal]:
            seen = follow(self.model, numbers, track.edges, nodes, stepping, still=self._still)
            return self._outlook.look(seen, numbers)

        if not asked:
            return {}
        each = [wanted(item, kind) for item, kind in asked]
        distinct = list(dict.fromkeys(each))
        signals = self._outlook.look(track, numbers)
        found = dict(zip(distinct, find_extremes(distinct, track, signals, look), strict=True))
        return {(item.name, kind): found[one] for (item, kind), one in zip(asked, each, strict=True)}


def _appended(nodes: Nodes, edges: Edges, time: float, slope: Array, kind: Place) -> Nodes:
    """Nodes with one more at a time of its own; at an edge the loads behind it hold, at the end those before."""
    segment, _ = find(edges, time)
    return Nodes(
        t=np.append(nodes.t, edges.times[-1] if kind.kind == "end" else time),
        weight=np.append(nodes.weight, 0.0),
        segment=np.append(nodes.segment, segment),
        slope=np.vstack([nodes.slope, slope[None, :]]),
        weight_slope=np.vstack([nodes.weight_slope, np.zeros((1, len(slope)))]),
    )


def _mark(extreme: Extreme, plan: Plan) -> Mark:
    """The node of an extreme in a plan that has its point."""
    here = np.flatnonzero((plan.segment == extreme.segment) & (plan.fraction == extreme.fraction))
    return Mark(
        node=int(here[0]),
        time=extreme.time,
        ball=extreme.column,
        other=extreme.other,
        rate=extreme.rate,
        other_rate=extreme.other_rate,
        at_edge=min(extreme.fraction, 1.0 - extreme.fraction) < AT_EDGE,
    )


def _moved(extreme: Extreme, edges: Edges, broken: Edges, passages: Passages) -> Extreme:
    """An extreme found between edges, told in those with kinks: on the same side where it lies at an edge.

    One where a load begins or ends is at the corner of what the load drives, and moves with it.
    """
    if not broken.kinks:
        return extreme
    beside = np.flatnonzero(np.abs(passages.times - extreme.time) < passages.near)
    if len(beside):
        edge = int(np.searchsorted(broken.times, passages.times[beside[0]]))
        return replace(extreme, segment=edge - 1, fraction=1.0)
    if extreme.fraction in (0.0, 1.0):
        edge = edges.times[extreme.segment + int(extreme.fraction)]
        segment = int(np.searchsorted(broken.times, edge)) - int(extreme.fraction)
        return replace(extreme, segment=segment)
    segment, fraction = find(broken, extreme.time)
    return replace(extreme, segment=segment, fraction=fraction)
