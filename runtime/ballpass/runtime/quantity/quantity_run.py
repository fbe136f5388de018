"""Evaluate quantities of a run, with or without their derivatives.

In: a model and quantities (`QuantityRun`); a `Run`.  Out: `Values`.

A plain run reduces what its steps give: extremes, means and life of states and ball forces are there, the same bits in
every command.  All else is evaluated along nodes within the very steps of that run (`layout`).  A run with derivatives
along the same nodes gives those.
"""

from __future__ import annotations

import math
import time as clocks
from collections.abc import Collection, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.reduction_rows import EXTREMES, reduction_rows
from ballpass.runtime.quantity.cuts import moving_cuts
from ballpass.runtime.quantity.layout import (
    Layout,
    NodeLayer,
    around,
    channels_of,
    is_reduced,
    kind_of,
    moments,
    needed_rows,
)
from ballpass.runtime.quantity.nodes import Cuts, Nodes, joined_nodes, moved, part_of_nodes
from ballpass.runtime.quantity.panels import GAUSS, ROUGH
from ballpass.runtime.quantity.records import Estimate, Mark, Quantity, ReducedRuns, View
from ballpass.runtime.quantity.track import ChannelValues, Track, jumps, part_of_track
from ballpass.runtime.ratings.of_bearing import bearing_words
from ballpass.runtime.request.locating import stepper_for
from ballpass.runtime.request.request import check_memory
from ballpass.runtime.request.resolve import Run
from ballpass.runtime.run.directions import Chain
from ballpass.runtime.run.loop import KeptSteps, ReductionRow, Sink, start_run

Array = NDArray[np.float64]

#: Numbers in memory for each state at a node, and those that each direction adds: states, channels, and intermediate
#: values.  Lanes without a direction are counted where they are made.
VALUES, SLOPES = 16, 8

#: Processor time of this thread where the system measures it finely, without other programs.
_now = clocks.thread_time if clocks.get_clock_info("thread_time").resolution < 1e-5 else clocks.perf_counter


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EvaluatedQuantities:
    """Quantities of a run.

    Attributes
    ----------
    estimates : one for each quantity
    track : states along nodes of the whole run; None where there are none
    row : reductions, None where nothing was run
    end : state at the end of the run, shape (states,); None likewise
    growth : with derivatives, how far a change of the start by the motion's magnitudes changes the states at the nodes
        and at the end, in these [1]
    seconds : of the plain integration alone [s]
    steps, rejected : of the integration
    """

    estimates: tuple[Estimate, ...]
    track: Track | None = None
    row: Array | None = None
    end: Array | None = None
    growth: float = 0.0
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


