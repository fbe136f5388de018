"""Calling generated functions without CasADi's price per call.

A call through Python costs 30 microseconds; through a buffer, on memory given once, a few.  A `CompiledKernel` owns
that memory; a `Loop` does the same for many points at once.  A `CompiledLoop` is one call of C (`driver/loop.c`) on
arrays, in place: no point costs any Python.
"""

from __future__ import annotations

import ctypes
from collections.abc import Collection, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.native.c_calls import declare
from ballpass.runtime.native.compile import compile_sources
from ballpass.runtime.native.compilers import Compiler
from ballpass.runtime.native.driver_library import DRIVER

Array = NDArray[np.float64]

_Pointers = ctypes.POINTER(ctypes.c_void_p)
_Longs = ctypes.POINTER(ctypes.c_long)

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
    evaluate : the compiled code alone, from one memory to the other
    """

    def __init__(self, function: casadi.Function) -> None:
        self.function = function
        buffer: Any = function.buffer()
        self._buffer, self.evaluate = buffer  # the first owns the memory the second works on
        self.inputs: dict[str, Array] = {}
        self.outputs: dict[str, Array] = {}
        self._patterns: dict[str, tuple[tuple[int, int], tuple[Array, ...] | None]] = {}
        for k, name in enumerate(function.name_in()):
            memory = np.zeros(_dense_rows(function, name, k))
            self.inputs[name] = memory
            if memory.size:
                self._buffer.set_arg(k, memory.data)
        for k, name in enumerate(function.name_out()):
            sparsity = function.sparsity_out(k)
            memory = np.zeros(sparsity.nnz())
            self.outputs[name] = memory
            if memory.size:
                self._buffer.set_res(k, memory.data)
            positions = None if sparsity.is_dense() else tuple(np.array(sparsity.get_triplet(), dtype=int))
            self._patterns[name] = (sparsity.shape, positions)

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
        self.evaluate()
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
            _dense_rows(function, name, k, out=True)
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
        values : inputs by name; those that vary of shape (count,) or (count, ...), the others of shape (rows,) or
            (...); further keys are ignored
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
                memory[:] = np.reshape(values[name], -1)
        for first in range(0, count, BLOCK):
            size = min(BLOCK, count - first)
            for name in self._varying:
                points = np.asarray(values[name])[first : first + size]
                self._block.inputs[name][: points.size] = points.reshape(-1)
            self._block.run({})  # of the last block, also points left over from earlier ones: they are dropped
            for name, samples in results.items():
                samples[first : first + size] = blocks[name][:size]
        return results


@cache
def _loop(compiler: Compiler) -> Any:
    """The compiled `driver/loop.c`: one function for all models."""
    code = ctypes.CDLL(str(compile_sources((DRIVER / "loop.c",), compiler, label="ballpass-loop").path))
    declare(
        *(code, "ballpass_loop", ctypes.c_long, ctypes.c_void_p, ctypes.c_long, ctypes.c_long, _Pointers, _Longs),
        *(ctypes.c_long, _Pointers, _Longs, _Pointers, _Pointers, ctypes.c_void_p, ctypes.c_void_p),
    )
    return code.ballpass_loop


class CompiledLoop:
    """One compiled function at many points.

    Attributes
    ----------
    function : the CasADi function of one point
    """

    def __init__(self, compiler: Compiler, library: Path, function: casadi.Function, varying: Collection[str]) -> None:
        """`varying` names the inputs that change from point to point."""
        self.function = function
        self._loop = _loop(compiler)
        self._code = ctypes.CDLL(str(library))  # kept: the function's address lives as long as the library
        name = function.name()
        self._address = ctypes.cast(getattr(self._code, name), ctypes.c_void_p)
        self._names = tuple(function.name_in())
        self._varying = tuple(given in varying for given in self._names)
        self._rows = tuple(_dense_rows(function, name, place) for place, name in enumerate(self._names))
        self._results = {
            name: _dense_rows(function, name, place, out=True) for place, name in enumerate(function.name_out())
        }
        sizes = [ctypes.c_longlong() for _ in range(4)]
        getattr(self._code, f"{name}_work")(*(ctypes.byref(size) for size in sizes))
        arguments, results, self._integers, self._reals = (size.value for size in sizes)
        self._arguments = ctypes.c_void_p * max(arguments, len(self._names))
        self._outputs = ctypes.c_void_p * max(results, len(self._results))
        strides = [rows if varies else 0 for rows, varies in zip(self._rows, self._varying, strict=True)]
        self._stride_in = (ctypes.c_long * len(strides))(*strides)
        self._stride_out = (ctypes.c_long * len(self._results))(*self._results.values())

    def __call__(
        self, count: int, values: Mapping[str, Any], wanted: Collection[str] | None = None
    ) -> dict[str, Array]:
        """Outputs at `count` points, as `Loop` says; one call of C."""
        held = [
            _entry(name, values[name], (count, rows) if varies else (rows,))
            for name, rows, varies in zip(self._names, self._rows, self._varying, strict=True)
        ]
        results = {
            name: np.empty((count, rows)) for name, rows in self._results.items() if wanted is None or name in wanted
        }
        # memory of this call: another thread may be in another one
        integers, reals = np.empty(self._integers + 1, dtype=np.int64), np.empty(self._reals + 1)
        done = self._loop(
            self._address,
            count,
            len(held),
            _addresses(held),
            self._stride_in,
            len(self._results),
            _addresses([results.get(name) for name in self._results]),
            self._stride_out,
            self._arguments(),
            self._outputs(),
            integers.ctypes.data,
            reals.ctypes.data,
        )
        if done != count:
            raise EvaluationError(f"{self.function.name()} reported failure at point {done}")
        return results


#: A function at many points: in the virtual machine, or in C.
PointLoop = Loop | CompiledLoop


def _dense_rows(function: casadi.Function, name: str, place: int, *, out: bool = False) -> int:
    """Rows of an argument or result, which the loop takes for a dense column."""
    pattern = function.sparsity_out(place) if out else function.sparsity_in(place)
    if not pattern.is_dense():
        what = f"{'output' if out else 'input'} {name!r}"
        raise TypeError(f"{function.name()}: {what} is sparse; a dense one is expected")
    return int(pattern.nnz())


def _entry(name: str, value: Any, shape: tuple[int, ...]) -> Array:
    array = np.ascontiguousarray(value, dtype=float)
    if array.size != int(np.prod(shape)):
        raise ValueError(f"{name}: shape {shape} is expected, not {array.shape}")
    return array


def _addresses(arrays: Sequence[Array | None]) -> Any:
    return (ctypes.c_void_p * len(arrays))(
        *(None if array is None or not array.size else array.ctypes.data for array in arrays)
    )
