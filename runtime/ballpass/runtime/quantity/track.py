"""Follow a run along nodes: states and outputs there, with their derivatives along parameters.

In: a run and nodes.  Out: a `Track`, and `Signal` for each channel asked for.

Derivatives are taken along the moving nodes: with x' at fixed time and the node's own t', that of the state is
``x' + f t'``.  Across an edge where a load switches x' jumps by ``(f_before - f_behind) t_edge'``, and the sum does
not: it has one value for both sides of the edge.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import casadi
import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.kernel import Loop
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.stepper import Segments
from ballpass.runtime.point.jacobian import Rows, rows_of
from ballpass.runtime.quantity.nodes import Nodes, fixed_nodes, part_of_nodes
from ballpass.runtime.request.locating import stepper_for
from ballpass.runtime.request.request import no_output
from ballpass.runtime.request.resolve import Run
from ballpass.runtime.request.segments import time_resolution
from ballpass.runtime.run.directions import Directions
from ballpass.runtime.run.loop import Samples, start_run

if TYPE_CHECKING:
    from ballpass.runtime.run.directions import Chain

Array = NDArray[np.float64]

#: Nodes whose derivatives are held in memory at once.
BLOCK = 4096

#: Channel of the angles beyond the edges of all windows of angles that are states, and its generated function [rad].
WINDOWS = "windows"

#: Expressions of CasADi are not for several threads, and its calls let others run: they are made one at a time.
_MAKING = threading.Lock()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Track:
    """States along nodes.

    Attributes
    ----------
    nodes : where
    x : states, shape (nodes, states)
    slope : their derivatives along the moving nodes, shape (nodes, states, directions)
    local : time since the segment's start, shape (nodes,) [s]
    u : inputs, shape (nodes, inputs)
    segments : of the driver
    growth : how far a change of the start by the motion's magnitudes changes the states, in these; without derivatives
        it is not known [1]
    """

    nodes: Nodes
    x: Array
    slope: Array
    local: Array
    u: Array
    segments: Segments
    growth: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Signal:
    """A channel along nodes.

    Attributes
    ----------
    value : shape (nodes, columns); a column for each ball
    slope : derivative along the moving nodes, shape (nodes, columns, directions)
    """

    value: Array
    slope: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FollowedRun:
    """A run, to be followed along nodes.

    Attributes
    ----------
    run, segments : the run, all segments of its driver
    kept : its steps, see `loop.KeptSteps`; needed without derivatives alone
    still : whether nothing that is evaluated depends on states
    """

    run: Run
    segments: Segments
    kept: Array = field(default_factory=lambda: np.zeros((0, 2)))
    still: bool = False

    def along(self, nodes: Nodes, chain: Chain | None = None, sensitivity_rtol: float = 0.0) -> Track:
        """States at nodes; with derivatives along the directions of `chain`, for which the run is made again.

        Parameters
        ----------
        sensitivity_rtol : tolerance of the derivatives in the choice of step sizes [1]

        Raises
        ------
        RunFailed
            The driver could not reach the end.
        """
        run, model, numbers, starts = self.run, self.run.model, self.run.numbers, self.segments.times
        count, directions = len(model.states), 0 if chain is None else len(chain.names)
        x, slope, growth = np.zeros((len(nodes), count)), np.zeros((len(nodes), count, directions)), 0.0
        times, back = np.unique(nodes.t, return_inverse=True)
        if chain is None and not self.still:
            x = stepper_for(model, run.kinks).read(self.kept, times)[back]
        elif chain is not None and not self.still:
            made = Directions(model, numbers, chain.names, len(times), run.kinks, run.magnitude)
            made.control(sensitivity_rtol, run.magnitude)
            near = time_resolution(run.begin, run.end, run.stretch)
            samples = Samples(times=times, x=np.empty((len(times), count)), near=near, end=run.end, directions=made)
            start_run(run, [samples]).go_on()
            # the driver gives the derivative before the edge
            before = np.clip(np.searchsorted(starts, times, side="left") - 1, 0, None)
            given = {
                "t": times - starts[before],
                "x": samples.x,
                "u": self.segments.inputs[before],
                "p": numbers.p,
                "c": numbers.c,
            }
            rate = next(iter(model.loop("rhs", ("t", "x", "u"))(len(times), given).values()))
            slope = made.states(len(times))[back] + rate[back][:, :, None] * nodes.slope[:, None, :]
            x, growth = samples.x[back], made.growth()
        return Track(
            nodes=nodes,
            x=x,
            slope=slope,
            local=nodes.t - starts[nodes.held],
            u=self.segments.inputs[nodes.held],
            segments=self.segments,
            growth=growth,
        )

    def nodes_at(self, times: Array, directions: int = 0) -> Nodes:
        """Nodes at fixed times; at an edge those before it."""
        held = np.clip(np.searchsorted(self.segments.times, times) - 1, 0, None)
        return fixed_nodes(times, held, held, directions)


def part_of_track(track: Track, part: slice) -> Track:
    """Some of the nodes of a track."""
    arrays = {name: getattr(track, name)[part] for name in ("x", "slope", "local", "u")}
    return replace(track, nodes=part_of_nodes(track.nodes, part), **arrays)


def depends(model: LoadedModel, output: str, argument: str) -> list[int]:
    """Entries of an argument of the outputs that one of them depends on."""
    known = [info.name for info in model.manifest.outputs]
    if output in known:
        graph, place = model.symbolic("outputs"), known.index(output)
    else:  # what the scene's outputs do not name
        channels = ChannelValues(model, [output])
        graph, place = channels._function(channels._all_rows), 0
    if argument not in graph.name_in():
        return []
    sparsity = graph.jac_sparsity(place, graph.name_in().index(argument))
    return list(dict.fromkeys(sparsity.get_col()))


class ChannelValues:
    """Channels of a model along tracks: states by themselves, outputs through the generated function.

    Parameters
    ----------
    model : the model
    channels : states, outputs, and quantities that the scene's outputs do not name

    Raises
    ------
    RequestError
        An unknown channel.
    """

    def __init__(self, model: LoadedModel, channels: Sequence[str]) -> None:
        self._model = model
        known = list(dict.fromkeys((*model.states, *model.outputs, *(q.name for q in model.manifest.quantities))))
        for name in channels:
            if name not in (*known, WINDOWS):
                raise RequestError(no_output(model.manifest, name, known))
        self.channels = tuple(dict.fromkeys(channels))
        self._outputs = [info for info in model.manifest.outputs if info.name in self.channels]
        self._outputs = [info for info in self._outputs if info.name not in model.states]
        own = {*model.states, *model.outputs}
        self._more = [rows for name in self.channels if name not in own for rows in _rows(model, name)]
        self._columns = [(info.name, info.size) for info in self._outputs]
        self._columns += [(name.partition("[")[0], len(rows.labels)) for rows in self._more for name in rows.labels[:1]]
        self._own = threading.local()  # a loop is not for several threads, and differences run in several
        self._functions: dict[str, casadi.Function] = {}
        self._parts: dict[tuple[str, ...], ChannelValues] = {}

    def only(self, channels: Collection[str]) -> ChannelValues:
        """The same for some of the channels: others cost nothing at these nodes."""
        names = tuple(name for name in self.channels if name in channels)
        return self if names == self.channels else self._parts.setdefault(names, ChannelValues(self._model, names))

    def along(self, track: Track, numbers: Numbers, chain: Chain | None = None) -> Mapping[str, Signal]:
        """Every channel along a track."""
        states = self._model.states
        found: dict[str, Signal] = {}
        for name in self.channels:
            if name in states:
                k = states.index(name)
                found[name] = Signal(value=track.x[:, [k]], slope=track.slope[:, [k]])
        if self._columns:
            found |= self._values(track, numbers) if chain is None else self._differentiated(track, numbers, chain)
        return found

    def _given(self, track: Track, numbers: Numbers) -> dict[str, Array]:
        return {"t": track.local, "x": track.x, "u": track.u, "p": numbers.p, "c": numbers.c}

    def _values(self, track: Track, numbers: Numbers) -> dict[str, Signal]:
        found = self.outputs_at(len(track.nodes), self._given(track, numbers))
        return {name: Signal(value=value, slope=np.zeros((*value.shape, 0))) for name, value in found.items()}

    def outputs_at(self, count: int, given: Mapping[str, Array]) -> dict[str, Array]:
        """Channels that are no states, at points, each of shape (points, columns).

        Parameters
        ----------
        given : t, x and u of every point, and p, c
        """
        found: dict[str, Array] = {}
        if self._more:
            every = self._own_loop("more", self._more_rows)(count, given)["g"]
            found = _split(every, self._columns[len(self._outputs) :])
        if not self._outputs:
            return found
        infos = self._model.manifest.outputs
        results = self._model.loop("outputs", ("t", "x", "u"))(count, given)
        columns = dict(zip((info.name for info in infos), results.values(), strict=True))
        return found | {info.name: columns[info.name] for info in self._outputs}

    def with_rates(self, track: Track, numbers: Numbers) -> tuple[Array, Array]:
        """Channels that are no states along a track, and their time derivatives, shape (nodes, columns) each.

        They follow from time and positions alone, and from the angle by which a cage lags.
        """
        every = self._own_loop("rates", self._rows_with_rates)(len(track.nodes), self._given(track, numbers))["g"]
        values, rates = np.split(every, 2, axis=1)
        return values, rates

    def column(self, channel: str) -> int:
        """First column of a channel among those of `with_rates`."""
        names = [name for name, _ in self._columns]
        return sum(size for _, size in self._columns[: names.index(channel)])

    def _differentiated(self, track: Track, numbers: Numbers, chain: Chain) -> dict[str, Signal]:
        directions = len(chain.names)
        loop = self._own_loop(f"along {directions}", self._all_rows, directions)
        moved = chain.inputs(track.segments.times)
        values, slopes = [], []
        for first in range(0, len(track.nodes), BLOCK):
            part = part_of_track(track, slice(first, first + BLOCK))
            given, count = self._given(part, numbers), len(part.nodes)
            seeds = (part.nodes.slope, part.slope, moved[part.nodes.held], chain.p, chain.c)
            here = loop(count, given | {f"{name}_way": seed for name, seed in zip(given, seeds, strict=True)})
            values.append(here["g"])
            slopes.append(here["g_way"].reshape(count, -1, directions))
        value, slope = (_split(np.concatenate(one), self._columns) for one in (values, slopes))
        return {name: Signal(value=value[name], slope=slope[name]) for name in value}

    def _own_loop(
        self, name: str, rows: Callable[[Mapping[str, casadi.SX]], list[casadi.SX]], directions: int = 0
    ) -> Loop:
        """A loop of this thread over a function of `_function`, which all threads share."""
        loop = getattr(self._own, name, None)
        if loop is None:
            moving = ("t_way", "x_way", "u_way") if directions else ()
            with _MAKING:
                if name not in self._functions:
                    self._functions[name] = self._function(rows, directions)
                loop = Loop(self._functions[name], ("t", "x", "u", *moving))
            setattr(self._own, name, loop)
        return loop

    def _function(
        self, rows: Callable[[Mapping[str, casadi.SX]], list[casadi.SX]], directions: int = 0
    ) -> casadi.Function:
        """Rows as a function of all five arguments; with their derivatives along directions, each given row by row."""
        manifest = self._model.manifest
        sizes = {
            "t": 1,
            "x": len(self._model.states),
            "u": len(manifest.inputs),
            "p": len(manifest.parameters),
            "c": len(manifest.constants),
        }
        inputs = {name: casadi.SX.sym(name, size) for name, size in sizes.items()}
        wanted = casadi.vertcat(*rows(inputs))
        results, names = [casadi.densify(wanted)], ["g"]
        if directions:
            # CasADi's matrices are column after column, NumPy's row after row
            ways = {f"{name}_way": casadi.SX.sym(name, directions, size) for name, size in sizes.items()}
            along = casadi.jtimes(wanted, casadi.vertcat(*inputs.values()), casadi.horzcat(*ways.values()).T)
            results.append(casadi.vec(casadi.densify(along).T))
            names.append("g_way")
            inputs |= {name: casadi.vec(way) for name, way in ways.items()}
        return casadi.Function("channels", list(inputs.values()), results, list(inputs), names)

    def _all_rows(self, inputs: Mapping[str, casadi.SX]) -> list[casadi.SX]:
        found = []
        if self._outputs:
            results = self._results("outputs", inputs)
            order = [info.name for info in self._model.manifest.outputs]
            found = [results[order.index(info.name)] for info in self._outputs]
        return found + self._more_rows(inputs)

    def _rows_with_rates(self, inputs: Mapping[str, casadi.SX]) -> list[casadi.SX]:
        values, x = casadi.vertcat(*self._all_rows(inputs)), inputs["x"]
        half, coordinates = x.numel() // 2, self._model.manifest.coordinates
        moved = casadi.vertcat(1.0, x[half:], casadi.SX.zeros(half))
        lags = [half + k for k, one in enumerate(coordinates) if one.kind == "lag"]  # velocities that are angles
        if lags:
            moved[[1 + k for k in lags]] = self._results("rhs", inputs)[0][lags]
        return [values, casadi.jtimes(values, casadi.vertcat(inputs["t"], x), moved)]

    def _more_rows(self, inputs: Mapping[str, casadi.SX]) -> list[casadi.SX]:
        return [self._results(rows.function, inputs)[0][rows.indices.tolist()] for rows in self._more]

    def _results(self, function: str, inputs: Mapping[str, casadi.SX]) -> list[casadi.SX]:
        """Results of a generated function as expressions."""
        graph = self._model.symbolic(function)
        found: list[casadi.SX] = graph.call([inputs[name] for name in graph.name_in()])
        return found


def _split(every: Array, columns: Sequence[tuple[str, int]]) -> dict[str, Array]:
    """Columns of each channel, by its name."""
    ends = np.cumsum([size for _, size in columns])[:-1]
    return dict(zip((name for name, _ in columns), np.split(every, ends, axis=1), strict=True))


def _rows(model: LoadedModel, channel: str) -> list[Rows]:
    if channel != WINDOWS:
        return rows_of(model, channel)
    count = len(model.manifest.edges)
    labels = tuple(f"{WINDOWS}[{k + 1}]" for k in range(count))
    return [Rows(function=WINDOWS, indices=np.arange(count), labels=labels, units=("rad",) * count)]


def jumps(model: LoadedModel, channel: str) -> bool:
    """Whether a channel jumps at a window's edge, where the angle is a state."""
    windows = {k for k in model.manifest.borders if model.manifest.inputs[k].windows}
    return bool(windows) and channel not in model.states and bool(windows & set(depends(model, channel, "u")))
