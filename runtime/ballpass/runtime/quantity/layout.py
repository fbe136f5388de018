"""The nodes within the steps of a run at which each quantity is evaluated.

In: a run, the ends of its steps, quantities.  Out: `Layout` of all that share their nodes.

A quantity's nodes depend only on itself and the run, so that its value is the same to the bit beside any others.
Integrals have Gauss's nodes in every step, and finer ones where their channel needs it; extremes that the steps do not
hold are searched between such nodes; a moment is a node of its own.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.reduction_rows import EQUAL, reduction_rows
from ballpass.runtime.native.stepper import Segments
from ballpass.runtime.quantity.between_nodes import Extreme, Wanted, find_extremes
from ballpass.runtime.quantity.kinks import DEFLECTION, crossings, rank_differences
from ballpass.runtime.quantity.nodes import (
    Edges,
    NodePlan,
    Nodes,
    make_edges,
    no_nodes,
    part_of_nodes,
    place,
    with_passages,
)
from ballpass.runtime.quantity.panels import (
    GAUSS,
    Panels,
    bounds,
    cut_at,
    inner_nodes,
    interpolated,
    panels_of_steps,
    parts_needed,
    parts_of_oscillation,
    plan_of,
    same_panels,
    split,
    uniform_panels,
)
from ballpass.runtime.quantity.passages import EdgeDistances, JumpDistance, Passages, find_passages, jumps_at
from ballpass.runtime.quantity.records import Kind, Quantity, View
from ballpass.runtime.quantity.registry import KINDS
from ballpass.runtime.quantity.track import ChannelValues, Signal, Track, depends, follow
from ballpass.runtime.request.locating import LOCATED, stepper_for
from ballpass.runtime.request.request import check_memory
from ballpass.runtime.request.resolve import Run
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
    still : whether they follow from time alone, so that no state has to be known
    kept : steps of the run
    segments : of the driver
    edges, panels, plan : where nodes lie; no panels where moments alone are asked for
    passages : edges that the motion moves, those of windows and of jumps of an angle
    track, signals : states and channels along them
    extremes : by quantity and "max" or "min", the best first
    """

    items: tuple[Quantity, ...]
    still: bool
    kept: Array
    segments: Segments
    edges: Edges
    passages: tuple[Passages, ...]
    panels: Panels | None
    plan: NodePlan
    track: Track | None
    signals: Mapping[str, Signal]
    extremes: Mapping[tuple[str, str], list[Extreme]]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Sort:
    """Properties that decide about the first nodes of a quantity.

    Attributes
    ----------
    moment : whether a moment is its only node
    still : whether it follows from time alone
    graded : whether panels get finer towards kinks; states are smooth where contacts begin
    wrapped : channel that is integrated and jumps by a turn; "" for another
    """

    moment: bool
    still: bool
    graded: bool
    wrapped: str


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

    def is_still(self, quantity: Quantity) -> bool:
        """Whether a quantity follows from time alone."""
        names = channels_of([quantity])
        return all(name not in self.model.states and not depends(self.model, name, "x") for name in names)

    def lay(self, run: Run, kept: Array, row: Array, noded: Sequence[Quantity]) -> list[Layout]:
        """Nodes of all quantities, and the run along them.

        Parameters
        ----------
        kept : steps of the run, see `loop.KeptSteps`
        row : reductions of the run
        """
        segments = segments_of(run)
        first = Layout(
            items=(),
            still=False,
            kept=kept,
            segments=segments,
            edges=make_edges(run, segments, None),
            passages=(),
            panels=None,
            plan=no_nodes(),
            track=None,
            signals={},
            extremes={},
        )
        sorts: dict[_Sort, list[Quantity]] = defaultdict(list)
        for item in noded:
            moment, resolved = kind_of(item).at_moment, not self._is_found(item)
            graded = resolved and item.channel not in self.model.states
            wrapped = item.channel if jumps_at(item.channel) is not None and self._is_kinked(item) else ""
            sort = _Sort(moment=moment, still=self.is_still(item), graded=graded and not moment, wrapped=wrapped)
            sorts[sort].append(item)
        found: list[Layout] = []
        for sort, items in sorts.items():
            here = replace(first, items=tuple(items), still=sort.still)
            if sort.moment:
                found.append(here)
                continue
            kinks = (kept[:, 1] > 0.0) & sort.graded
            here = self._along(run, here, self._panels(run, here, kinks))
            if sort.wrapped:
                angle = JumpDistance(self._channels.only(channels_of(items)))
                here = self._with_passages(run, here, kinks, angle)
            if not sort.still and self.model.manifest.edges:
                # an extreme where a load begins moves with it, so that extremes need passages as well
                here = self._with_passages(run, here, kinks, EdgeDistances(self.model))
            found += self._refined(run, here, kinks)
        return [self._with_extremes(run, one, row) for one in found]

    def _panels(self, run: Run, layout: Layout, kinks: NDArray[np.bool_]) -> Panels:
        mechanism, manifest = self.model.manifest.mechanism, self.model.manifest
        angle = "" if mechanism is None else mechanism.angle

        def turned(times: Array) -> Array:
            if not angle:
                return np.asarray(timeline.driver(manifest, run.numbers.values).at(times)[0] / TURN)
            distinct, back = np.unique(times, return_inverse=True)
            states = stepper_for(self.model, run.kinks).read(layout.kept, distinct)
            found = states[:, self.model.states.index(angle)][back].reshape(times.shape)
            return np.asarray(found / TURN)

        # what follows from time alone does not see where a torque has brought the driver
        asked = None if timeline.is_even(manifest, run.numbers.values) or (angle and layout.still) else turned
        if layout.still:
            return uniform_panels(layout.edges, run.stretch, asked)
        return panels_of_steps(layout.edges, layout.kept[:, 0], kinks, run.stretch, asked)

    def _along(self, run: Run, layout: Layout, panels: Panels) -> Layout:
        """The run along the nodes of panels; what the layout knows in panels that it has is taken from there."""
        plan, channels = plan_of(panels, layout.edges), self._channels.only(channels_of(layout.items))
        nodes, known = place(plan, layout.edges), layout.track
        if known is None or layout.panels is None:
            track = follow(run, layout.segments, layout.edges, nodes, kept=layout.kept, still=layout.still)
            signals = channels.along(track, run.numbers)
            return replace(layout, panels=panels, plan=plan, track=track, signals=signals)
        here, there = (
            inner_nodes(one)[same].ravel()
            for one, same in zip((panels, layout.panels), same_panels(panels, layout.panels), strict=True)
        )
        fresh = np.delete(np.arange(len(nodes)), here)

        def joined(new: Array, old: Array) -> Array:
            every = np.empty((len(nodes), *new.shape[1:]))
            every[fresh], every[here] = new, old[there]
            return every

        part = follow(
            *(run, layout.segments, layout.edges, part_of_nodes(nodes, fresh)), kept=layout.kept, still=layout.still
        )
        signals = {
            name: Signal(
                value=joined(signal.value, layout.signals[name].value),
                slope=joined(signal.slope, layout.signals[name].slope),
            )
            for name, signal in channels.along(part, run.numbers).items()
        }
        track = replace(
            part,
            nodes=nodes,
            x=joined(part.x, known.x),
            slope=joined(part.slope, known.slope),
            local=joined(part.local, known.local),
            u=joined(part.u, known.u),
        )
        return replace(layout, panels=panels, plan=plan, track=track, signals=signals)

    def _with_passages(
        self, run: Run, layout: Layout, kinks: NDArray[np.bool_], angles: EdgeDistances | JumpDistance
    ) -> Layout:
        """The same with edges where angles pass zero."""
        assert layout.track is not None
        passed = find_passages(run, layout.track, angles, layout.kept, still=layout.still)
        if not len(passed.times):
            return layout
        edges = with_passages(layout.edges, passed.times, np.zeros((len(passed.times), 0)))
        layout = replace(layout, edges=edges, passages=(*layout.passages, passed), panels=None)
        return self._along(run, layout, self._panels(run, layout, kinks))

    def _refined(self, run: Run, layout: Layout, kinks: NDArray[np.bool_], passes: int = PASSES) -> list[Layout]:
        """Each quantity on nodes as fine as it needs: those that need the same ones share them."""
        assert layout.track is not None
        assert layout.panels is not None
        each = []
        for item in layout.items:
            panels = layout.panels
            if not self._is_found(item):
                panels = split(panels, self._parts(run, layout, item))
                panels = cut_at(panels, layout.edges, self._kinks(run, layout, item))
            each.append((item, panels))
        found = []
        for here in self._each_along(run, layout, each):
            # steps show at once how fine nodes have to be; a separate grid is refined repeatedly
            again = layout.still and passes > 1 and here.panels is not layout.panels
            found += self._refined(run, here, kinks, passes - 1) if again else self._ranked(run, here)
        return found

    def _each_along(self, run: Run, layout: Layout, each: Sequence[tuple[Quantity, Panels]]) -> list[Layout]:
        """The run along the nodes of each quantity: those that need the same ones share them."""
        shared: dict[bytes, tuple[Panels, list[Quantity]]] = {}
        for item, panels in each:
            shared.setdefault(panels.low.tobytes() + panels.begin.tobytes(), (panels, []))[1].append(item)
        groups = [(panels, replace(layout, items=tuple(items))) for panels, items in shared.values()]
        return [here if panels is layout.panels else self._along(run, here, panels) for panels, here in groups]

    def _ranked(self, run: Run, layout: Layout, passes: int = RANKED) -> list[Layout]:
        """Panels that end where another ball becomes the most loaded one, for quantities of that ball.

        The balls' forces are smooth within the panels, so that two changes between two nodes are found as well.
        """
        assert layout.panels is not None
        each = []
        for item in layout.items:
            times = np.zeros(0)
            if self._is_kinked(item) and _is_of_balls(item) and item.ball is None and not kind_of(item).steep:
                forces = _at_nodes(layout, layout.signals[item.channel].value)
                low, high = bounds(forces)
                close = np.count_nonzero(high >= np.max(low, axis=1, keepdims=True), axis=1) > 1
                t, segment, table = _between_nodes(layout, forces, close)
                signals, counts = rank_differences(segment, table)
                times = crossings(t, segment, *signals.T, counts=counts.T)
            each.append((item, cut_at(layout.panels, layout.edges, times)))
        found = []
        for here in self._each_along(run, layout, each):
            again = passes > 1 and here.panels is not layout.panels
            found += self._ranked(run, here, passes - 1) if again else [here]
        return found

    def _parts(self, run: Run, layout: Layout, item: Quantity) -> NDArray[np.int_]:
        """Into how many parts each panel is to be split; none where there would be too many."""
        assert layout.track is not None
        assert layout.panels is not None
        within = np.flatnonzero(layout.track.nodes.weight)
        signal = layout.signals[item.channel].value[within]
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
        view = View(
            run=run,
            nodes=layout.track.nodes,
            signals=layout.signals,
            marks={},
            slopes=lambda _: np.zeros(0),
            names=(),
        )
        faster = parts_of_oscillation(layout.panels, layout.edges, oscillation(view, item)[0])
        nodes, columns = len(GAUSS) * int(np.sum(faster)), len(self.model.states) + signal.shape[1]
        check_memory(f"{item.name}: {nodes} nodes of", nodes, columns, "Ask for a lower frequency.")
        return np.maximum(parts, faster)

    def _kinks(self, run: Run, layout: Layout, item: Quantity) -> Array:
        """Times of kinks of an integrated channel, beside those on which steps end [s]."""
        # a corner of the damping at rest is in the force of each ball, and not in the motion
        corner = _is_of_balls(item) and any(bearing.damping.corner_at_rest for bearing in self.model.manifest.bearings)
        # a step as long as a turn meets a stop and leaves it, and shows neither
        known = run.kinks == LOCATED and not corner and not self.model.manifest.stops
        if not self._is_kinked(item) or not self._deflections.channels or known:
            return np.zeros(0)
        assert layout.track is not None
        values, rates = self._deflections.with_rates(layout.track, run.numbers)
        # where a body leaves a stop faster than the stop expands, its force stays at zero
        stops, numbers = {stop: _hysteresis(stop) for stop in self.model.manifest.stops}, run.numbers.parameters
        columns = {stop: self._deflections.column(stop) for stop in stops}
        clips = [1.0 + numbers[name] * rates[:, [columns[stop]]] for stop, name in stops.items() if name in numbers]
        every, forces = [values, *clips], np.zeros((len(values), 0))
        if corner:
            # of one bearing, and of those balls that the quantity is of
            forces = layout.signals[item.channel].value
            first = self._deflections.column(item.channel.partition("ball.")[0] + DEFLECTION)
            every.append(rates[:, first : first + forces.shape[1]])
        signals = _at_nodes(layout, np.hstack([*every, forces]))
        count = signals.shape[2] - forces.shape[1]
        low, high = bounds(signals[:, :, :count])
        t, segment, signals = _between_nodes(layout, signals, np.any((low < 0.0) & (high > 0.0), axis=1))
        counts = np.ones((len(t), count), dtype=bool)
        counts[:, count - forces.shape[1] :] = _taking_part(item, signals[:, count:])
        return crossings(t, segment, *signals[:, :count].T, counts=counts.T)

    def _is_kinked(self, item: Quantity) -> bool:
        """Whether a quantity integrates an output."""
        return kind_of(item).integrates and item.channel not in self.model.states

    def _with_extremes(self, run: Run, layout: Layout, row: Array) -> Layout:
        """The same with the extremes of its quantities, and the next ones."""
        asked = [(item, kind) for item in layout.items for kind in kind_of(item).extremes]
        track = layout.track
        if not asked or track is None:
            return layout
        rows = reduction_rows(self.model.manifest)

        def wanted(item: Quantity, kind: str) -> Wanted:
            seen = float(row[rows.columns[f"{kind}_time", item.channel]]) if self._is_held(item) else None
            ball = None if item.ball is None else item.ball - 1
            sign = 1.0 if kind == "max" else -1.0
            return Wanted(channel=item.channel, ball=ball, sign=sign, seen=seen, exact=self._is_found(item))

        def look(nodes: Nodes) -> Mapping[str, Signal]:
            seen = follow(run, layout.segments, layout.edges, nodes, kept=layout.kept, still=layout.still)
            return self._channels.only(channels_of(layout.items)).along(seen, run.numbers)

        each = [wanted(item, kind) for item, kind in asked]
        distinct = list(dict.fromkeys(each))
        equal = max(run.rtol, EQUAL)
        found = dict(zip(distinct, find_extremes(distinct, track, layout.signals, look, equal), strict=True))
        extremes = {(item.name, kind): found[one] for (item, kind), one in zip(asked, each, strict=True)}
        if layout.passages:
            extremes = {key: [_beside(one, layout) for one in some] for key, some in extremes.items()}
        return replace(layout, extremes=extremes)

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


