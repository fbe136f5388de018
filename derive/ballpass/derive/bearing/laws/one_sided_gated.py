"""Eq. (10) only while the ball is loaded: the force jumps at contact."""

from __future__ import annotations

import sympy as sp

from ballpass.derive.bearing.laws.contact import Contact, SmoothedRest
from ballpass.derive.bearing.laws.law import ViscousLaw


class OneSidedGated(ViscousLaw):
    """Resists approach of a ball that touches."""

    name = "one-sided-gated"
    description = "Eq. (10) only while the ball is loaded; the force jumps at contact"
    kinked_at_rest = True

    def force(
        self, delta: sp.Expr, rate: sp.Expr, coefficient: sp.Expr, contact: Contact, rest: SmoothedRest
    ) -> sp.Expr:
        return coefficient * rest.positive(rate) * contact.gate(delta)
