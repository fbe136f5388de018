"""What effects take from a ball's deflection: functions of the ball's angle and of time, with exact rates.

In: an expression over angles of ball j as functions of time.  Out: `OwnTerms`, over the direction of the ball.

Sines and cosines of multiples of the ball's angle become products of its direction, (cos + i sin)^n by repeated
squaring: no ball needs a sine of its own, and a compiler makes lanes of the balls.  Angles in other axes, as those of
the inner ring, have directions that follow from the ball's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp

from ballpass.derive.terms import TIME, Definition, Names


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnTerms:
    """Taken from the deflection [m], its rate [m/s] and second time derivative [m/s^2]; `definitions` name them."""

    deflection: sp.Symbol
    rate: sp.Symbol
    acceleration: sp.Symbol
    definitions: tuple[Definition, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class AngleAxes:
    """Axes in which a ball's angle is measured.

    Attributes
    ----------
    angle : of ball j in them, a function of `TIME` [rad]
    turned : how far they are turned, linear in `TIME`; zero where they stand still [rad]
    name, words : of the axes, of their symbols and for people; empty where they stand still
    """

    angle: sp.Expr
    turned: sp.Expr = sp.S.Zero
    name: str = ""
    words: str = ""


def own_terms(
    taken: sp.Expr, several: Sequence[AngleAxes], cos: sp.Symbol, sin: sp.Symbol, speed: sp.Symbol, names: Names
) -> OwnTerms:
    """Terms of a ball with angles in several axes; its rate in those that stand still is `speed` [rad/s], constant."""
    steps = [taken]
    for _ in range(2):
        steps.append(sp.diff(steps[-1], TIME))
        for axes in several:
            rate = speed - sp.diff(axes.turned, TIME)
            steps[-1] = steps[-1].subs(sp.diff(axes.angle, TIME), rate).doit()
    used = [_Multiples(axes, cos, sin, names) for axes in several]
    for multiples in used:
        steps = [_over_direction(e, multiples) for e in steps]
    symbols = [names.variable(f"ball.own_{n}") for n in ("deflection", "rate", "acceleration")]
    reduction = "reduction of the deflection of ball j, as by the waviness of a raceway"
    words = (reduction.capitalize(), f"Rate of the {reduction}", f"Second time derivative of the {reduction}")
    named = [
        names.define(symbol, expression, unit, text, latex)
        for symbol, expression, unit, text, latex in zip(
            symbols, steps, ("m", "m/s", "m/s^2"), words, ("e_j", r"\dot e_j", r"\ddot e_j"), strict=True
        )
    ]
    return OwnTerms(
        deflection=symbols[0],
        rate=symbols[1],
        acceleration=symbols[2],
        definitions=(*(d for multiples in used for d in multiples.definitions), *named),
    )


class _Multiples:
    """Cosines and sines of multiples of a ball's angle, defined by each other."""

    def __init__(self, axes: AngleAxes, cos: sp.Symbol, sin: sp.Symbol, names: Names) -> None:
        self.axes, self._direction, self._names = axes, (cos, sin), names
        self._known: dict[int, tuple[sp.Expr, sp.Expr]] = {0: (sp.S.One, sp.S.Zero)}
        self.definitions: list[Definition] = []

    def __call__(self, n: int) -> tuple[sp.Expr, sp.Expr]:
        if n < 0:
            c, s = self(-n)
            return c, -s
        if n not in self._known:
            self._known[n] = self._first() if n == 1 else self._defined(n, self._product(n // 2, n - n // 2))
        return self._known[n]

    def _first(self) -> tuple[sp.Expr, sp.Expr]:
        cos, sin = self._direction
        if self.axes.turned == 0:
            return cos, sin
        c, s = sp.cos(self.axes.turned), sp.sin(self.axes.turned)
        return self._defined(1, (cos * c + sin * s, sin * c - cos * s))

    def _product(self, m: int, n: int) -> tuple[sp.Expr, sp.Expr]:
        (a, b), (c, d) = self(m), self(n)
        return a * c - b * d, b * c + a * d

    def _defined(self, n: int, values: tuple[sp.Expr, sp.Expr]) -> tuple[sp.Expr, sp.Expr]:
        of, label = (f"{self.axes.name}_", rf"_{{j,{self.axes.name[0]}}}") if self.axes.name else ("", "_j")
        symbols = tuple(self._names.variable(f"ball.{f}_{of}{n}") for f in ("cos", "sin"))
        self.definitions += [
            self._names.define(
                symbol,
                value,
                "1",
                f"{word} of {n} times the angle of ball j{self.axes.words}",
                rf"\{f} {n}\theta{label}",
            )
            for symbol, value, word, f in zip(symbols, values, ("Cosine", "Sine"), ("cos", "sin"), strict=True)
        ]
        return symbols[0], symbols[1]


def _over_direction(expression: sp.Expr, multiples: _Multiples) -> sp.Expr:
    """The expression with every function of the angle written with its multiples.

    Raises
    ------
    TypeError
        The angle stands elsewhere than in sines and cosines of whole multiples of it.
    """
    replaced, angle = {}, multiples.axes.angle
    for call in sp.ordered(expression.atoms(sp.sin, sp.cos)):
        argument = sp.expand(call.args[0])
        n = argument.coeff(angle)
        rest = argument - n * angle
        if n == 0:
            continue
        if not n.is_Integer or rest.has(angle):
            raise TypeError(f"{call}: whole multiples of the ball's angle are expected")
        c, s = multiples(int(n))
        replaced[call] = (
            c * sp.cos(rest) - s * sp.sin(rest) if isinstance(call, sp.cos) else s * sp.cos(rest) + c * sp.sin(rest)
        )
    result = expression.xreplace(replaced)
    if result.has(angle):
        raise TypeError(f"{expression}: the ball's angle stands outside sines and cosines")
    return result
