"""Law: no torque; the machine moves by its weight, its loads and its initial speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import sympy as sp

from ballpass.derive.drive.laws.law import TorqueLaw


@dataclass(frozen=True, slots=True, kw_only=True)
class NoTorque(TorqueLaw):
    """Zero."""

    name: ClassVar[str] = "none"

    def torque(self, speed: sp.Expr) -> sp.Expr:
        del speed
        return sp.S.Zero

    def words(self) -> str:
        return "nothing"
