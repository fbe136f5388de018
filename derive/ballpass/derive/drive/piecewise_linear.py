"""A function that is linear between knots, as an expression of its argument."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import sympy as sp


def piecewise_linear(argument: sp.Expr, knots: Sequence[sp.Expr], values: Sequence[sp.Expr]) -> sp.Expr:
    """Value over `argument`, constant before the first knot and after the last.

    The sum of the first value and, for every piece, its slope times the part of the piece below the argument.
    """
    total = values[0]
    for (left, right), (low, high) in zip(pairwise(knots), pairwise(values), strict=True):
        width = right - left
        past = sp.Min(sp.Max(argument - left, 0, evaluate=False), width, evaluate=False)
        total += (high - low) / width * past
    return total
