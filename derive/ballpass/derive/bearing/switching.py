"""Where the laws of a ball are not smooth: switching functions, and the law continued from one side.

In: the ball's elastic and damping force over deflection and rate.  Out: `Switching`: one function for each place at
which a force, or its first or second derivative, jumps or is unbounded, and the force as a function of sides.

Every case distinction of the laws is examined.  It has two branches; what counts is with which power of the distance
from the place where they meet their difference grows, along the quantity that decides (deflection or rate).  Smoothed
laws also distinguish cases, but their branches meet smoothly, and those are no kinks.

A branch that can be continued beyond its place (the damping force c_b times rate, both ways) is *held*: its condition
z > z0 becomes z - z0 > b with a border b for each ball, minus infinity to hold it true, infinity to hold it false, 0 to
leave it as it is.  Hertz's law in contact cannot, for it has a branch point at zero: there b is 0 at least, and the law
keeps its condition.  Out of contact it can, for it is zero.

Balls of an even number stand in opposite pairs, with opposite rates and directions.  Where a force depends on the rate
alone, the pair pushes with F(z) - F(-z), and what F(z) has in common with F(-z) drops out: the damping force
c_b max(z, 0) of each ball has a kink, their sum c_b z has none, and there is nothing to locate.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import mpmath
import sympy as sp
from sympy.core.relational import Relational

from ballpass.derive.terms import ExpressionError, Smoothness

#: A law is smooth enough where this derivative is continuous: its branches differ by a higher power of the distance.
KINK_ORDER = 2

#: Powers are multiples of one over this: of halves (balls) and ninths (rollers).
EXPONENTS = 18.0

#: Values of the quantity that does not decide, in units of what the other numbers are: far and near on both sides.
_ELSEWHERE = (sp.Integer(-30), sp.Rational(-1, 7), sp.Rational(2, 11), sp.Integer(40))

#: Distances from the meeting place, as decimals, and digits to compute with; what is below the last number is rounding.
_DISTANCES, _DIGITS, _ZERO = ("1e-12", "1e-11"), 100, 1e-80


@dataclass(frozen=True, slots=True, kw_only=True)
class Switch:
    """A place at which a law switches.

    Attributes
    ----------
    function : positive on one side, negative on the other: deflection or rate less a constant of the run
    of_rate : whether it is a rate [m/s]; else a deflection [m]
    ends_above, ends_below : whether a law ends at a branch point there: the one that holds where the function is
        positive, or the one where it is negative, cannot be continued
    jumps : whether a force jumps there
    border : symbol that the function is compared with in the held law
    """

    function: sp.Expr
    of_rate: bool
    ends_above: bool
    ends_below: bool
    jumps: bool
    border: sp.Symbol


@dataclass(frozen=True, slots=True, kw_only=True)
class Switching:
    """The switches of a ball's force, and the force with held sides."""

    switches: tuple[Switch, ...]
    force: sp.Expr


@dataclass(frozen=True, slots=True, kw_only=True)
class _SwitchPlace:
    at: tuple[bool, sp.Expr]  # whether the rate decides, else the deflection; the value at which it does
    order: float  # power of the distance with which the branches differ
    above: bool  # whether the condition holds above the place; else below it
    ends_above: bool
    ends_below: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class LawSmoothness:
    """How often a force may be differentiated: where the deflection decides, where the rate does, and anywhere."""

    in_deflection: Smoothness
    in_rate: Smoothness
    anywhere: Smoothness


def smoothness_of(force: sp.Expr, deflection: sp.Symbol, rate: sp.Symbol) -> LawSmoothness:
    """How often a force may be differentiated, found at each of its case distinctions."""
    orders = {False: math.inf, True: math.inf}
    for condition in sp.ordered(force.atoms(Relational)):
        place = _look(force, condition, deflection, rate, pairs=False)
        orders[place.at[0]] = min(orders[place.at[0]], place.order)
    return LawSmoothness(
        in_deflection=_in_words(orders[False]),
        in_rate=_in_words(orders[True]),
        anywhere=_in_words(min(orders.values())),
    )


def _in_words(order: float) -> Smoothness:
    if order > KINK_ORDER:
        return Smoothness.TWICE_SMOOTH
    if order > 1.0:
        return Smoothness.SMOOTH
    return Smoothness.KINKED if order > 0.0 else Smoothness.DISCONTINUOUS


def find_switching(parts: Sequence[sp.Expr], deflection: sp.Symbol, rate: sp.Symbol, *, pairs: bool) -> Switching:
    """Switches of the sum of `parts`, each a force over `deflection` and `rate`.

    Parameters
    ----------
    pairs : whether the balls stand opposite each other

    Raises
    ------
    ExpressionError
        A condition is not of the form deflection or rate against a constant of the run.
    """
    found: dict[tuple[bool, sp.Expr], list[_SwitchPlace]] = {}
    kinks: list[dict[Relational, _SwitchPlace]] = []
    for part in parts:
        places = {c: _look(part, c, deflection, rate, pairs=pairs) for c in sp.ordered(part.atoms(Relational))}
        kinks.append({c: place for c, place in places.items() if place.order <= KINK_ORDER})
        for place in kinks[-1].values():
            found.setdefault(place.at, []).append(place)
    order = sorted(found, key=lambda key: (key[0], sp.default_sort_key(key[1])))
    names = {key: sp.Symbol(f"ball.border_{k}", real=True) for k, key in enumerate(order)}
    switches = tuple(
        Switch(
            function=(rate if key[0] else deflection) - key[1],
            of_rate=key[0],
            ends_above=any(place.ends_above for place in found[key]),
            ends_below=any(place.ends_below for place in found[key]),
            jumps=any(place.order == 0 for place in found[key]),
            border=names[key],
        )
        for key in order
    )
    functions = dict(zip(order, (switch.function for switch in switches), strict=True))
    force = sum(
        (
            part.xreplace({c: _held(functions[place.at], names[place.at], place) for c, place in of_part.items()})
            for part, of_part in zip(parts, kinks, strict=True)
        ),
        start=sp.S.Zero,
    )
    return Switching(switches=switches, force=force)