def _at_nodes(layout: Layout, signals: Array) -> Array:
    """Signals at the nodes of panels, shape (panels, 4, columns), of those along a track."""
    assert layout.panels is not None
    return signals[inner_nodes(layout.panels)]


def _between_nodes(layout: Layout, signals: Array, which: NDArray[np.bool_]) -> tuple[Array, NDArray[np.int_], Array]:
    """Times, intervals and signals at places between the nodes of some of the panels too."""
    assert layout.panels is not None
    rows = np.flatnonzero(which)
    return interpolated(layout.panels.some(rows), layout.edges, signals[rows])


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


def _hysteresis(stop: str) -> str:
    """Parameter of a stop, by its compression, as ``stop.wall.compression``."""
    kind, name, _ = stop.split(".")
    return f"mechanism.{kind}s.{name}.hysteresis"


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


def around(layout: Layout, extreme: Extreme) -> tuple[tuple[int, float], ...]:
    """Points before and after an extreme, within its panel; none where that ends beside it."""
    panels = layout.panels
    if panels is None:
        return ()
    ends = panels.at(np.array([0.0, 1.0]))[0]
    inside = (panels.segment == extreme.segment) & (ends[:, 0] <= extreme.fraction) & (extreme.fraction <= ends[:, 1])
    if not np.any(inside) or extreme.other is not None:
        return ()
    low, high = ends[int(np.flatnonzero(inside)[0])].tolist()
    length = high - low
    if layout.still:  # panels of what follows from time alone end at no kink
        low, high = 0.0, 1.0
    distance = min(AROUND * length, min(extreme.fraction - low, high - extreme.fraction) / (BESIDE + 0.1))
    if distance < NEAREST * length:
        return ()
    return tuple((extreme.segment, extreme.fraction + j * distance) for j in range(-BESIDE, BESIDE + 1) if j)


def _beside(extreme: Extreme, layout: Layout) -> Extreme:
    """An extreme where a load begins or ends is at a corner of the channel, and moves with it."""
    for passages in layout.passages:
        beside = np.flatnonzero(np.abs(passages.times - extreme.time) < passages.near)
        if len(beside):
            edge = int(np.searchsorted(layout.edges.times, passages.times[beside[0]]))
            return replace(extreme, segment=edge - 1, fraction=1.0)
    return extreme
