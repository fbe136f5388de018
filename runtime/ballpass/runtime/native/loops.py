"""Generated functions at many points in one call of C.

In: a compiled function and arrays of arguments.  Out: arrays of results, written in place by `driver/loop.c`.  The
price of a call does not depend on the number of points, and no point costs any Python.
"""

from __future__ import annotations

import ctypes
from collections.abc import Collection, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import casadi
import numpy as np

from ballpass.runtime.native.compile import compile_sources
from ballpass.runtime.native.compilers import Compiler
from ballpass.runtime.native.driver_library import DRIVER, declare
from ballpass.runtime.native.kernel import Array, EvaluationError, Loop

_Pointers = ctypes.POINTER(ctypes.c_void_p)
_Longs = ctypes.POINTER(ctypes.c_long)


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
        raise TypeError(f"{function.name()}: {name!r} is sparse; a dense one is expected")
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