class QuantityRun:
    """Quantities along runs of one model.

    Parameters
    ----------
    model : the model
    quantities : the requested ones
    rough : see `panels.parts_needed` [1]
    along_nodes : evaluate these along nodes although reductions hold them: integrals are then cut where balls change
        rank
    motion : reduce all states as well, for `Values.row`
    """

    def __init__(
        self,
        model: LoadedModel,
        quantities: Sequence[Quantity],
        *,
        rough: float = ROUGH,
        along_nodes: Collection[Quantity] = (),
        motion: bool = False,
    ) -> None:
        self.model = model
        self.quantities = tuple(quantities)
        self._motion = motion
        self._moving = [item for item in quantities if kind_of(item).at_rest is None]
        self._reduced = [item for item in self._moving if is_reduced(model, item) and item not in along_nodes]
        self._noded = [item for item in self._moving if item not in self._reduced]
        self._channels = ChannelValues(model, channels_of(self._moving))
        self._along_nodes = along_nodes
        self._layer = NodeLayer(model, self._channels, rough=rough, along_nodes=along_nodes)
        # outputs that follow from time alone need no integration
        self._runs = motion or not all(self._layer.is_still(item) for item in self._moving)

    def with_panels(self, rough: float) -> QuantityRun:
        """The same quantities in other panels, evaluated by the same functions, which are made once for both."""
        found = copy(self)
        found._layer = NodeLayer(self.model, self._channels, rough=rough, along_nodes=self._along_nodes)
        return found

    def measure(self, run: Run) -> EvaluatedQuantities:
        """Values of all quantities.

        Raises
        ------
        RequestError
            A place that the run does not reach, or a run that ends within its transient.
        SimulationError
            The computation failed.
        """
        return self._measure(run, self._noded)[0]

    def differentiate(self, run: Run, names: Sequence[str], sensitivity_rtol: float) -> EvaluatedQuantities:
        """Values of all quantities, those of `measure`, and their derivatives along parameters.

        Parameters
        ----------
        sensitivity_rtol : tolerance of the derivatives in the choice of step sizes [1]

        Raises
        ------
        RequestError
            An unknown parameter, several loads that switch at one time, or an extreme of an output that jumps at the
            edge of a window whose time depends on the motion.
        SimulationError
            The computation failed.
        """
        for item in self._moving:
            if kind_of(item).extremes and jumps(self.model, item.channel):
                ball = bearing_words("a ball", self.model.manifest.bearings, item.channel)
                raise RequestError(
                    f"{item.name}: {item.channel} jumps where a load within a window begins or ends, or {ball} enters "
                    "or leaves a spall, at a time that the motion decides; on which side of the jump the extreme is, "
                    "is not followed. Allowed: extremes of states and all else that does not jump; means and integrals "
                    "of all. Or give the load as a table over the angle, with flanks as steep as they are."
                )
        chain = Chain(self.model, run.numbers, names)
        found, layouts = self._measure(run, self._moving, len(names))
        laid = []
        for layout in layouts:
            angles = self._layer.angles_of(layout)
            cuts, leaves = moving_cuts(layout.motion, layout.cuts, angles, chain, sensitivity_rtol)
            laid += [(part, leaves, *_moving_nodes(part, cuts, chain)) for part in _by_nodes(layout)]
        slopes: dict[str, Estimate] = {}
        growth = 0.0
        for still in (False, True):
            some = [one for one in laid if one[0].motion.still is still]
            if not some:
                continue
            # in one run for all
            every = joined_nodes([nodes for _, _, nodes, _ in some])
            track = some[0][0].motion.along(every, chain, sensitivity_rtol)
            growth = max(growth, track.growth)
            first = 0
            for layout, leaves, nodes, marks in some:
                part = part_of_track(track, slice(first, first + len(nodes)))
                first += len(nodes)
                signals = self._channels.only(channels_of(layout.items)).along(part, run.numbers, chain)
                view = View(
                    run=run, nodes=nodes, signals=signals, marks=marks, slopes=chain.derivative, names=chain.names
                )
                slopes |= {item.name: _where_known(_evaluated(view, item), item, leaves) for item in layout.items}
        estimates = []
        for item, plain in zip(self.quantities, found.estimates, strict=True):
            if item.name in slopes:
                estimates.append(replace(slopes[item.name], value=plain.value, time=plain.time, ball=plain.ball))
            else:
                estimates.append(self._at_rest(item, run, chain))
        return replace(found, estimates=tuple(estimates), growth=growth)

    def _measure(
        self, run: Run, noded: Sequence[Quantity], directions: int = 0
    ) -> tuple[EvaluatedQuantities, list[Layout]]:
        """Values, and the nodes of `noded`; values that the reductions hold are taken from there.

        Parameters
        ----------
        directions : along which derivatives are taken at these nodes
        """
        row, kept = np.zeros(0), np.zeros((0, 2))
        steps = rejected = 0
        seconds, state = 0.0, run.initial
        if self._moving or self._motion:
            run.check_steady()
            row = self._row(run)
        if self._runs:
            stepper = stepper_for(run.model, run.kinks)  # compiled before it is timed
            steps_taken = KeptSteps(numbers=stepper.kept, check=partial(self._check_memory, directions))
            before = reduction_rows(self.model.manifest).empty(1, 0.0, ())[0]
            sinks: list[Sink] = [ReductionRow(row=row, before=before), *([steps_taken] if noded else [])]
            going = start_run(run, sinks)
            begin = _now()
            going.go_on()
            kept = steps_taken.all
            seconds, steps, rejected, state = _now() - begin, going.steps, going.rejected, going.state
        run = replace(run, progress=None)
        found: dict[str, Estimate] = {}
        layouts: list[Layout] = []
        if noded:
            self._check_memory(directions, max(len(kept), math.ceil(run.span.cycles)))
            layouts = self._layer.lay(run, kept, row, noded)
            for layout in layouts:
                marks = {key: some[0] for key, some in layout.marks.items()}
                view = View(run=run, nodes=layout.track.nodes, signals=layout.signals, marks=marks)
                found |= {item.name: _evaluated(view, item) for item in layout.items if item not in self._reduced}
        rows, end = row[None, :], state[None, :]
        runs = ReducedRuns(manifest=self.model.manifest, rows=rows, end=end, values=run.numbers.values)
        found |= {item.name: _of_reductions(runs, item) for item in self._reduced}
        estimates = tuple(found.get(item.name) or self._at_rest(item, run, None) for item in self.quantities)
        track = next((one.track for one in layouts if one.causes and not one.motion.still), None)
        values = EvaluatedQuantities(
            estimates=estimates,
            track=track,
            row=row if len(row) else None,
            end=state if self._runs else None,
            seconds=seconds,
            steps=steps,
            rejected=rejected,
        )
        return values, layouts

    def _check_memory(self, directions: int, steps: int) -> None:
        """Refuse steps whose nodes would not fit into memory, before any is laid."""
        nodes = len(GAUSS) * steps
        derivatives = f" and derivatives by {directions} parameters" if directions else ""
        check_memory(
            f"{nodes} nodes, with states{derivatives}, of",
            nodes,
            max(len(self.model.states), 1) * (VALUES + SLOPES * directions),
            "Take a shorter run, or fewer parameters at a time.",
        )

    def _row(self, run: Run) -> Array:
        """An empty row of reductions, of what the quantities need."""
        needed = {row for item in self._reduced for row in needed_rows(item)}
        if self._motion:
            needed |= {(name, state) for name in EXTREMES for state in self.model.states}
        return np.asarray(reduction_rows(self.model.manifest).empty(1, run.start, needed, run.rtol)[0])

    def _at_rest(self, quantity: Quantity, run: Run, chain: Chain | None) -> Estimate:
        at_rest = kind_of(quantity).at_rest
        assert at_rest is not None  # all others are evaluated along the run
        return at_rest(self.model, run.numbers, quantity, chain)


