"""Eq. (10) as printed: c_b times the positive part of the rate, whether the ball touches or not."""

from __future__ import annotations

import sympy as sp

from ballpass.derive.bearing.laws.contact import Contact, SmoothedRest
from ballpass.derive.bearing.laws.law import ViscousLaw


class OneSided(ViscousLaw):
    """Resists approach only."""

    name = "one-sided"
    description = "Eq. (10) as printed: resists approach only, whether the ball touches or not"
    kinked_at_rest = True

    def force(
        self, delta: sp.Expr, rate: sp.Expr, coefficient: sp.Expr, contact: Contact, rest: SmoothedRest
    ) -> sp.Expr:
        return coefficient * rest.positive(rate)
