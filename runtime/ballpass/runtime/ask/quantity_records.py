"""What a quantity is, what it sees of a run, and what it gives: records alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.ask.nodes import Nodes, Window
from ballpass.runtime.contract import Manifest
from ballpass.runtime.contract.parameters import Numbers

if TYPE_CHECKING:
    from ballpass.runtime.ask.track import Signal

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """A quantity of interest as asked for.

    Attributes
    ----------
    name : as written
    kind : entry of `kinds.KINDS`
    channel : state or output, "" for a quantity that names none; of a static one the prefix of its bearing
    ball : which ball, counted from 1; None for the most loaded one, and for outputs without balls
    place : what stands behind ``@``
    unit : of the value
    """

    name: str
    kind: str
    channel: str
    ball: int | None
    place: str
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mark:
    """A moment of a run at which a quantity is taken: an extreme, or a place.

    Attributes
    ----------
    node : its node
    time : [s]
    ball : column of the channel
    other : column that the channel's most loaded ball changes to or from at this very moment; None elsewhere
    rate, other_rate : time derivatives of both columns there, where there is another
    at_edge : whether the extreme lies at an edge of a load or of the window
    rivals : the next extremes elsewhere in the run
    """

    node: int
    time: float
    ball: int
    other: int | None = None
    rate: float = 0.0
    other_rate: float = 0.0
    at_edge: bool = False
    rivals: tuple[Mark, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class View:
    """What a kind sees of a run.

    Attributes
    ----------
    manifest, numbers, window, nodes : of the run
    signals : channels along the nodes
    marks : moments by quantity, and "max", "min" or "place"
    slopes : derivative of a parameter or constant by name, shape (directions,)
    names : parameters, one direction each
    """

    manifest: Manifest
    numbers: Numbers
    window: Window
    nodes: Nodes
    signals: Mapping[str, Signal]
    marks: Mapping[tuple[str, str], Mark]
    slopes: Callable[[str], Array]
    names: tuple[str, ...]

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
        return float(nodes.weight @ values), nodes.weight @ slopes + values @ nodes.weight_slope

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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Estimate:
    """A quantity's value and derivative.

    Attributes
    ----------
    value : in the quantity's unit
    slope : derivative along the directions, shape (directions,)
    time, ball : of an extreme: when [s], and which ball, counted from 1
    notes : what to mind
    kink : why the derivative is that of one side, or of none; empty where there is one
    """

    value: float
    slope: Array
    time: float | None = None
    ball: int | None = None
    notes: tuple[str, ...] = ()
    kink: str = ""