def _moving_nodes(layout: Layout, cuts: Cuts, chain: Chain) -> tuple[Nodes, dict[tuple[str, str], Mark]]:
    """Nodes of a layout that move with the parameters, and the moments among them."""
    if not layout.causes:
        return moments(layout.motion.run, cuts, layout.items, chain)
    beside = {
        (item.name, kind): around(layout, layout.marks[item.name, kind][0])
        for item in layout.items
        for kind in kind_of(item).extremes
        if kind_of(item).around
    }
    points = [(one.segment, one.fraction) for some in layout.marks.values() for one in some]
    points = list(dict.fromkeys([*points, *(point for some in beside.values() for point in some)]))
    integrated = any(kind_of(item).integrates for item in layout.items)
    nodes, known = moved(part_of_nodes(layout.track.nodes, slice(None if integrated else 0)), cuts, points)

    def at_node(mark: Mark) -> Mark:
        return replace(mark, node=known[mark.segment, mark.fraction])

    marks = {}
    for key, some in layout.marks.items():
        best, *others = map(at_node, some)
        nearby = tuple(known[point] for point in beside.get(key, ()))
        marks[key] = replace(best, competing=tuple(others), around=nearby)
    return nodes, marks


def _by_nodes(layout: Layout) -> list[Layout]:
    """Quantities that are integrated over the run, and those at single points, which cost nothing between them."""
    parts = []
    for integrated in (True, False):
        items = tuple(item for item in layout.items if kind_of(item).integrates is integrated)
        names = {item.name for item in items}
        marks = {key: some for key, some in layout.marks.items() if key[0] in names}
        if items:
            parts.append(replace(layout, items=items, marks=marks))
    return parts


def _evaluated(view: View, quantity: Quantity) -> Estimate:
    evaluate = kind_of(quantity).evaluate
    assert evaluate is not None  # all others are at rest
    return evaluate(view, quantity)


def _where_known(found: Estimate, quantity: Quantity, leaves: NDArray[np.bool_]) -> Estimate:
    """Without derivatives of an integral of an angle whose jump by a turn leaves an edge."""
    if not (kind_of(quantity).integrates and np.any(leaves)):
        return found
    notes = (*found.notes, "the angle jumps by a turn at an edge of the run or of a load")
    return replace(found, slope=np.where(leaves, np.nan, found.slope), notes=notes)


def _of_reductions(runs: ReducedRuns, quantity: Quantity) -> Estimate:
    kind = kind_of(quantity)
    assert kind.reduced is not None
    time = ball = None
    if len(kind.extremes) == 1:
        time = float(runs.entry(f"{kind.extremes[0]}_time", quantity.channel)[0])
        ball = int(runs.entry(f"{kind.extremes[0]}_ball", quantity.channel)[0]) or None
    return Estimate(value=float(kind.reduced(runs, quantity)[0]), slope=np.zeros(0), time=time, ball=ball)
