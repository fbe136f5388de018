"""Calls of C functions: addresses of arrays, types of arguments."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from numpy.typing import DTypeLike


def padded(inputs: np.ndarray) -> np.ndarray:
    """Inputs, shape (segments, inputs); zeros where a model has none, as C has no arrays without numbers."""
    return inputs if inputs.shape[1] else np.zeros((len(inputs), 1))


def address(array: np.ndarray | None, kind: DTypeLike = np.float64) -> int | None:
    """Address of an array's numbers, which must outlive its use; TypeError for other than contiguous ones of a kind."""
    if array is None:
        return None
    if array.dtype != kind or not array.flags.c_contiguous:
        raise TypeError(f"a C-contiguous array of {np.dtype(kind)} is expected, not {array.dtype}, {array.flags}")
    found: int = array.ctypes.data
    return found


class ArrayOf:
    """Argument of a C function that is an array of numbers, or None for no array.

    Its address is passed as a number: making typed pointers would take as long as a hundred steps.
    """

    def __init__(self, kind: DTypeLike) -> None:
        self._kind = np.dtype(kind)

    def from_param(self, array: np.ndarray | None) -> ctypes.c_void_p:
        """What ctypes passes for an array, which it keeps until the call is over."""
        return ctypes.c_void_p(address(array, self._kind))


DOUBLES, LONGS, BYTES = ArrayOf(ctypes.c_double), ArrayOf(ctypes.c_long), ArrayOf(ctypes.c_uint8)


def declare(code: ctypes.CDLL, name: str, result: type | None, *arguments: Any) -> None:
    """Tell ctypes the types of a C function's result and arguments, where the library has it."""
    if hasattr(code, name):
        function = getattr(code, name)
        function.restype, function.argtypes = result, arguments
