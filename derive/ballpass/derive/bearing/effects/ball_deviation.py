"""Balls whose diameter differs from that of the others: a thicker one is pressed more by as much."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

import sympy as sp

from ballpass.derive.bearing.effects.effect import Effect, GenericBall
from ballpass.derive.scene.bearing_records import BallEffect, Bearing
from ballpass.derive.scene.quantity import SceneNumber, UsualRange
from ballpass.derive.scene.read_keys import number
from ballpass.derive.scene.table import Table
from ballpass.derive.terms import Names, symbol_of

DEVIATION = number(
    "m",
    "Deviation of the diameter of ball BALL",
    r"\Delta D_{w,BALL}",
    "0.5 um",
    usual=UsualRange(
        least=-0.001,
        most=0.001,
        of="ball_diameter",
        hint="Balls of one bearing differ by tenths of a micrometre: check the unit.",
    ),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Deviation:
    """How much thicker a ball is [m], of its number."""

    ball: int
    size: SceneNumber


class BallDeviation(Effect):
    """Deviation of the diameter of single balls."""

    name = "ball_deviation"
    words = "balls of different diameters"
    tables = MappingProxyType({(): {"#": DEVIATION.filled({"BALL": "<ball>"})}})

    def read(self, table: Table, balls: int) -> BallEffect:
        with table:
            names = [str(number) for number in range(1, balls + 1)]
            table.know(*names)
            deviations = [
                Deviation(ball=int(name), size=DEVIATION.filled({"BALL": name}).read(table, name))
                for name in names
                if name in table.data
            ]
        return BallEffect(kind=self.name, parts=tuple(deviations))

    def term(self, effect: BallEffect, bearing: Bearing, names: Names, ball: GenericBall) -> sp.Expr:
        return -sum((ball.only(one.ball, symbol_of(one.size)) for one in effect.parts), start=sp.S.Zero)

    def describe(self, effect: BallEffect) -> str:
        return f"diameters of their own of the balls {', '.join(str(one.ball) for one in effect.parts)}"
