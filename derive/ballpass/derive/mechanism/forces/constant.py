"""Law: what the pathway names acts always."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import sympy as sp

from ballpass.derive.mechanism.forces.force import Action, Law, Pathway, Setting
from ballpass.derive.scene.records import Force
from ballpass.derive.scene.schema import Table


@dataclass(frozen=True, slots=True, kw_only=True)
class Constant(Law):
    """The factor 1."""

    factor: ClassVar[bool] = True

    @classmethod
    def read(cls, data: Table, name: str, pathway: type[Pathway]) -> Self:
        """No key."""
        return cls()

    def amount(self, force: Force, action: Action, setting: Setting) -> sp.Expr:
        """One."""
        return sp.S.One
