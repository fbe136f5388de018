"""No damping in the contacts."""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp

from ballpass.derive.bearing.laws.contact import Contact, SmoothedRest
from ballpass.derive.bearing.laws.law import DampingLaw


class NoDamping(DampingLaw):
    """Has neither a number nor a force."""

    name = "none"
    description = "no damping in the contacts"

    def coefficient(self, numbers: Mapping[str, sp.Expr], stiffness: sp.Expr) -> sp.Expr:
        return 0 * stiffness

    def force(
        self, delta: sp.Expr, rate: sp.Expr, coefficient: sp.Expr, contact: Contact, rest: SmoothedRest
    ) -> sp.Expr:
        return 0 * rate
