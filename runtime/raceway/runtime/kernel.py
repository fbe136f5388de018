"""Calling generated functions without CasADi's price per call.

A call through Python costs 30 microseconds; through a buffer, on memory given once, a few.  A `Kernel` owns that memory.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi
import numpy as np

#: Samples that one compiled loop takes: few enough for the cache, many enough for the price of a call to vanish.
BLOCK = 256


class EvaluationError(ArithmeticError):
    """A generated function reported failure."""


class Kernel:
    """One generated function on fixed memory.

    Not for several threads at once: they would share the memory.

    Attributes
    ----------
    function : the CasADi function
    """

    def __init__(self, function: casadi.Function) -> None:
        self.function = function
        self._buffer, self._evaluate = function.buffer()
        self._inputs = {}
        self._outputs = {}
        self._patterns = {}
        for k, name in enumerate(function.name_in()):
            memory = np.zeros(function.nnz_in(k))
            if function.size_in(k)[0] * function.size_in(k)[1] != memory.size:
                raise TypeError(f"{function.name()}: input {name!r} is sparse; a dense one is expected")
            self._inputs[name] = memory
            if memory.size:
                self._buffer.set_arg(k, memoryview(memory))
        for k, name in enumerate(function.name_out()):
            sparsity = function.sparsity_out(k)
            memory = np.zeros(sparsity.nnz())
            self._outputs[name] = memory
            if memory.size:
                self._buffer.set_res(k, memoryview(memory))
            self._patterns[name] = (sparsity.shape, None if sparsity.is_dense() else _positions(sparsity))

    def __call__(self, values: Mapping[str, Any]) -> np.ndarray:
        """First output for the inputs in `values` (other keys are ignored); an own copy, shape (rows,) or (rows, columns)."""
        self.run(values)
        return self.output(next(iter(self._outputs)))

    def run(self, values: Mapping[str, Any]) -> None:
        """Evaluate; the outputs are then to be had by `output`.

        Raises
        ------
        EvaluationError
            The function reports failure (an integrator that gave up).
        """
        for name, memory in self._inputs.items():
            if name in values:
                memory[:] = values[name]
        self._evaluate()
        if self._buffer.ret():
            raise EvaluationError(f"{self.function.name()} reported failure")

    def output(self, name: str) -> np.ndarray:
        """Copy of an output of the last evaluation, dense; a single column loses its second dimension."""
        memory = self._outputs[name]
        shape, positions = self._patterns[name]
        if positions is None:
            dense = memory.reshape(shape, order="F").copy()
        else:
            dense = np.zeros(shape)
            dense[positions] = memory
        return dense[:, 0] if shape[1] == 1 else dense


def evaluate_many(
    function: casadi.Function, count: int, varying: Mapping[str, np.ndarray], fixed: Mapping[str, Any]
) -> dict[str, np.ndarray]:
    """Evaluate `function` at `count` points in compiled loops of `BLOCK`.

    Parameters
    ----------
    function : a function of t, x, u, p, c or some of them
    count : number of points
    varying : inputs that change, each of shape (count,) or (count, rows)
    fixed : inputs that do not

    Returns
    -------
    dict from output name to array, shape (count, rows)
    """
    names = function.name_in()
    results: dict[str, list[np.ndarray]] = {name: [] for name in function.name_out()}
    loop = function.map(function.name() + "_block", "serial", BLOCK, [k for k, n in enumerate(names) if n in fixed], [])
    for first in range(0, count, BLOCK):
        size = min(BLOCK, count - first)
        arguments = []
        for name in names:
            if name in varying:
                part = np.asarray(varying[name], dtype=float)[first : first + size].reshape(size, -1)
                # the last block is filled up with its last point
                arguments.append(np.concatenate([part, np.repeat(part[-1:], BLOCK - size, axis=0)]).T)
            else:
                arguments.append(np.asarray(fixed[name], dtype=float))
        for name, value in zip(results, loop.call([casadi.DM(a) for a in arguments]), strict=True):
            rows = function.size1_out(name)
            results[name].append(np.asarray(value.full()).reshape(rows, BLOCK).T[:size])
    return {
        name: np.concatenate(parts) if parts else np.zeros((0, function.size1_out(name)))
        for name, parts in results.items()
    }


def _positions(sparsity: casadi.Sparsity) -> tuple[np.ndarray, np.ndarray]:
    rows, columns = sparsity.get_triplet()
    return np.array(rows, dtype=int), np.array(columns, dtype=int)
