"""Law: no torque; the machine moves by its weight, its loads and its initial speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import sympy as sp

from ballpass.derive.drive.laws.law import TorqueLaw
from ballpass.derive.scene.schema import Table


@dataclass(frozen=True, slots=True, kw_only=True)
class NoTorque(TorqueLaw):
    """Zero."""

    name: ClassVar[str] = "none"

    @classmethod
    def read(cls, data: Table) -> Self:
        del data
        return cls()

    def torque(self, speed: sp.Expr) -> sp.Expr:
        del speed
        return sp.S.Zero

    def words(self) -> str:
        return "nothing"
