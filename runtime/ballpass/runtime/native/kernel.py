"""Calling generated functions without CasADi's price per call.

A call through Python costs 30 microseconds; through a buffer, on memory given once, a few.  A `Kernel` owns that
memory; a `Loop` does the same for many points at once.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Samples that one compiled loop takes: few enough for the cache, many enough for the price of a call to vanish.
BLOCK = 256


class EvaluationError(ArithmeticError):
    """A generated function reported failure."""


class CompiledKernel:
    """One generated function on fixed memory.

    Not for several threads at once: they would share the memory.

    Attributes
    ----------
    function : the CasADi function
    inputs, outputs : memory of each argument and result, by name
    """

    def __init__(self, function: casadi.Function) -> None:
        self.function = function
        buffer: Any = function.buffer()
        self._buffer, self._evaluate = buffer
        self.inputs: dict[str, Array] = {}
        self.outputs: dict[str, Array] = {}
        self._patterns: dict[str, tuple[tuple[int, int], tuple[Array, Array] | None]] = {}
        for k, name in enumerate(function.name_in()):
            memory = np.zeros(function.nnz_in(k))
            if function.size_in(k)[0] * function.size_in(k)[1] != memory.size:
                raise TypeError(f"{function.name()}: input {name!r} is sparse; a dense one is expected")
            self.inputs[name] = memory
            if memory.size:
                self._buffer.set_arg(k, memory.data)
        for k, name in enumerate(function.name_out()):
            sparsity = function.sparsity_out(k)
            memory = np.zeros(sparsity.nnz())
            self.outputs[name] = memory
            if memory.size:
                self._buffer.set_res(k, memory.data)
            self._patterns[name] = (sparsity.shape, None if sparsity.is_dense() else _positions(sparsity))

    def __call__(self, values: Mapping[str, Any]) -> Array:
        """First output for the inputs in `values`; a copy, (rows,) or (rows, columns).  Other keys are ignored."""
        self.run(values)
        return self.output(next(iter(self.outputs)))

    def run(self, values: Mapping[str, Any]) -> None:
        """Evaluate; the outputs are then to be had by `output`.

        Raises
        ------
        EvaluationError
            The function reports failure (an integrator that gave up).
        """
        for name, memory in self.inputs.items():
            if name in values:
                memory[:] = values[name]
        self._evaluate()
        if self._buffer.ret():
            raise EvaluationError(f"{self.function.name()} reported failure")

    def output(self, name: str) -> Array:
        """Copy of an output of the last evaluation, dense, shape (rows, columns); (rows,) where there is one column."""
        memory = self.outputs[name]
        shape, positions = self._patterns[name]
        if positions is None:
            dense = memory.reshape(shape, order="F").copy()
        else:
            dense = np.zeros(shape)
            dense[positions] = memory
        return dense[:, 0] if shape[1] == 1 else dense


class Loop:
    """One generated function at many points, in compiled loops of `BLOCK`, on fixed memory.

    Attributes
    ----------
    function : the CasADi function of one point
    """

    def __init__(self, function: casadi.Function, varying: Collection[str]) -> None:
        """`varying` names the inputs that change from point to point."""
        self.function = function
        names = function.name_in()
        for k, name in enumerate(function.name_out()):
            if not function.sparsity_out(k).is_dense():
                raise TypeError(f"{function.name()}: output {name!r} is sparse; a dense one is expected")
        self._varying = [name for name in names if name in varying]
        fixed = [k for k, name in enumerate(names) if name not in varying]
        self._block = CompiledKernel(function.map(function.name(), "serial", BLOCK, fixed, []))

    def __call__(
        self, count: int, values: Mapping[str, Any], wanted: Collection[str] | None = None
    ) -> dict[str, Array]:
        """Outputs at `count` points.

        Parameters
        ----------
        count : number of points
        values : inputs by name; those that vary of shape (count,) or (count, rows), the others of shape (rows,);
            further keys are ignored
        wanted : names of outputs.  Default: all

        Returns
        -------
        dict from output name to array, shape (count, rows)

        Raises
        ------
        EvaluationError
            The function reports failure.
        """
        # columns of CasADi's matrices are points: rows of NumPy's
        blocks = {
            name: memory.reshape(BLOCK, -1 if memory.size else 0)
            for name, memory in self._block.outputs.items()
            if wanted is None or name in wanted
        }
        results = {name: np.empty((count, block.shape[1])) for name, block in blocks.items()}
        for name, memory in self._block.inputs.items():
            if name not in self._varying:
                memory[:] = values[name]
        for first in range(0, count, BLOCK):
            size = min(BLOCK, count - first)
            for name in self._varying:
                points = np.asarray(values[name])[first : first + size]
                self._block.inputs[name][: points.size] = points.reshape(-1)
            self._block.run({})  # of the last block, also points left over from earlier ones: they are dropped
            for name, samples in results.items():
                samples[first : first + size] = blocks[name][:size]
        return results


def _positions(sparsity: casadi.Sparsity) -> tuple[Array, Array]:
    rows, columns = sparsity.get_triplet()
    return np.array(rows, dtype=int), np.array(columns, dtype=int)
