"""What effects take from a ball's deflection: functions of the ball's angle and of time, with exact rates.

In: an expression over the angle of ball j as a function of time.  Out: `OwnTerms`, over the direction of the ball.

Sines and cosines of multiples of the ball's angle become products of its direction, (cos + i sin)^n by repeated
squaring: no ball needs a sine of its own, and a compiler makes lanes of the balls.
"""

from __future__ import annotations

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


def own_terms(
    taken: sp.Expr, angle: sp.Expr, cos: sp.Symbol, sin: sp.Symbol, speed: sp.Symbol, names: Names
) -> OwnTerms:
    """Terms of a ball at `angle`, a function of `TIME`, whose rate is `speed` [rad/s] and constant."""
    steps = [taken]
    for _ in range(2):
        steps.append(sp.diff(steps[-1], TIME).subs(sp.diff(angle, TIME), speed).doit())
    multiples = _Multiples(cos, sin, names)
    expressions = [_over_direction(e, angle, multiples) for e in steps]
    symbols = [names.variable(f"ball.own_{n}") for n in ("deflection", "rate", "acceleration")]
    reduction = "reduction of the deflection of ball j, as by the waviness of a raceway"
    words = (reduction.capitalize(), f"Rate of the {reduction}", f"Second time derivative of the {reduction}")
    named = [
        names.define(symbol, expression, unit, text, latex)
        for symbol, expression, unit, text, latex in zip(
            symbols, expressions, ("m", "m/s", "m/s^2"), words, ("e_j", r"\dot e_j", r"\ddot e_j"), strict=True
        )
    ]
    return OwnTerms(
        deflection=symbols[0],
        rate=symbols[1],
        acceleration=symbols[2],
        definitions=(*multiples.definitions, *named),
    )


class _Multiples:
    """Cosines and sines of multiples of a ball's angle, defined by each other."""

    def __init__(self, cos: sp.Symbol, sin: sp.Symbol, names: Names) -> None:
        self._known: dict[int, tuple[sp.Expr, sp.Expr]] = {0: (sp.S.One, sp.S.Zero), 1: (cos, sin)}
        self._names = names
        self.definitions: list[Definition] = []

    def __call__(self, n: int) -> tuple[sp.Expr, sp.Expr]:
        if n < 0:
            c, s = self(-n)
            return c, -s
        if n not in self._known:
            (a, b), (c, d) = self(n // 2), self(n - n // 2)
            values = (a * c - b * d, b * c + a * d)
            symbols = tuple(self._names.variable(f"ball.{f}_{n}") for f in ("cos", "sin"))
            self.definitions += [
                self._names.define(symbol, value, "1", f"{word} of {n} times the angle of ball j", rf"\{f} {n}\theta_j")
                for symbol, value, word, f in zip(symbols, values, ("Cosine", "Sine"), ("cos", "sin"), strict=True)
            ]
            self._known[n] = symbols[0], symbols[1]
        return self._known[n]


def _over_direction(expression: sp.Expr, angle: sp.Expr, multiples: _Multiples) -> sp.Expr:
    """The expression with every function of the angle written with its multiples.

    Raises
    ------
    TypeError
        The angle stands elsewhere than in sines and cosines of whole multiples of it.
    """
    replaced = {}
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
