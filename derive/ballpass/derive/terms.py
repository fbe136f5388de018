"""Records that all derivations share: symbols of parameters, named definitions, smoothness.

A derivation is an ordered tuple of `Definition`: symbol := expression, each using parameters, inputs, states and
earlier
symbols only.  Expressions stay as small as on paper, and the visitor of `lower.py` shares them.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from enum import Enum

import sympy as sp

from ballpass.derive.scene.bearing_records import Bearing
from ballpass.derive.scene.quantity import SceneNumber, Vector
from ballpass.derive.scene.table import listing, upright
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.ratings.elements import element_words

#: Time since the reference time of the phases [s] (see `System.inputs`).
TIME = sp.Symbol("t", real=True)


class ExpressionError(RequestError, TypeError):
    """An expression, as of a law, has a function or a condition that is not computed, or whose kink is not located."""


#: Functions with kinks, which are continuous, and with jumps; no step ends there.
_KINKED = (sp.Abs, sp.Max, sp.Min)
_JUMPING = (sp.sign, sp.Heaviside, sp.floor, sp.ceiling)


class Smoothness(Enum):
    """How often a law may be differentiated along its arguments."""

    TWICE_SMOOTH = "twice smooth"  # twice continuously differentiable: second derivatives exist
    SMOOTH = "smooth"  # continuously differentiable
    KINKED = "kinked"  # continuous; the derivative jumps or is unbounded at one point
    DISCONTINUOUS = "discontinuous"  # the value jumps


def refuse_kinks(
    what: str, law: sp.Basic, allowed: str, *, located: Collection[sp.Basic] = (), kinked: bool = False
) -> None:
    """Refuse kinks and jumps of a law that no step ends on.

    Parameters
    ----------
    what, allowed : of the message
    located : what a condition must have, so that steps end where it changes
    kinked : whether the law says that it has kinks, so that continuous functions may have them

    Raises
    ------
    ExpressionError
        There is such a function, or a case distinction without any of `located`.
    """
    found = [function.__name__ for function in (*_KINKED * (not kinked), *_JUMPING) if law.has(function)]
    cases = [case for piecewise in law.atoms(sp.Piecewise) for _, case in piecewise.args]
    found += ["Piecewise"] * any(case.free_symbols and not case.has(*located) for case in cases)
    if found:
        raise ExpressionError(f"{what} has {listing(found)}, whose kinks are not located. Allowed: {allowed}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Definition:
    """``symbol := expression``, with unit, description and the LaTeX symbol."""

    symbol: sp.Symbol
    expression: sp.Expr
    unit: str
    description: str
    latex: str


def defined(name: str, expression: sp.Expr, unit: str, description: str, latex: str) -> Definition:
    """``name := expression``."""
    symbol = sp.Symbol(name, real=True)
    return Definition(symbol=symbol, expression=expression, unit=unit, description=description, latex=latex)


@dataclass(frozen=True, slots=True, kw_only=True)
class Names:
    """Names of a part's symbols: variables begin with `prefix`, constants and parameters with `path`.

    The only bearing has the prefix ``""`` and the path ``bearing``; others ``<name>.`` and ``bearings.<name>``.
    """

    prefix: str
    path: str
    element: str = "ball"

    def variable(self, name: str) -> sp.Symbol:
        """Symbol of a variable."""
        return sp.Symbol(f"{self.prefix}{name}", real=True)

    def constant(self, name: str) -> sp.Symbol:
        """Symbol of a derived constant."""
        return sp.Symbol(f"{self.path}.{name}", real=True)

    def latex(self, text: str) -> str:
        """A description, marked with the part's name where there are several."""
        return text if not self.prefix else rf"{{{text}}}^{{(\mathrm{{{self.prefix[:-1]}}})}}"

    def words(self, text: str) -> str:
        """A description of a bearing, with what its rolling elements are called."""
        return element_words(text, [self.element])

    def define(self, symbol: sp.Symbol, expression: sp.Expr, unit: str, description: str, latex: str) -> Definition:
        """``symbol := expression``."""
        words, latex = self.words(description), self.latex(latex)
        return Definition(symbol=symbol, expression=expression, unit=unit, description=words, latex=latex)


def names_of(bearing: Bearing) -> Names:
    """Names of a bearing's symbols."""
    return Names(prefix=bearing.prefix, path=bearing.path, element=bearing.element)


#: A scene name as an upright LaTeX subscript.
subscript = upright


def symbol_of(quantity: SceneNumber) -> sp.Symbol:
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
