"""The right-hand sides of hand_written.c and of numba as functions that return an array: for the check of both."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.own import c_numbers, hand
from benchmarks.press import Press, Rate
from benchmarks.problem import Member


def make(member: Member) -> Rate:
    """dx/dt by hand_written.c for a member's numbers."""
    numbers = c_numbers(member)
    code = hand()

    def rate(_: Press, gate: float, t: float, x: np.ndarray) -> np.ndarray:
        inside, outside = np.ascontiguousarray(x), np.empty(8)
        code.press_rate(ctypes.addressof(numbers), gate, t, inside.ctypes.data, outside.ctypes.data)
        return outside

    return rate


def returning(fills: Callable[[Press, float, float, Any, Any], None]) -> Rate:
    """A rate that returns what another writes."""

    def rate(n: Press, gate: float, t: float, x: np.ndarray) -> np.ndarray:
        outside = np.empty(8)
        fills(n, gate, t, x, outside)
        return outside

    return rate
