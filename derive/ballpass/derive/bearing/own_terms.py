"""What effects take from a ball's deflection: functions of the ball's angle and of time, with exact rates.

In: an expression over angles of ball j as functions of time.  Where rings do not turn evenly, all these angles grow in
proportion to that of the inner ring relative to the outer one.  Out: `OwnTerms`, over the direction of the ball.

Sines and cosines of multiples of the ball's angle become products of its direction, (cos + i sin)^n by repeated
squaring: no ball needs a sine of its own, and a compiler makes lanes of the balls.  Angles in other axes, as those of
the inner ring, have directions that follow from the ball's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from ballpass.derive.terms import TIME, Definition, Names


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnTerms:
    """Taken from the deflection [m], and its rate [m/s]; `definitions` name them and what they are made of.

    Where the rings turn evenly `acceleration` is the second time derivative [m/s^2]; else `slope` is that over the
    angle of the inner ring relative to the outer one [m/rad], which the rate is a multiple of.
    """

    deflection: sp.Symbol
    rate: sp.Symbol
    acceleration: sp.Symbol | None
    slope: sp.Symbol | None
    definitions: tuple[Definition, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class AngleAxes:
    """Axes in which a ball's angle is measured.

    Attributes
    ----------
    angle : of ball j in them, a function of `TIME` [rad]
    rate : its constant derivative by time, or by the angle of the inner ring relative to the outer one
    turned : how far they are turned [rad]; zero where they stand still
    name, words : of the axes, of their symbols and for people; not used where they stand still
    """

    angle: sp.Expr
    rate: sp.Expr
    turned: sp.Expr
    name: str
    words: str


def own_terms(
    taken: sp.Expr,
    several: Sequence[AngleAxes],
    further: Mapping[sp.Expr, tuple[sp.Expr, sp.Expr]],
    direction: tuple[sp.Symbol, sp.Symbol],
    names: Names,
    ring_rate: sp.Symbol | None,
) -> OwnTerms:
    """Terms of a ball with angles in several axes.

    Parameters
    ----------
    further : of other functions of `TIME`: what they are, and their rates, as of `AngleAxes`
    ring_rate : of the inner ring relative to the outer one [rad/s]; None where rings turn evenly
    """
    angles = {axes.angle: axes.rate for axes in several} | {one: rate for one, (_, rate) in further.items()}
    steps = [taken]
    for _ in range(2 if ring_rate is None else 1):
        steps.append(sp.diff(steps[-1], TIME))
        for angle, rate in angles.items():
            steps[-1] = steps[-1].subs(sp.diff(angle, TIME), rate).doit()
    steps = [e.subs({one: value for one, (value, _) in further.items()}) for e in steps]
    used = [_Multiples(axes, *direction, names) for axes in several]
    for multiples in used:
        steps = [_over_direction(e, multiples) for e in steps]
    reduction = "reduction of the deflection of ball j, as by the waviness of a raceway"
    named: list[Definition] = []

    def define(name: str, expression: sp.Expr, unit: str, words: str, latex: str) -> sp.Symbol:
        named.append(names.define(names.variable(f"ball.own_{name}"), expression, unit, words, latex))
        return named[-1].symbol

    deflection, slope, acceleration = define("deflection", steps[0], "m", reduction.capitalize(), "e_j"), None, None
    if ring_rate is None:
        rate = define("rate", steps[1], "m/s", f"Rate of the {reduction}", r"\dot e_j")
        words = f"Second time derivative of the {reduction}"
        acceleration = define("acceleration", steps[2], "m/s^2", words, r"\ddot e_j")
    else:
        words = f"Slope of the {reduction}, over the angle of the inner ring relative to the outer one"
        slope = define("slope", steps[1], "m/rad", words, "e'_j")
        rate = define("rate", slope * ring_rate, "m/s", f"Rate of the {reduction}", r"\dot e_j")
    return OwnTerms(
        deflection=deflection,
        rate=rate,
        acceleration=acceleration,
        slope=slope,
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
        name, words = (self.axes.name, self.axes.words) if self.axes.turned != 0 else ("", "")
        of, label = (f"{name}_", rf"_{{j,{name[0]}}}") if name else ("", "_j")
        symbols = tuple(self._names.variable(f"ball.{f}_{of}{n}") for f in ("cos", "sin"))
        self.definitions += [
            self._names.define(
                symbol,
                value,
                "1",
                f"{word} of {n} times the angle of ball j{words}",
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
