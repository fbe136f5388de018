"""The nodes within the steps of a run at which each quantity is evaluated.

In: a run, the ends of its steps, quantities.  Out: `Layout` of all that share their nodes.

A quantity's nodes depend only on itself and the run, so that its value is the same to the bit beside any others.
Integrals have Gauss's nodes in every step, and finer ones where their channel needs it; extremes that the steps do not
hold are searched between such nodes; a moment is a node of its own.  `causes_of` says at which cuts panels end.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.reduction_rows import DEFLECTION, EQUAL, reduction_rows
from ballpass.runtime.quantity.between_nodes import Wanted, find_extremes
from ballpass.runtime.quantity.cuts import Angles, crossings, find_passages, jumps_at, rank_differences, window_angles
from ballpass.runtime.quantity.location import place_of, place_slope
from ballpass.runtime.quantity.nodes import Cause, Cuts, Nodes, fixed_nodes, part_of_nodes, scheduled_cuts
from ballpass.runtime.quantity.panels import (
    GAUSS,
    Panels,
    bounds,
    cut_at,
    inner_nodes,
    interpolated,
    nodes_of,
    panels_of_steps,
    parts_needed,
    parts_of_oscillation,
    same_panels,
    split,
    whole_panels,
)
from ballpass.runtime.quantity.records import Kind, Mark, Quantity, View
from ballpass.runtime.quantity.registry import KINDS
from ballpass.runtime.quantity.track import ChannelValues, FollowedRun, Signal, Track, depends
from ballpass.runtime.request.locating import LOCATED, stepper_for
from ballpass.runtime.request.request import check_memory
from ballpass.runtime.request.resolve import Run
from ballpass.runtime.run.directions import Chain
from ballpass.runtime.run.loop import segments_of
from ballpass.runtime.time import timeline
from ballpass.runtime.time.turning import TURN

Array = NDArray[np.float64]

#: Passes that make panels of outputs of time alone finer, and the most nodes that panels may come to.
PASSES, MOST = 6, 2**19

#: Passes that cut panels where balls change rank: a third ball between two shows in the panels that end there.
RANKED = 2

#: Parts of each panel at least, where balls are followed over places of a raceway.
HATS = 4

#: Distance of the nodes around an extreme, as a share of its panel; what is nearer to its end is at a kink [1].
AROUND, NEAREST = 0.1, 1e-3

#: Nodes on either side of such an extreme.
BESIDE = 3

#: A ball that carries less than the most loaded one by more than this share becomes it in no panel [1].
NEAR_TOP = 0.5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Layout:
    """Nodes of a run, of the quantities that share them.

    Attributes
    ----------
    items : the quantities
    motion : the run
    causes : of cuts at which their panels end; none of moments, which have no panels
    cuts, panels : where nodes lie
    near : extremes as near as this to a cut where a window's edge is passed are at it [s]
    track, signals : states and channels along the nodes
    marks : moments; extremes by quantity and "max" or "min", the best first
    """

    items: tuple[Quantity, ...]
    motion: FollowedRun
    causes: frozenset[Cause]
    cuts: Cuts
    panels: Panels
    near: float
    track: Track
    signals: Mapping[str, Signal]
    marks: Mapping[tuple[str, str], list[Mark]]


class NodeLayer:
    """Lays nodes for quantities of one model.

    Parameters
    ----------
    model : the model
    channels : those of the quantities
    rough : see `panels.parts_needed` [1]
    along_nodes : quantities whose extremes are searched between nodes although reductions hold them
    """

    def __init__(
        self, model: LoadedModel, channels: ChannelValues, *, rough: float, along_nodes: Collection[Quantity]
    ) -> None:
        self.model = model
        self._channels, self._rough, self._along_nodes = channels, rough, along_nodes
        # among the quantities of every bearing, whether or not the scene's outputs name them
        names = [bearing.prefix + DEFLECTION for bearing in model.manifest.bearings]
        self._deflections = ChannelValues(model, [*names, *model.manifest.stops])
        self._windows = window_angles(model)

    def is_still(self, quantity: Quantity) -> bool:
        """Whether a quantity follows from time alone."""
        names = channels_of([quantity])
        return all(name not in self.model.states and not depends(self.model, name, "x") for name in names)

    def causes_of(self, quantity: Quantity) -> frozenset[Cause]:
        """Causes of cuts at which panels of a quantity end."""
        kind, output = kind_of(quantity), quantity.channel not in self.model.states
        if kind.at_moment:
            return frozenset()
        wanted = {
            Cause.SCHEDULE: True,
            # an extreme where a load begins moves with it, so that extremes need these cuts as well
            Cause.WINDOW: bool(self.model.manifest.edges) and not self.is_still(quantity),
            Cause.JUMP: output and kind.integrates and jumps_at(quantity.channel) is not None,
            # panels get finer towards kinks; states are smooth where contacts begin
            Cause.KINK: output and not self._is_found(quantity),
            Cause.RANK: output and kind.integrates and not kind.steep and _is_of_balls(quantity) and not quantity.ball,
        }
        return frozenset(cause for cause, whether in wanted.items() if whether)

    def lay(self, run: Run, kept: Array, row: Array, noded: Sequence[Quantity]) -> list[Layout]:
        """Nodes of all quantities, and the run along them.

        Parameters
        ----------
        kept : steps of the run, see `loop.KeptSteps`
        row : reductions of the run
        """
        segments = segments_of(run)
        groups: dict[tuple[bool, frozenset[Cause], str], list[Quantity]] = defaultdict(list)
        for item in noded:
            causes = self.causes_of(item) - {Cause.RANK}  # searched for each quantity, in panels that it shares
            groups[self.is_still(item), causes, item.channel if Cause.JUMP in causes else ""].append(item)
        found: list[Layout] = []
        for (still, causes, _), items in groups.items():
            motion = FollowedRun(run=run, segments=segments, kept=kept, still=still)
            here = self._first(motion, causes, tuple(items), scheduled_cuts(run, segments))
            for cause, angles in self.angles_of(here).items():
                passed = find_passages(motion, here.cuts, here.track, angles)
                if len(passed.times):
                    cuts = here.cuts.more(passed.times - passed.before, cause, passed.angle)
                    here = replace(self._first(motion, causes, here.items, cuts), near=10.0 * passed.before)
            # steps show at once how fine nodes have to be; a separate grid is refined repeatedly
            for one in self._finer(here, self._refined, PASSES if still else 1) if causes else [here]:
                found += self._finer(one, self._ranked, RANKED)
        return [self._with_extremes(one, row) for one in found]

    def angles_of(self, layout: Layout) -> dict[Cause, Angles]:
        """Angles that pass at cuts of a cause."""
        found = {}
        zero = jumps_at(layout.items[0].channel)
        if Cause.JUMP in layout.causes and zero is not None:
            channel = self._channels.only(channels_of(layout.items))
            found[Cause.JUMP] = Angles(channel=channel, zero=zero, which=[0], before=0.0)
        if Cause.WINDOW in layout.causes:
            found[Cause.WINDOW] = self._windows
        return found

    def _first(self, motion: FollowedRun, causes: frozenset[Cause], items: tuple[Quantity, ...], cuts: Cuts) -> Layout:
        """Moments; else panels that are steps, and the run along their nodes."""
        panels = self._panels(motion, cuts, causes) if causes else whole_panels(cuts)
        nodes, marks = (nodes_of(panels, cuts), {}) if causes else moments(motion.run, cuts, items)
        track = motion.along(nodes)
        return Layout(
            items=items,
            motion=motion,
            causes=causes,
            cuts=cuts,
            panels=panels,
            near=0.0,
            track=track,
            signals=self._channels.only(channels_of(items)).along(track, motion.run.numbers),
            marks={key: [mark] for key, mark in marks.items()},
        )

    def _panels(self, motion: FollowedRun, cuts: Cuts, causes: frozenset[Cause]) -> Panels:
        """Panels that are steps; of what follows from time alone even ones."""
        mechanism, manifest, run = self.model.manifest.mechanism, self.model.manifest, motion.run
        angle = "" if mechanism is None else mechanism.angle

        def turned(times: Array) -> Array:
            if not angle:
                return np.asarray(timeline.driver(manifest, run.numbers.values).at(times)[0] / TURN)
            distinct, back = np.unique(times, return_inverse=True)
            states = stepper_for(self.model, run.kinks).read(motion.kept, distinct)
            found = states[:, self.model.states.index(angle)][back].reshape(times.shape)
            return np.asarray(found / TURN)

        # what follows from time alone does not see where a torque has brought the driver
        asked = None if timeline.is_even(manifest, run.numbers.values) or (angle and motion.still) else turned
        steps = motion.kept[: 0 if motion.still else None]
        kinks = (steps[:, 1] > 0.0) & (Cause.KINK in causes)
        return panels_of_steps(cuts, steps[:, 0], kinks, run.stretch, asked)

    def _along(self, layout: Layout, panels: Panels) -> Layout:
        """The run along the nodes of panels; what the layout knows in panels that it has is taken from there."""
        motion, nodes = layout.motion, nodes_of(panels, layout.cuts)
        channels, numbers = self._channels.only(channels_of(layout.items)), motion.run.numbers
        here, there = (
            inner_nodes(one)[same].ravel()
            for one, same in zip((panels, layout.panels), same_panels(panels, layout.panels), strict=True)
        )
        new = np.delete(np.arange(len(nodes)), here)

        def joined(added: Array, known: Array) -> Array:
            every = np.empty((len(nodes), *added.shape[1:]))
            every[new], every[here] = added, known[there]
            return every

        part, known = motion.along(part_of_nodes(nodes, new)), layout.track
        signals = {
            name: Signal(
                value=joined(signal.value, layout.signals[name].value),
                slope=joined(signal.slope, layout.signals[name].slope),
            )
            for name, signal in channels.along(part, numbers).items()
        }
        track = replace(
            part,
            nodes=nodes,
            x=joined(part.x, known.x),
            slope=joined(part.slope, known.slope),
            local=joined(part.local, known.local),
            u=joined(part.u, known.u),
        )
        return replace(layout, panels=panels, track=track, signals=signals)

    def _finer(self, layout: Layout, panels_of: Callable[[Layout, Quantity], Panels], passes: int) -> list[Layout]:
        """Panels made finer for each quantity, at most so many times: those that need the same ones share them."""
        shared: dict[bytes, tuple[Panels, list[Quantity]]] = {}
        for item in layout.items:
            panels = panels_of(layout, item)
            shared.setdefault(panels.low.tobytes() + panels.begin.tobytes(), (panels, []))[1].append(item)
        found = []
        for panels, items in shared.values():
            here = replace(layout, items=tuple(items))
            if panels is not layout.panels:
                here = self._along(here, panels)
                found += self._finer(here, panels_of, passes - 1) if passes > 1 else [here]
            else:
                found.append(here)
        return found

    def _refined(self, layout: Layout, item: Quantity) -> Panels:
        """Panels as fine as a quantity needs, which end at its kinks."""
        if self._is_found(item):
            return layout.panels
        return cut_at(split(layout.panels, self._parts(layout, item)), layout.cuts, self._kinks(layout, item))

    def _ranked(self, layout: Layout, item: Quantity) -> Panels:
        """Panels that end where another ball becomes the most loaded one, for quantities of that ball.

        The balls' forces are smooth within the panels, so that two changes between two nodes are found as well.
        """
        if Cause.RANK not in self.causes_of(item):
            return layout.panels
        forces = layout.signals[item.channel].value[inner_nodes(layout.panels)]
        low, high = bounds(forces)
        close = np.count_nonzero(high >= np.max(low, axis=1, keepdims=True), axis=1) > 1
        t, segment, table = _between_nodes(layout, forces, close)
        signals, counts = rank_differences(segment, table)
        return cut_at(layout.panels, layout.cuts, crossings(t, segment, *signals.T, counts=counts.T))

    def _parts(self, layout: Layout, item: Quantity) -> NDArray[np.int_]:
        """Into how many parts each panel is to be split; none where there would be too many."""
        signal = layout.signals[item.channel].value[inner_nodes(layout.panels).ravel()]
        # integrands of loads are steeper than the loads
        each = [signal, *([np.maximum(signal, 0.0) ** 3] if kind_of(item).steep else [])]
        # places of a raceway are hat functions of the balls' angles, whose corners no panel ends at
        least = HATS if kind_of(item).beside else 1
        parts, most = np.maximum(parts_needed(each, self._rough), least), max(MOST, 2 * len(GAUSS) * len(layout.panels))
        if len(GAUSS) * np.sum(parts) > most:
            parts = np.ones_like(parts)
        oscillation = kind_of(item).frequency
        if oscillation is None:
            return parts
        view = View(run=layout.motion.run, nodes=layout.track.nodes, signals=layout.signals)
        faster = parts_of_oscillation(layout.panels, layout.cuts, oscillation(view, item)[0])
        nodes, columns = len(GAUSS) * int(np.sum(faster)), len(self.model.states) + signal.shape[1]
        check_memory(f"{item.name}: {nodes} nodes of", nodes, columns, "Ask for a lower frequency.")
        return np.maximum(parts, faster)

    def _kinks(self, layout: Layout, item: Quantity) -> Array:
        """Times of kinks of an integrated channel, beside those on which steps end [s]."""
        run = layout.motion.run
        # a corner of the damping at rest is in the force of each ball, and not in the motion
        corner = _is_of_balls(item) and any(bearing.damping.corner_at_rest for bearing in self.model.manifest.bearings)
        # a step as long as a turn meets a stop and leaves it, and shows neither
        known = run.kinks == LOCATED and not corner and not self.model.manifest.stops
        if known or not kind_of(item).integrates or Cause.KINK not in layout.causes or not self._deflections.channels:
            return np.zeros(0)
        values, rates = self._deflections.with_rates(layout.track, run.numbers)
        # where a body leaves a stop faster than the stop expands, its force stays at zero
        numbers = run.numbers.parameters
        stops = {stop: "mechanism.{}s.{}.hysteresis".format(*stop.split(".")) for stop in self.model.manifest.stops}
        columns = {stop: self._deflections.column(stop) for stop in stops}
        clips = [1.0 + numbers[name] * rates[:, [columns[stop]]] for stop, name in stops.items() if name in numbers]
        every, forces = [values, *clips], np.zeros((len(values), 0))
        if corner:
            # of one bearing, and of those balls that the quantity is of
            forces = layout.signals[item.channel].value
            first = self._deflections.column(item.channel.partition("ball.")[0] + DEFLECTION)
            every.append(rates[:, first : first + forces.shape[1]])
        signals = np.hstack([*every, forces])[inner_nodes(layout.panels)]
        count = signals.shape[2] - forces.shape[1]
        low, high = bounds(signals[:, :, :count])
        t, segment, signals = _between_nodes(layout, signals, np.any((low < 0.0) & (high > 0.0), axis=1))
        counts = np.ones((len(t), count), dtype=bool)
        counts[:, count - forces.shape[1] :] = _taking_part(item, signals[:, count:])
        return crossings(t, segment, *signals[:, :count].T, counts=counts.T)

    def _with_extremes(self, layout: Layout, row: Array) -> Layout:
        """The same with the extremes of its quantities, and the next ones."""
        asked = [(item, kind) for item in layout.items for kind in kind_of(item).extremes]
        if not asked:
            return layout
        run, channels = layout.motion.run, self._channels.only(channels_of(layout.items))
        rows = reduction_rows(self.model.manifest)

        def wanted(item: Quantity, kind: str) -> Wanted:
            seen = float(row[rows.columns[f"{kind}_time", item.channel]]) if self._is_held(item) else None
            ball = None if item.ball is None else item.ball - 1
            sign = 1.0 if kind == "max" else -1.0
            return Wanted(channel=item.channel, ball=ball, sign=sign, seen=seen, exact=self._is_found(item))

        def look(nodes: Nodes) -> Mapping[str, Signal]:
            return channels.along(layout.motion.along(nodes), run.numbers)

        each = [wanted(item, kind) for item, kind in asked]
        distinct = list(dict.fromkeys(each))
        nodes, equal = layout.track.nodes, max(run.rtol, EQUAL)
        extremes = find_extremes(distinct, layout.cuts, nodes, layout.signals, look, equal)
        found = {one: [_beside(mark, layout) for mark in some] for one, some in zip(distinct, extremes, strict=True)}
        marks = {(item.name, kind): found[one] for (item, kind), one in zip(asked, each, strict=True)}
        return replace(layout, marks=marks)

    def _is_found(self, quantity: Quantity) -> bool:
        """Whether its moments are known before nodes are laid: places, and extremes that the steps hold.

        The force of the most loaded ball has its minimum where another ball becomes the most loaded one; steps do not
        end there.
        """
        kind = kind_of(quantity)
        top = set(kind.extremes) <= {"max"} or quantity.channel in self.model.states
        return not kind.integrates and (kind.at_moment or (top and self._is_held(quantity)))

    def _is_held(self, quantity: Quantity) -> bool:
        return is_reduced(self.model, quantity) and quantity not in self._along_nodes


def kind_of(quantity: Quantity) -> Kind:
    """The kind of a quantity."""
    return KINDS[quantity.kind]


def channels_of(quantities: Iterable[Quantity]) -> list[str]:
    """Channels that quantities are evaluated from."""
    names: dict[str, None] = {}
    for item in quantities:
        beside = (item.channel.removesuffix("ball.force") + name for name in kind_of(item).beside)
        names |= dict.fromkeys((item.channel, *beside))
    return list(names)


def _between_nodes(layout: Layout, signals: Array, which: NDArray[np.bool_]) -> tuple[Array, NDArray[np.int_], Array]:
    """Times, intervals and signals at places between the nodes of some of the panels too."""
    rows = np.flatnonzero(which)
    return interpolated(layout.panels.some(rows), layout.cuts, signals[rows])


def _taking_part(item: Quantity, forces: Array) -> NDArray[np.bool_]:
    """Which balls a quantity is of at each place, shape of `forces`: the most loaded one, and those near to it."""
    if item.ball is not None:
        return np.broadcast_to(np.arange(forces.shape[1]) == item.ball - 1, forces.shape)
    if kind_of(item).beside or kind_of(item).steep:
        return np.ones(forces.shape, dtype=bool)
    if not forces.size:
        return np.zeros(forces.shape, dtype=bool)
    top = np.max(forces, axis=1, keepdims=True)
    return np.asarray(forces >= top - NEAR_TOP * np.abs(top))


def _is_of_balls(quantity: Quantity) -> bool:
    return ".ball." in f".{quantity.channel}"


def needs(quantity: Quantity) -> tuple[str, ...]:
    """Channels that are reduced for a quantity."""
    kind = kind_of(quantity)
    return kind.needs(quantity.channel) if kind.needs is not None else (quantity.channel,)


def needed_rows(quantity: Quantity) -> list[tuple[str, str]]:
    """Extremes and moments that are reduced for a quantity, each of a channel."""
    return [(row, channel) for channel in needs(quantity) for row in kind_of(quantity).rows]


def is_reduced(model: LoadedModel, quantity: Quantity) -> bool:
    """Whether the reductions of a run hold a quantity."""
    if kind_of(quantity).reduced is None or quantity.ball is not None or not model.states:
        return False
    known = reduction_rows(model.manifest)
    return set(needs(quantity) or (quantity.channel,)) <= set(known.channels if needs(quantity) else known.states)


def around(layout: Layout, extreme: Mark) -> tuple[tuple[int, float], ...]:
    """Points before and after an extreme, within its panel; none where that ends beside it."""
    panels = layout.panels
    ends = panels.at(np.array([0.0, 1.0]))[0]
    inside = (panels.segment == extreme.segment) & (ends[:, 0] <= extreme.fraction) & (extreme.fraction <= ends[:, 1])
    if not np.any(inside) or extreme.other is not None:
        return ()
    low, high = ends[int(np.flatnonzero(inside)[0])].tolist()
    length = high - low
    if layout.motion.still:  # panels of what follows from time alone end at no kink
        low, high = 0.0, 1.0
    distance = min(AROUND * length, min(extreme.fraction - low, high - extreme.fraction) / (BESIDE + 0.1))
    if distance < NEAREST * length:
        return ()
    return tuple((extreme.segment, extreme.fraction + j * distance) for j in range(-BESIDE, BESIDE + 1) if j)


def _beside(extreme: Mark, layout: Layout) -> Mark:
    """An extreme where a load begins or ends is at a corner of the channel, and moves with it."""
    passed = layout.cuts.cause == Cause.WINDOW
    beside = np.flatnonzero(passed & (np.abs(layout.cuts.times - extreme.time) < layout.near))
    return replace(extreme, segment=int(beside[0]) - 1, fraction=1.0) if len(beside) else extreme


def moments(
    run: Run, cuts: Cuts, items: Sequence[Quantity], chain: Chain | None = None
) -> tuple[Nodes, dict[tuple[str, str], Mark]]:
    """A node for each quantity that is taken at one moment, and its mark.

    At a cut the loads behind it hold, at the end those before.
    """
    places = [place_of(run.model.manifest, run.numbers, run.end, item) for item in items]
    marks = {
        (item.name, "place"): Mark(node=k, time=time)
        for k, (item, (time, _)) in enumerate(zip(items, places, strict=True))
    }
    times = np.array([cuts.times[-1] if place.kind == "end" else time for time, place in places])
    segment = cuts.find(times)[0]
    nodes = fixed_nodes(times, segment, cuts.segment[segment], cuts.slopes.shape[1])
    if chain is not None:
        given = (run.model.manifest, run.numbers)
        slopes = [place_slope(*given, place, time, cuts.slopes[-1], chain.derivative) for time, place in places]
        nodes = replace(nodes, slope=np.array(slopes))
    return nodes, marks
