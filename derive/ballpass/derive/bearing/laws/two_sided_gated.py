"""Viscous damping while the ball is loaded, approaching and parting: the force jumps at contact."""

from __future__ import annotations

import sympy as sp

from ballpass.derive.bearing.laws.contact import Contact, SmoothedRest
from ballpass.derive.bearing.laws.law import ViscousLaw


class TwoSidedGated(ViscousLaw):
    """Resists every motion of a ball that touches."""

    name = "two-sided-gated"
    description = "viscous while the ball is loaded; the force jumps at contact"

    def force(
        self, delta: sp.Expr, rate: sp.Expr, coefficient: sp.Expr, contact: Contact, rest: SmoothedRest
    ) -> sp.Expr:
        return coefficient * rate * contact.gate(delta)
