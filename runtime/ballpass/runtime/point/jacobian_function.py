"""A Jacobian prepared for many calls: one generated function on fixed memory, with its sparsity pattern.

In: a model, numbers, outputs and variables to differentiate by.  Out: a `JacobianFunction`, called with a state in
about a microsecond: the pattern is found once, and a call copies the state, runs compiled code and picks the entries.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import casadi
import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.contract.arguments import brief, typed
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.extras import need
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.kernel import CompiledKernel
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.point.evaluate import checked_time, point
from ballpass.runtime.point.jacobian import ARGUMENTS, JacobianDirections, Rows, directions_of, rows_of

if TYPE_CHECKING:
    from scipy.sparse import csc_array


Array = NDArray[np.float64]
Whole = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sparsity:
    """Compressed columns: entries of column j are ``rows[starts[j]:starts[j + 1]]``, increasing.

    Attributes
    ----------
    shape : rows and columns of the matrix
    starts : shape (columns + 1,)
    rows : row of each entry, shape (entries,)

    Examples
    --------
    >>> pattern = model.jacobian_function("rhs", "states").sparsity
    >>> pattern.shape, len(pattern.rows), len(pattern.starts)
    ((8, 8), 36, 9)
    """

    shape: tuple[int, int]
    starts: Whole
    rows: Whole

    @property
    def columns(self) -> Whole:
        """Column of each entry, shape (entries,)."""
        return np.repeat(np.arange(self.shape[1]), np.diff(self.starts))


class JacobianFunction:
    """Derivative of one generated function's rows along states or other directions, ready to be called.

    Not for several threads at once: calls share memory.

    Attributes
    ----------
    rows, columns : labels of the matrix
    row_units, column_units : SI units
    sparsity : where entries can differ from zero
    values : entries of the last call, in the order of `sparsity`; overwritten by the next call
    x : memory of the state, shape (states,)
    evaluate : the compiled code alone, for callers that write `x` and read `values` directly

    Examples
    --------
    >>> J = model.jacobian_function("ball.force", "states")
    >>> J(model.initial()).shape, J.rows[0], J.columns[0], J.row_units[0]
    ((64,), 'ball.force[1]', 'inner.x', 'N')
    """

    def __repr__(self) -> str:
        return (
            f"JacobianFunction({len(self.rows)} rows {self.rows[0]} ... by {len(self.columns)} columns "
            f"{self.columns[0]} ..., {len(self.sparsity.rows)} entries)"
        )

    def __init__(
        self, model: LoadedModel, numbers: Numbers, of: str | Sequence[str], wrt: str | Sequence[str], *, t: float
    ) -> None:
        self._model, self._wrt = model, wrt
        chosen = rows_of(model, of)
        if len(chosen) != 1:
            groups = "; ".join(", ".join(part.labels) for part in chosen)
            raise RequestError(
                f"jacobian_function: the quantities come from {len(chosen)} generated functions ({groups}). Make one "
                "for each, or take model.jacobian."
            )
        rows = chosen[0]
        directions = directions_of(model, numbers, wrt, checked_time(t))
        self.rows, self.row_units = rows.labels, rows.units
        self.columns, self.column_units = directions.labels, directions.units
        # states alone: a sparse block as it is generated; else the derivative along each direction
        self._by_states = all(label in model.states for label in self.columns)
        function, entries = self._prepare(rows, directions)
        self._entries = entries
        self._kernel = CompiledKernel(function)
        self.evaluate = self._kernel.evaluate
        (result,) = self._kernel.outputs.values()
        whole = len(entries) == len(result) and bool(np.all(entries == np.arange(len(entries))))
        self._result = None if whole else result
        self.values = result if whole else np.zeros(len(entries))
        self.x = self._kernel.inputs["x"]
        self._place(numbers, t, directions)

    def _prepare(self, rows: Rows, directions: JacobianDirections) -> tuple[casadi.Function, Whole]:
        """The function to call and which of its results are entries; sets `sparsity`."""
        model, shape = self._model, (len(rows.labels), len(directions.labels))
        pattern = np.zeros(shape, dtype=bool)
        for argument in ARGUMENTS:
            name, along = f"{rows.function}_jac_{argument}", directions.of(argument) != 0.0
            if model.has(name) and np.any(along):
                block = casadi.DM.ones(model.function(name).sparsity_out(0)).full()
                pattern |= (block[rows.indices] @ along) > 0.0
        starts = np.concatenate([[0], np.cumsum(pattern.sum(axis=0))])
        column, row = np.nonzero(pattern.T)
        self.sparsity = Sparsity(shape=shape, starts=starts, rows=row)
        name = f"{rows.function}_jac_x"
        if self._by_states and model.has(name):
            function = model.function(name)
            nonzeros, state = function.sparsity_out(0), np.argmax(directions.x, axis=0)
            places = zip(rows.indices[row].tolist(), state[column].tolist(), strict=True)
            return function, np.array([nonzeros.get_nz(*place) for place in places], dtype=np.int64)
        single = model.function(f"{rows.function}_tangent")
        size, count = single.size1_out(0), shape[1]
        if count > 1:
            fixed = [k for k, name in enumerate(single.name_in()) if name in ARGUMENTS]
            single = single.map(f"{single.name()}_{count}", "serial", count, fixed, [])
        return single, np.asarray(column * size + rows.indices[row], dtype=np.int64)

    def _place(self, numbers: Numbers, t: float, directions: JacobianDirections) -> None:
        """Write everything but the state."""
        values: dict[str, Any] = point(self._model, numbers, t, None)
        for name, memory in self._kernel.inputs.items():
            if name == "x":
                continue
            memory[:] = values[name] if name in ARGUMENTS else directions.of(name[1:]).reshape(-1, order="F")

    @typed
    def move(self, t: float, parameters: dict[str, float] | None = None) -> None:
        """Go to another time [s] and other parameters; the state stays.

        Examples
        --------
        >>> J = model.jacobian_function("rhs", "states")
        >>> J.move(0.08, {"bearing.clearance": 8e-6})  # [s], [m]
        >>> J(model.initial()).shape
        (36,)
        """
        numbers = self._model.numbers(parameters)
        self._place(numbers, checked_time(t), directions_of(self._model, numbers, self._wrt, t))

    def __call__(self, x: Array | Sequence[float]) -> Array:
        """Entries at a state, in the order of `sparsity`; the same memory each time: copy it to keep it.

        Examples
        --------
        >>> J = model.jacobian_function("rhs", "states")
        >>> J(model.initial()).shape == J.sparsity.rows.shape
        True
        """
        try:
            self.x[:] = x
        except (TypeError, ValueError, OverflowError):
            raise RequestError(f"x: {len(self.x)} numbers are expected, not {brief(x)} ({type(x).__name__}).") from None
        self.evaluate()  # straight-line code: it has no failure to report
        if self._result is not None:
            # mode: the indices are right, and checking them would need a buffer
            self._result.take(self._entries, out=self.values, mode="clip")
        return self.values

    def to_dense(self) -> Array:
        """Matrix of the last call, shape (rows, columns).

        Examples
        --------
        >>> J = model.jacobian_function("rhs", "states")
        >>> entries = J(model.initial())
        >>> J.to_dense().shape
        (8, 8)
        """
        dense = np.zeros(self.sparsity.shape)
        dense[self.sparsity.rows, self.sparsity.columns] = self.values
        return dense

    def to_scipy(self) -> csc_array:
        """Matrix of the last call as ``scipy.sparse.csc_array``.

        Examples
        --------
        >>> J = model.jacobian_function("rhs", "states")
        >>> entries = J(model.initial())
        >>> J.to_scipy().nnz == len(entries)
        True
        """
        pattern = self.sparsity
        return need("scipy.sparse").csc_array((self.values.copy(), pattern.rows, pattern.starts), shape=pattern.shape)
