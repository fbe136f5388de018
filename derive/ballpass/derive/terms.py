"""The words all derivations share: symbols of parameters, named definitions, smoothness.

A derivation is an ordered tuple of `Definition`: symbol := expression, each using parameters, inputs, states and
earlier
symbols only.  Expressions stay as small as on paper, and the visitor of `lower.py` shares them.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import sympy as sp

from ballpass.derive.scene.records import Quantity, Vector

#: Time since the reference time of the phases [s] (see `System.inputs`).
TIME = sp.Symbol("t", real=True)


class Smoothness(Enum):
    """How often a law may be differentiated along its arguments."""

    TWICE_SMOOTH = "twice smooth"  # twice continuously differentiable: second derivatives exist
    SMOOTH = "smooth"  # continuously differentiable
    KINKED = "kinked"  # continuous; the derivative jumps or is unbounded at one point
    DISCONTINUOUS = "discontinuous"  # the value jumps


@dataclass(frozen=True, slots=True, kw_only=True)
class Definition:
    """``symbol := expression``, with unit, words and the symbol people read."""

    symbol: sp.Symbol
    expression: sp.Expr
    unit: str
    description: str
    latex: str


def symbol_of(quantity: Quantity) -> sp.Symbol:
    """Symbol of a scene quantity: its path, so that two quantities can never share one."""
    return sp.Symbol(quantity.path, real=True)


def components(vector: Vector, axis: tuple[int, int] = (1, 0)) -> tuple[sp.Expr, sp.Expr]:
    """Cartesian components of a scene vector; `axis` is where a single number points."""
    if vector.kind == "zero" or vector.first is None:
        return sp.S.Zero, sp.S.Zero
    first = symbol_of(vector.first)
    if vector.kind == "axis" or vector.second is None:
        return axis[0] * first, axis[1] * first
    second = symbol_of(vector.second)
    if vector.kind == "cartesian":
        return first, second
    return first * sp.cos(second), first * sp.sin(second)
