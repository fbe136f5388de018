"""What an effect on a ball is: its name, its numbers in the scene file, what it adds to the deflection.

An effect is one object in one file of this folder; `EFFECTS` in ``__init__.py`` lists them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import sympy as sp

from ballpass.derive.drive import OverAngle
from ballpass.derive.scene.bearing_records import BallEffect, Bearing
from ballpass.derive.scene.checker import Checker
from ballpass.derive.scene.keys import Key
from ballpass.derive.scene.table import Table
from ballpass.derive.terms import Definition, Names
from ballpass.runtime.contract.manifest import TurningInfo


@dataclass(frozen=True, slots=True, kw_only=True)
class GenericBall:
    """Where the generic ball is and how it is turned, functions of `TIME` [rad].

    Attributes
    ----------
    balls : their number
    on_outer, on_inner : its angle as the rings see it, which stood along x at the start
    from_first : its angle from ball 1
    spin : angle of its own material that meets the outer raceway, counter-clockwise from what did so at the start; the
        inner raceway meets the opposite place.  None where no effect asks for it
    """

    balls: int
    on_outer: sp.Expr
    on_inner: sp.Expr
    from_first: sp.Expr
    spin: sp.Expr | None

    def only(self, number: int, value: sp.Expr) -> sp.Expr:
        """A value for one ball, counted from 1, and zero for the others."""
        near = sp.cos(self.from_first - 2 * sp.pi * sp.Rational(number - 1, self.balls))
        return sp.Piecewise((value, near > sp.cos(sp.pi / self.balls)), (sp.S.Zero, True))


@dataclass(frozen=True, slots=True, kw_only=True)
class Passing:
    """How ball 1 passes over the rings, and its own material over the outer raceway: angle [rad] and its rate [rad/s].

    `turnings` are these angles by name, "outer", "inner" and "spin", where they are known before a run; None where they
    are functions of the state.
    """

    outer: tuple[sp.Expr, sp.Expr]
    inner: tuple[sp.Expr, sp.Expr]
    spin: tuple[sp.Expr, sp.Expr] | None = None
    turnings: Mapping[str, TurningInfo] | None


class Effect(ABC):
    """An effect on the balls of a bearing; `name` is its table within the bearing's.

    `tables` are the keys in it and in those inside, by path: "*" stands for a name, "#" for a number.
    """

    name: ClassVar[str]
    tables: ClassVar[Mapping[tuple[str, ...], Mapping[str, Key]]]
    #: For people: what a scene without it leaves out.
    words: ClassVar[str]

    @abstractmethod
    def read(self, table: Table, balls: int) -> BallEffect:
        """The effect out of its table; faults are noted."""

    def check(self, effect: BallEffect, checker: Checker, bearing: Bearing) -> None:  # noqa: B027  an effect may take any number
        """Note faults of its numbers, beyond their bounds."""

    def relations(self, effect: BallEffect, bearing: Bearing) -> list[tuple[str, float, str]]:
        """What its numbers must be to others: the first above so many times the second."""
        return []

    def spins(self, effect: BallEffect) -> bool:
        """Whether it depends on how the balls are turned."""
        return False

    def edges(self, effect: BallEffect, bearing: Bearing, names: Names, passes: Passing) -> OverAngle:
        """Where it begins and ends for a ball: inputs, and definitions and switches where the motion decides."""
        return OverAngle(value=sp.S.Zero)

    def constants(self, effect: BallEffect, bearing: Bearing, names: Names) -> tuple[Definition, ...]:
        """Derived constants of its own."""
        return ()

    @abstractmethod
    def term(self, effect: BallEffect, bearing: Bearing, names: Names, ball: GenericBall) -> sp.Expr:
        """What it takes from the deflection of the generic ball [m]."""

    @abstractmethod
    def describe(self, effect: BallEffect) -> str:
        """What it models, for people."""
