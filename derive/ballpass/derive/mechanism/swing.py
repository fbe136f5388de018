"""Angles of bodies that are continuous over any number of turns, as balls need them.

In: a linkage and one of its bodies.  Out: the angle as whole turns with the driver, a mean direction, and a swing about
both.

The pose gives cosine and sine of an angle.  In a turn of the driven body the body makes N whole turns, and swings by
less than half a turn about N theta + m; so the angle is N theta + m + atan2(sine, cosine of the rest), without a jump.
N and m follow from the ideal linkage, at `POINTS` angles of a turn; the result does not depend on m.  Where the linkage
locks within a turn N is zero, and m that of the angles around the start.  A driver that swings makes no turn, and N
theta is then part of the swing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import sympy as sp

from ballpass.derive.mechanism.linkage import Linkage
from ballpass.derive.mechanism.vectors import Pair, rotate
from ballpass.derive.terms import Definition, defined, subscript, symbol_of
from ballpass.derive.variables import Terms

#: Angles of the driver at which the ideal linkage is evaluated.
POINTS = 48

#: Most that a body may turn from one to the next: beyond it the sense of rotation is ambiguous [rad].
FARTHEST = 0.75 * math.pi


class Ideal(sp.Function):  # type: ignore[misc]
    """``Ideal(symbol, angle, *positions)``: a defined symbol at an angle of the driver, joints without play.

    `positions` are the coordinates that are zero then.
    """


class Average(sp.Function):  # type: ignore[misc]
    """``Average(angle, first, last, *positions)``: of a defined angle from one angle of the driver to another, joints
    without play, as far as the linkage can be assembled [rad]."""


class Turns(sp.Function):  # type: ignore[misc]
    """``Turns(cos, sin, angle, start, period, *positions)``: turns of a direction in a turn of an angle from its start
    on, whole ones in a `period` of so many turns; zero where the linkage locks in between, infinite where it turns by
    more than `FARTHEST` between neighbours."""


class Mean(sp.Function):  # type: ignore[misc]
    """``Mean(cos, sin, angle, start, period, *positions)``: mean angle over a period of a direction that makes no turn,
    followed from the start on as far as the linkage does not lock, rounded [rad]."""


#: Functions of the linkage without play: constants of a run.
OF_IDEAL_LINKAGE = (Ideal, Average, Turns, Mean)


def positions_of(function: sp.Function) -> tuple[sp.Basic, ...]:
    """The coordinates that are zero in a function of the ideal linkage."""
    return tuple(function.args[{Ideal: 2, Average: 3, Turns: 5, Mean: 5}[function.func] :])


@dataclass(frozen=True, slots=True, kw_only=True)
class Swing(Terms):
    """Angle of a body: ``turns * driver's angle + swing``.

    Attributes
    ----------
    turns : whole turns in a turn of the driver, a constant
    swing : rest of the angle, mean direction included [rad]
    at_start : the same in the ideal linkage at the driver's start angle [rad]
    rate : of the angle [rad/s]
    constants, definitions : of the symbols in these
    """

    turns: sp.Expr
    swing: sp.Expr = sp.S.Zero
    at_start: sp.Expr = sp.S.Zero
    rate: sp.Expr


#: A body that does not turn.
STILL = Swing(turns=sp.S.Zero, rate=sp.S.Zero)


def nearest(direction: Pair, known: sp.Expr) -> sp.Expr:
    """The angle of a direction, cosine and sine, within half a turn of a known one [rad]."""
    (cos, sin), ahead, across = direction, sp.cos(known), sp.sin(known)
    return known + sp.atan2(sin * ahead - cos * across, cos * ahead + sin * across)


def followed(linkage: Linkage, name: str, words: str, direction: Pair) -> tuple[Definition, Definition, sp.Expr]:
    """Turns of a direction in one of the driven body and mean of the rest, and its angle with these turns [rad]."""
    driven, start, mark = linkage.drive.driven[0], linkage.mechanism.driver.start_angle, subscript(name.split(".")[1])
    swept = driven, symbol_of(start), linkage.turns_of(driven), *linkage.positions
    text = f"Turns of {words} in a turn of the driven body"
    turns = defined(f"{name}.turns", Turns(*direction, *swept), "1", text, f"N_{{{mark}}}")
    known = turns.symbol * driven
    mean = Mean(*rotate(sp.cos(known), -sp.sin(known), direction), *swept)
    rest = defined(f"{name}.mean_angle", mean, "rad", f"Mean angle of {words} less these turns", f"m_{{{mark}}}")
    return turns, rest, nearest(direction, known + rest.symbol)


def swing_of(linkage: Linkage, body: str) -> Swing:
    """Angle of a body of a linkage, or of its frame."""
    drive, pose, mark = linkage.drive, linkage.pose(body), subscript(body)
    if sp.sympify(pose.cos).is_number:
        return STILL
    if pose.angle is not None and drive.swings is None:  # in proportion to the driver's
        return Swing(turns=sp.diff(pose.angle, drive.angle), rate=pose.rate)
    turned, mean, angle = followed(linkage, f"body.{body}", f"the {body}", (pose.cos, pose.sin))
    turns = turned.symbol if drive.swings is None else sp.S.Zero
    words = f"Angle of the {body} less its whole turns with the driver"
    swing = defined(f"body.{body}.swing", angle - turns * drive.angle, "rad", words, rf"\sigma_{{{mark}}}")
    first = Ideal(swing.symbol, drive.first_angle, *linkage.positions)
    words = f"Swing of the {body} at the start, ideal"
    at_start = defined(f"body.{body}.swing_at_start", first, "rad", words, f"s^0_{{{mark}}}")
    return Swing(
        turns=turns,
        swing=swing.symbol,
        at_start=at_start.symbol,
        rate=pose.rate,
        constants=(turned, mean, at_start),
        definitions=(swing,),
    )
