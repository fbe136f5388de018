"""Case distinctions by arithmetic alone, so that floats, arrays and CasADi's symbols go through them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np


def larger(a: Any, b: Any) -> Any:
    """The larger of two numbers."""
    return (a + b + abs(a - b)) / 2.0


def smaller(a: Any, b: Any) -> Any:
    """The smaller of two numbers."""
    return (a + b - abs(a - b)) / 2.0


def cosine(angle: Any) -> Any:
    """Cosine of an angle [rad]; NumPy's own warns of CasADi's symbols."""
    return angle.cos() if hasattr(angle, "cos") else np.cos(angle)


def interpolated(x: Any, knots: Sequence[float], values: Sequence[float]) -> Any:
    """Piecewise linear through a table; beyond it the first and the last slope continue.

    Parameters
    ----------
    knots : increasing, two or more
    """
    slopes = [(values[k + 1] - values[k]) / (knots[k + 1] - knots[k]) for k in range(len(knots) - 1)]
    result = values[0] + slopes[0] * (x - knots[0])
    for knot, before, behind in zip(knots[1:-1], slopes[:-1], slopes[1:], strict=True):
        result = result + (behind - before) * larger(x - knot, 0.0)
    return result
