"""Evaluate quantities of interest along a run, with or without their derivatives.

In: a model, quantities, run settings (`Study`).  Out: `Estimate` for each quantity.

`measure` runs once and gives values: what difference quotients are made of.  `differentiate` runs twice: first plainly,
to see where the extremes lie, then with derivatives along parameters and nodes at the extremes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.ask.between_nodes import Extreme, find_extreme
from ballpass.runtime.ask.kinds import KINDS
from ballpass.runtime.ask.kinks import DEFLECTION, Kink, find_kinks
from ballpass.runtime.ask.moving_kinks import released
from ballpass.runtime.ask.nodes import (
    Edges,
    Nodes,
    Plan,
    Window,
    find,
    make_edges,
    place,
    uniform_plan,
    with_kinks,
    with_points,
)
from ballpass.runtime.ask.quantity_location import Place, place_of, place_slope
from ballpass.runtime.ask.quantity_records import Estimate, Mark, Quantity, View
from ballpass.runtime.ask.static import at_rest
from ballpass.runtime.ask.track import Outlook, Signal, Stepping, Track, follow
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.run import inputs as clock
from ballpass.runtime.run.reduced_run import check_span
from ballpass.runtime.run.request import check_memory
from ballpass.runtime.run.sensitivity import Chain

Array = NDArray[np.float64]

#: Fractions nearer than this to an edge are at it.
AT_EDGE = 1e-12

#: Numbers that a node takes for each state, and those that each direction adds: states, channels, and what they are
#: made of, on the way from the driver to the quantities.  Lanes without a direction are counted where they are made.
VALUES, SLOPES = 16, 8

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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prepared:
    """A run laid out, ready to be followed by any integrator.

    Attributes
    ----------
    numbers, chain : of the run, and the derivatives of its numbers
    edges, nodes : where it is looked at, and how that moves
    marks : moments of extremes and places
    track : where the stepper has followed it already, for it had to find how kinks move
    """

    numbers: Numbers
    chain: Chain
    edges: Edges
    nodes: Nodes
    marks: dict[tuple[str, str], Mark]
    track: Track | None


class Study:
    """Quantities along runs of one model.

    Parameters
    ----------
    model : the model
    quantities : what is asked for
    span : how long to run
    per_turn : nodes in a turn
    """

    def __init__(self, model: LoadedModel, quantities: Sequence[Quantity], span: Span, per_turn: int) -> None:
        self.model = model
        self.quantities = tuple(quantities)
        self.span = span
        self.per_turn = per_turn
        self._moving = [quantity for quantity in quantities if not KINDS[quantity.kind].static]
        self._outlook = Outlook(model, [quantity.channel for quantity in self._moving])

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

    def _check_memory(self, window: Window, directions: int = 0) -> None:
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

    def measure(self, numbers: Numbers, stepping: Stepping) -> Course:
        """Values of all quantities.

        Raises
        ------
        RequestError
            A place that the run does not reach.
        SimulationError
            The computation failed.
        """
        if not self._moving:
            return self._all_at_rest(numbers, None)
        window = self.window(numbers)
        self._check_memory(window)
        edges = make_edges(self.model, numbers, window)
        track, places = self._follow(numbers, edges, uniform_plan(edges, self.per_turn), stepping, None)
        regular = self._regular(track)
        extremes = self._extremes(numbers, regular, stepping)
        if self._kinked:
            edges = with_kinks(edges, [kink.time for kink in self._kinks(numbers, regular)])
            track, places = self._follow(numbers, edges, uniform_plan(edges, self.per_turn), stepping, None)
        # extremes are values already: they need no node
        view = View(
            manifest=self.model.manifest,
            numbers=numbers,
            window=edges.window,
            nodes=track.nodes,
            signals=self._outlook.look(track, numbers),
            marks=places,
            slopes=lambda _: np.zeros(0),
            directions=0,
        )
        return Course(track=track, estimates=tuple(self._value(view, item, extremes) for item in self.quantities))

    def _value(self, view: View, quantity: Quantity, extremes: dict[tuple[str, str], Extreme]) -> Estimate:
        kinds = KINDS[quantity.kind].extremes
        if not kinds:
            return self._estimate(view, quantity, None)
        found = [extremes[quantity.name, kind] for kind in kinds]
        value = found[0].value - (found[1].value if len(found) > 1 else 0.0)
        several = view.signals[quantity.channel].value.shape[1] > 1
        single = len(found) == 1
        return Estimate(
            value=value,
            slope=np.zeros(0),
            time=found[0].time if single else None,
            ball=found[0].column + 1 if several and single else None,
        )

    def differentiate(self, numbers: Numbers, names: Sequence[str], stepping: Stepping) -> Course:
        """Values of all quantities and their derivatives along parameters.

        Raises
        ------
        RequestError
            An unknown parameter, or several loads that switch at one time.
        SimulationError
            The computation failed.
        """
        chain = Chain(self.model, numbers, names)
        prepared = self.prepare(numbers, chain, stepping)
        if prepared is None:
            return self._all_at_rest(numbers, chain)
        track = prepared.track or follow(self.model, numbers, prepared.edges, prepared.nodes, stepping, chain)
        return self.finish(prepared, track)

    def prepare(self, numbers: Numbers, chain: Chain, stepping: Stepping) -> Prepared | None:
        """Find extremes and kinks, and lay nodes accordingly; None where nothing needs to be run."""
        if not self._moving:
            return None
        directions, window = len(chain.names), self.window(numbers)
        self._check_memory(window, directions)
        edges = make_edges(self.model, numbers, window, chain.derivative, directions)
        extremes: dict[tuple[str, str], Extreme] = {}
        kinks: tuple[Kink, ...] = ()
        if self._kinked or any(KINDS[item.kind].extremes for item in self._moving):
            plainly, _ = self._follow(numbers, edges, uniform_plan(edges, self.per_turn), stepping, None)
            regular = self._regular(plainly)
            extremes = self._extremes(numbers, regular, stepping)
            kinks = self._kinks(numbers, regular) if self._kinked else ()
        broken = with_kinks(edges, [kink.time for kink in kinks])
        extremes = {key: _moved(item, edges, broken) for key, item in extremes.items()}
        edges = broken
        points = list(dict.fromkeys((item.segment, item.fraction) for item in extremes.values()))
        full = with_points(uniform_plan(edges, self.per_turn), points)
        nodes, marks = self._nodes(numbers, edges, full, chain)
        track = None
        if kinks:
            track = follow(self.model, numbers, edges, nodes, stepping, chain)
            track = released(self.model, numbers, track, self._regular(track), full, kinks, chain)
            nodes, edges = track.nodes, track.edges
        for key, item in extremes.items():
            here = np.flatnonzero((full.segment == item.segment) & (full.fraction == item.fraction))
            marks[key] = Mark(
                node=int(here[0]),
                time=item.time,
                ball=item.column,
                other=item.other,
                rate=item.rate,
                other_rate=item.other_rate,
                runner_up=item.runner_up,
                at_edge=min(item.fraction, 1.0 - item.fraction) < AT_EDGE,
            )
        return Prepared(numbers=numbers, chain=chain, edges=edges, nodes=nodes, marks=marks, track=track)

    def finish(self, prepared: Prepared, track: Track) -> Course:
        """Quantities and their derivatives from a track along the nodes that were prepared."""
        view = self._view(prepared, self._outlook.look(track, prepared.numbers, prepared.chain))
        estimates = tuple(self._estimate(view, item, prepared.chain) for item in self.quantities)
        return Course(track=track, estimates=estimates)

    def _view(self, prepared: Prepared, signals: Mapping[str, Signal]) -> View:
        return View(
            manifest=self.model.manifest,
            numbers=prepared.numbers,
            window=prepared.edges.window,
            nodes=prepared.nodes,
            signals=signals,
            marks=prepared.marks,
            slopes=prepared.chain.derivative,
            directions=len(prepared.chain.names),
        )

    def _all_at_rest(self, numbers: Numbers, chain: Chain | None) -> Course:
        """The quantities where all are static."""
        estimates = tuple(at_rest(self.model, numbers, item, chain) for item in self.quantities)
        return Course(track=None, estimates=estimates)

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

    def _follow(
        self, numbers: Numbers, edges: Edges, plan: Plan, stepping: Stepping, chain: Chain | None
    ) -> tuple[Track, dict[tuple[str, str], Mark]]:
        """The run along a plan and the places asked for."""
        nodes, marks = self._nodes(numbers, edges, plan, chain)
        return follow(self.model, numbers, edges, nodes, stepping, chain), marks

    @property
    def _kinked(self) -> bool:
        """Whether an integral over an output of the balls is asked for."""
        return any(
            not KINDS[item.kind].extremes and item.kind != "value" and item.channel.startswith(BROKEN)
            for item in self._moving
        )

    def _regular(self, track: Track) -> Track:
        """The track without the places asked for: nodes in order of time."""
        places = sum(item.kind in ("value", "end") for item in self._moving)
        return track.part(np.arange(len(track.nodes) - places))

    def _kinks(self, numbers: Numbers, track: Track) -> tuple[Kink, ...]:
        """Kinks of the outputs of the balls."""
        manifest, nodes, edges = self.model.manifest, track.nodes, track.edges
        ranked = [item.channel for item in self._moving if item.channel.startswith("ball.") and item.ball is None]
        ranked = list(dict.fromkeys(ranked))
        # among the quantities of every bearing, whether or not the scene's outputs name it
        deflections = [DEFLECTION] if manifest.bearing is not None else []
        signals = Outlook(self.model, [*ranked, *deflections]).look(track, numbers)
        deflection = signals[DEFLECTION].value if deflections else np.zeros((len(nodes), 0))
        return find_kinks(
            nodes.t,
            nodes.segment,
            deflection,
            {name: signals[name].value for name in ranked},
            one_sided=manifest.bearing is not None and manifest.bearing.damping_law == "one-sided",
            length=edges.window.duration,
            edges=edges.times,
        )

    def _extremes(self, numbers: Numbers, regular: Track, stepping: Stepping) -> dict[tuple[str, str], Extreme]:
        """Extremes of all quantities that need some."""
        wanted = [(item, kind) for item in self._moving for kind in KINDS[item.kind].extremes]
        if not wanted:
            return {}
        signals = self._outlook.look(regular, numbers)
        found: dict[tuple[str, str], Extreme] = {}
        done: dict[tuple[str, int | None, str], Extreme] = {}
        for item, kind in wanted:
            key = (item.channel, item.ball, kind)
            if key not in done:
                done[key] = find_extreme(
                    self.model,
                    numbers,
                    regular,
                    signals[item.channel].value,
                    item.channel,
                    sign=1.0 if kind == "max" else -1.0,
                    ball=None if item.ball is None else item.ball - 1,
                    stepping=stepping,
                )
            found[item.name, kind] = done[key]
        return found


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


def _moved(extreme: Extreme, edges: Edges, broken: Edges) -> Extreme:
    """An extreme found between edges, told in those with kinks: on the same side where it lies at an edge."""
    if not broken.kinks:
        return extreme
    if extreme.fraction in (0.0, 1.0):
        edge = edges.times[extreme.segment + int(extreme.fraction)]
        segment = int(np.searchsorted(broken.times, edge)) - int(extreme.fraction)
        return replace(extreme, segment=segment)
    segment, fraction = find(broken, extreme.time)
    return replace(extreme, segment=segment, fraction=fraction)
