"""What an effect on a ball is: its name, its numbers in the scene file, what it takes from the deflection.

An effect is one object in one file of this folder; `EFFECTS` in ``__init__.py`` lists them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar

from ballpass.derive.scene.checker import Checker
from ballpass.derive.scene.records import BallEffect
from ballpass.derive.scene.schema import Table

if TYPE_CHECKING:
    import sympy as sp


class Effect(ABC):
    """An effect on the balls of a bearing; `name` is its table within the bearing's."""

    name: ClassVar[str]

    @abstractmethod
    def read(self, table: Table) -> BallEffect:
        """The effect out of its table; faults are noted."""

    def check(self, effect: BallEffect, checker: Checker) -> None:  # noqa: B027  an effect may take any number
        """Note faults of its numbers."""

    @abstractmethod
    def term(self, effect: BallEffect, angle: sp.Expr) -> sp.Expr:
        """What it takes from the deflection of the ball at `angle`, a function of `TIME` [m]."""

    @abstractmethod
    def describe(self, effect: BallEffect) -> str:
        """What it models, for people."""