def _held(function: sp.Expr, border: sp.Symbol, place: _SwitchPlace) -> sp.logic.boolalg.Boolean:
    """The condition with its sides held, as far as the laws on them can be continued.

    One that holds below its place is the opposite of the one that holds above it.
    """
    held, itself = sp.StrictGreaterThan(function, border), sp.StrictGreaterThan(function, 0)
    if place.ends_above:
        held = sp.And(held, itself)
    if place.ends_below:
        held = sp.Or(held, itself)
    return held if place.above else sp.Not(held)


def _border(condition: Relational, deflection: sp.Symbol, rate: sp.Symbol) -> tuple[bool, sp.Expr, bool]:
    """Whether a condition is one of the rate, the value at which it changes, and whether it holds above that value."""
    larger = sp.expand(condition.gts - condition.lts)
    for symbol, other in ((deflection, rate), (rate, deflection)):
        for start, above in ((symbol - larger, True), (symbol + larger, False)):
            if symbol in larger.free_symbols and not start.free_symbols & {symbol, other}:
                return symbol == rate, start, above
    raise ExpressionError(
        f"the condition {condition} is expected to compare deflection or rate with a constant of the run: "
        "steps end where it changes."
    )


def _look(part: sp.Expr, condition: Relational, deflection: sp.Symbol, rate: sp.Symbol, *, pairs: bool) -> _SwitchPlace:
    """How the two branches of a condition meet, tried with exact numbers little above one for everything else.

    A symbolic exponent is then one that is just above its least value, where a law is the least smooth.

    Parameters
    ----------
    pairs : whether an opposite ball has the same force with the opposite rate
    """
    of_rate, start, above = _border(condition, deflection, rate)
    decides, other = (rate, deflection) if of_rate else (deflection, rate)
    rest = sorted((part.free_symbols | start.free_symbols) - {decides, other}, key=sp.default_sort_key)
    numbers = {symbol: 1 + sp.Rational(sp.prime(k + 10), 370) for k, symbol in enumerate(rest)}
    meets = start.xreplace(numbers)
    least = math.inf
    ends_above = ends_below = False
    for elsewhere in _ELSEWHERE if other in part.free_symbols else _ELSEWHERE[:1]:
        branches = []
        for side in (sp.true, sp.false) if above else (sp.false, sp.true):  # above the place, and below
            piece = part.xreplace({condition: side}).xreplace(numbers).xreplace({other: elsewhere})
            # the other conditions are what they are there
            branches.append(piece.xreplace({c: c.xreplace({decides: meets}) for c in piece.atoms(Relational)}))
        difference = sp.sympify(branches[0] - branches[1])
        if pairs and of_rate and start == 0 and deflection not in part.free_symbols:
            difference += difference.xreplace({decides: -decides})
        least = min(least, _order(difference, decides, meets))
        ends_above = ends_above or not _is_real(branches[0], decides, meets)
        ends_below = ends_below or not _is_real(branches[1], decides, meets)
    at = of_rate, start
    return _SwitchPlace(at=at, order=least, above=above, ends_above=ends_above, ends_below=ends_below)


def _beside(expression: sp.Expr, decides: sp.Symbol, meets: sp.Expr) -> tuple[list[mpmath.mpc], list[mpmath.mpc]]:
    """Values at the two small distances from the meeting place, above it and below."""
    value = sp.lambdify(decides, expression, "mpmath")
    place = mpmath.mpf(meets.p) / meets.q
    distances = [mpmath.mpf(distance) for distance in _DISTANCES]
    return (
        [mpmath.mpmathify(value(place + distance)) for distance in distances],
        [mpmath.mpmathify(value(place - distance)) for distance in distances],
    )


def _is_real(branch: sp.Expr, decides: sp.Symbol, meets: sp.Expr) -> bool:
    """Whether a branch has real values on both sides of the meeting place."""
    with mpmath.workdps(_DIGITS):
        return all(value.imag == 0 for side in _beside(branch, decides, meets) for value in side)


def _order(difference: sp.Expr, decides: sp.Symbol, meets: sp.Expr) -> float:
    """Power of the distance from the meeting place with which a difference grows.

    Values at two small distances tell, in so many digits that nothing is rounded away.
    """
    order = math.inf
    with mpmath.workdps(_DIGITS):
        for near, far in _beside(difference, decides, meets):
            if abs(near) > _ZERO:
                power = mpmath.log(abs(far) / abs(near)) / mpmath.log(10)
                order = min(order, round(EXPONENTS * float(power)) / EXPONENTS)
    return order
