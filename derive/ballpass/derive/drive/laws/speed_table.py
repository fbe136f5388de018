"""Law: a torque from a table over the speed, linear between its rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import sympy as sp

from ballpass.derive.drive.laws.law import TorqueLaw
from ballpass.derive.drive.piecewise_linear import piecewise_linear
from ballpass.derive.scene.checker import Checker
from ballpass.derive.scene.quantity import SceneNumber
from ballpass.derive.scene.read_keys import column
from ballpass.derive.terms import Smoothness, symbol_of


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedTable(TorqueLaw):
    """Rows of `speed` [rad/s], increasing, and `amount` [N*m]; constant before the first and after the last."""

    name: ClassVar[str] = "table"
    smoothness: ClassVar[Smoothness] = Smoothness.KINKED

    speed: tuple[SceneNumber, ...] = column("rad/s", "Speed in row ROW of the drive's table", r"\omega_{d,ROW}")
    amount: tuple[SceneNumber, ...] = column(
        "N*m", "Torque in row ROW of the drive's table", "M_{d,ROW}", name="torque"
    )

    def torque(self, speed: sp.Expr) -> sp.Expr:
        return piecewise_linear(speed, [symbol_of(q) for q in self.speed], [symbol_of(q) for q in self.amount])

    def words(self) -> str:
        return f"a torque by a table of {len(self.speed)} speeds"

    def check(self, checker: Checker) -> None:
        """Columns of one length, of two rows or more; speeds increase."""
        if self.speed:
            path = self.speed[0].path.rpartition(".")[0].rpartition(".")[0]
            remedy = 'give every row a speed and a torque, or write law = "constant"'
            checker.rows(path, {"speed": self.speed, "torque": self.amount}, remedy)
