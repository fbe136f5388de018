"""No damping in the contacts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from ballpass.derive.bearing.laws.law import DampingLaw
from ballpass.derive.scene.quantity import Quantity
from ballpass.derive.scene.schema import Table
from ballpass.derive.scene.units import show

if TYPE_CHECKING:
    import sympy as sp

    from ballpass.derive.bearing.laws.contact import Contact, Rest


class NoDamping(DampingLaw):
    """Has neither a number nor a force."""

    name = "none"
    description = "no damping in the contacts"

    def read(self, table: Table) -> tuple[Quantity, ...]:
        for key in ("coefficient", "ratio"):
            if table.has(key):
                table.fault(
                    key,
                    'the law "none" has no coefficient',
                    given=show(table.data[key]),
                    remedy="delete the key, or name another law",
                )
        return ()

    def coefficient(self, numbers: Mapping[str, sp.Expr], stiffness: sp.Expr) -> sp.Expr:
        return 0 * stiffness

    def force(self, delta: sp.Expr, rate: sp.Expr, coefficient: sp.Expr, contact: Contact, rest: Rest) -> sp.Expr:
        return 0 * rate
