"""Vectors in the plane: pairs (x, y) of SymPy expressions, and what is computed of them."""

from __future__ import annotations

import sympy as sp

#: Plane vector: x and y components.
Pair = tuple[sp.Expr, sp.Expr]

ZERO: Pair = (sp.S.Zero, sp.S.Zero)


def add(*vectors: Pair) -> Pair:
    """Sum of plane vectors."""
    return sp.Add(*(v[0] for v in vectors)), sp.Add(*(v[1] for v in vectors))


def scale(factor: sp.Expr, vector: Pair) -> Pair:
    """Vector times a scalar."""
    return factor * vector[0], factor * vector[1]


def subtract(left: Pair, right: Pair) -> Pair:
    """Difference of plane vectors."""
    return left[0] - right[0], left[1] - right[1]


def dot(left: Pair, right: Pair) -> sp.Expr:
    """Scalar product."""
    return left[0] * right[0] + left[1] * right[1]


def cross(left: Pair, right: Pair) -> sp.Expr:
    """Component of the vector product out of the plane, positive counter-clockwise."""
    return left[0] * right[1] - left[1] * right[0]


def unit(angle: sp.Expr) -> Pair:
    """The unit vector at an angle from +x [rad]."""
    return sp.cos(angle), sp.sin(angle)


def quarter_turn(vector: Pair) -> Pair:
    """The vector turned by 90 degrees counter-clockwise."""
    return -vector[1], vector[0]


def rotate(cos: sp.Expr, sin: sp.Expr, vector: Pair) -> Pair:
    """The vector turned counter-clockwise by the angle with this cosine and sine."""
    x, y = vector
    return cos * x - sin * y, sin * x + cos * y
