"""Law: a torque that does not change."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import sympy as sp

from ballpass.derive.drive.laws.law import TorqueLaw
from ballpass.derive.scene.quantity import SceneNumber
from ballpass.derive.scene.read_keys import quantity
from ballpass.derive.terms import symbol_of


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstantTorque(TorqueLaw):
    """`amount` [N*m], counter-clockwise."""

    name: ClassVar[str] = "constant"

    amount: SceneNumber = quantity("N*m", "Torque of the drive, counter-clockwise", "M_d", "5 N*m", name="torque")

    def torque(self, speed: sp.Expr) -> sp.Expr:
        del speed
        return symbol_of(self.amount)

    def words(self) -> str:
        return "a constant torque"
