"""Law: the force or torque of the pathway acts always."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import sympy as sp

from ballpass.derive.mechanism.forces.force import Action, Law, Setting
from ballpass.derive.scene.mechanism_records import Force


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstantForce(Law):
    """The factor 1."""

    factor: ClassVar[bool] = True

    def amount(self, force: Force, action: Action, setting: Setting) -> sp.Expr:
        """One."""
        return sp.S.One
