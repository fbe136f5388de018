"""Records: a quantity, the declaration of its kind, the data of a run that it gets, its result."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import casadi
import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.contract.manifest import BearingInfo, Manifest
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.reduction_rows import HEAD, MOMENTS, ReductionRows, reduction_rows
from ballpass.runtime.quantity.nodes import Nodes
from ballpass.runtime.request.resolve import Run

if TYPE_CHECKING:
    from ballpass.runtime.quantity.track import Signal
    from ballpass.runtime.run.directions import Chain

Array = NDArray[np.float64]

#: Fractions nearer than this to a cut are at it.
AT_EDGE = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """A quantity of interest as asked for.

    Attributes
    ----------
    name : as written
    kind : name of its `Kind`
    channel : state or output, "" for a quantity that names none; of one at rest the prefix of its bearing
    ball : which ball, counted from 1; None for the most loaded one, and for outputs without balls
    place : the part after ``@``
    unit : of the value
    """

    name: str
    kind: str
    channel: str
    ball: int | None
    place: str
    unit: str

    def bearing(self, manifest: Manifest) -> BearingInfo:
        """The bearing of the channel, else the first."""
        ours = (one for one in manifest.bearings if one.prefix and self.channel.startswith(one.prefix))
        return next(ours, manifest.bearings[0])


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """The place that a kind expects after ``@``.

    Attributes
    ----------
    words, example : for messages
    is_valid : whether a text is one, for a model; without a manifest for any
    """

    words: str
    example: str
    is_valid: Callable[[Manifest | None, str], bool]


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind:
    """A kind of quantity: its declaration for the rest of the program.

    Attributes
    ----------
    name : in front of the colon
    summary : one line for help
    words : for figures, after those of the channel; "" for the name
    also : other names
    takes : what follows the name: a state or output, nothing, or the bearing that it is of, in motion or at rest
    channel : output that a kind without a named one uses
    place : the expected part after ``@``; None for none
    unit : of the value; "" for that of the channel
    unit_of : unit of the value from that of the channel, where it is another
    check : raises `RequestError` where it cannot be evaluated for a model with its default numbers in any run
    evaluate : value and derivative along the nodes of a run; None for rings at rest
    at_rest : value and derivative without a run
    extremes : extremes of the channel that it needs
    around : whether it needs nodes around its extreme as well
    at_moment : whether it needs one moment only, for any nodes
    steep : whether the third power of the channel is integrated, which needs finer nodes
    frequency : fastest oscillation that the channel is multiplied with [Hz], and its derivative; None where it is not
    beside : further channels that it needs, after the bearing's prefix
    reduced : value from the reductions of runs, shape (runs,); None where they do not hold it
    needs : channels that are reduced for it, from its own; None for that one
    rows : of each the extremes and moments
    """

    name: str
    summary: str
    words: str = ""
    also: tuple[str, ...] = ()
    takes: Literal["channel", "nothing", "bearing", "bearing at rest"] = "channel"
    channel: str = ""
    place: Place | None = None
    unit: str = ""
    unit_of: Callable[[str], str] | None = None
    check: Callable[[Manifest, Mapping[str, float], Quantity], None] | None = None
    evaluate: Callable[[View, Quantity], Estimate] | None = None
    at_rest: Callable[[LoadedModel, Numbers, Quantity, Chain | None], Estimate] | None = None
    extremes: tuple[str, ...] = ()
    around: bool = False
    at_moment: bool = False
    steep: bool = False
    frequency: Callable[[View, Quantity], tuple[float, Array]] | None = None
    beside: tuple[str, ...] = ()
    reduced: Callable[[ReducedRuns, Quantity], Array] | None = None
    needs: Callable[[str], tuple[str, ...]] | None = None
    rows: tuple[str, ...] = ()

    @property
    def integrates(self) -> bool:
        """Whether it is an integral over the run; of a kind with extremes as well its rows say so."""
        return not (self.extremes or self.at_moment) or any(row in MOMENTS for row in self.rows)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mark:
    """A moment of a run at which a quantity is taken: an extreme, or a place.

    Attributes
    ----------
    time : [s]
    value : of the channel there
    ball : column of the channel
    segment, fraction : interval between cuts, and place within it
    other : column that the channel's most loaded ball changes to or from at this very moment; None elsewhere
    rate, other_rate : time derivatives of both columns there, where there is another [channel's unit / s]
    node : its node
    around : nodes at equal distances before and after it, the same number of both
    competing : the next extremes elsewhere in the run
    """

    time: float
    value: float = math.nan
    ball: int = 0
    segment: int = 0
    fraction: float = math.nan
    other: int | None = None
    rate: float = 0.0
    other_rate: float = 0.0
    node: int = 0
    around: tuple[int, ...] = ()
    competing: tuple[Mark, ...] = ()

    @property
    def at_edge(self) -> bool:
        """Whether it lies at a cut that moves: an edge of a load or of the window."""
        return min(self.fraction, 1.0 - self.fraction) < AT_EDGE


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class View:
    """Data of a run for a kind.

    Attributes
    ----------
    run, nodes : the run, and where it is evaluated
    signals : channels along the nodes
    marks : moments by quantity, and "max", "min" or "place"
    slopes : derivative of a parameter or constant by name, shape (directions,)
    names : parameters, one direction each
    """

    run: Run
    nodes: Nodes
    signals: Mapping[str, Signal]
    marks: Mapping[tuple[str, str], Mark] = field(default_factory=dict)
    slopes: Callable[[str], Array] = lambda _: np.zeros(0)
    names: tuple[str, ...] = ()

    @property
    def manifest(self) -> Manifest:
        """Of the model."""
        return self.run.model.manifest

    @property
    def numbers(self) -> Numbers:
        """Of the run."""
        return self.run.numbers

    @property
    def directions(self) -> int:
        """How many there are."""
        return len(self.names)

    def channel(self, quantity: Quantity) -> tuple[Array, Array]:
        """The quantity's channel along the nodes, and its derivative: shapes (nodes,), (nodes, directions)."""
        signal = self.signals[quantity.channel]
        if quantity.ball is not None or signal.value.shape[1] == 1:
            column = 0 if quantity.ball is None else quantity.ball - 1
            return signal.value[:, column], signal.slope[:, column]
        rows, best = np.arange(len(signal.value)), np.argmax(signal.value, axis=1)
        return signal.value[rows, best], signal.slope[rows, best]

    def integral(self, values: Array, slopes: Array) -> tuple[float, Array]:
        """Integral over the time that counts, and its derivative, shape (directions,).

        Parameters
        ----------
        values, slopes : integrand at the nodes and its derivative, shapes (nodes,), (nodes, directions)
        """
        nodes = self.nodes
        # not by BLAS, whose threads cost more than so short a sum
        moved = np.einsum("n,nd->d", nodes.weight, slopes) + np.einsum("n,nd->d", values, nodes.weight_slope)
        return float(np.einsum("n,n->", nodes.weight, values)), moved

    def mean(self, values: Array, slopes: Array) -> tuple[float, Array]:
        """Mean over the time that counts, and its derivative; as `integral`."""
        total, moved = self.integral(values, slopes)
        length, longer = self.length
        mean = total / length
        return mean, (moved - mean * longer) / length

    @property
    def length(self) -> tuple[float, Array]:
        """Length of the time that counts [s], and its derivative, shape (directions,) [s/unit]."""
        return float(np.sum(self.nodes.weight)), np.sum(self.nodes.weight_slope, axis=0)

    def rated_slopes(self, bearing: BearingInfo, rated: Callable[[Mapping[str, Any]], Any]) -> Array:
        """Derivatives of what a bearing is rated by along the directions, shape (entries, directions).

        Parameters
        ----------
        rated : CasADi's expression of parameters by name
        """
        values = self.numbers.values
        names = [name for name in self.numbers.parameters if name.startswith(f"{bearing.path}.")]
        every = casadi.SX.sym("parameters", len(names))
        each = casadi.SX(rated(dict(zip(names, casadi.vertsplit(every), strict=True))))
        slopes = casadi.Function("slopes", [every], [casadi.jacobian(each, every)])([values[name] for name in names])
        seeds = np.array([self.slopes(name) for name in names]).reshape(len(names), self.directions)
        return np.asarray(np.asarray(slopes) @ seeds)

    def zero(self, note: str, moved: Array) -> Estimate:
        """A norm that is zero; `moved` are derivatives of the quantity inside."""
        kink = "it is zero and has a corner there; the derivative given is zero" if np.any(moved) else ""
        return Estimate(value=0.0, slope=np.zeros(self.directions), notes=(note,), kink=kink)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReducedRuns:
    """Reductions of one run or of many.

    Attributes
    ----------
    manifest : of the model
    rows : reductions, shape (runs, .)
    end : states at the end, shape (runs, states)
    values : parameters and constants by name, numbers or of shape (runs,)
    """

    manifest: Manifest
    rows: Array
    end: Array
    values: Mapping[str, float | Array]

    @property
    def layout(self) -> ReductionRows:
        """Of the rows."""
        return reduction_rows(self.manifest)

    @property
    def duration(self) -> Array:
        """Time that was reduced, shape (runs,) [s]."""
        return np.asarray(self.rows[:, HEAD.index("duration")])

    def entry(self, row: str, channel: str) -> Array:
        """An entry of `ROWS` of a channel, shape (runs,)."""
        return np.asarray(self.rows[:, self.layout.columns[row, channel]])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Estimate:
    """A quantity's value and derivative.

    Attributes
    ----------
    value : in the quantity's unit
    slope : derivative along the directions, shape (directions,)
    time, ball : of an extreme: when [s], and which ball, counted from 1
    notes : remarks
    kink : why there is no derivative, or one on each side; empty where there is one
    """

    value: float
    slope: Array
    time: float | None = None
    ball: int | None = None
    notes: tuple[str, ...] = ()
    kink: str = ""
