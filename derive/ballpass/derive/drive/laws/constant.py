"""Law: a torque that does not change."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import sympy as sp

from ballpass.derive.drive.laws.law import TorqueLaw
from ballpass.derive.scene.quantity import Quantity
from ballpass.derive.scene.schema import Table
from ballpass.derive.terms import symbol_of


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstantTorque(TorqueLaw):
    """`amount` [N*m], counter-clockwise."""

    name: ClassVar[str] = "constant"

    amount: Quantity

    @classmethod
    def read(cls, data: Table) -> Self:
        words = "Torque of the drive, counter-clockwise"
        return cls(amount=data.quantity("torque", "N*m", words, "M_d", example="5 N*m"))

    def torque(self, speed: sp.Expr) -> sp.Expr:
        del speed
        return symbol_of(self.amount)

    def words(self) -> str:
        return "a constant torque"
