"""Damping proportional to the slope of the contact force: beta dF/d(delta) d(delta)/dt.

Consistent in dimension, gated by itself, continuous.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import sympy as sp

from ballpass.derive.bearing.laws.contact import Contact, SmoothedRest
from ballpass.derive.bearing.laws.law import DampingLaw
from ballpass.derive.scene.quantity import NOT_NEGATIVE
from ballpass.derive.scene.read_keys import number


class Tangent(DampingLaw):
    """Resists in proportion to the contact's tangent stiffness."""

    name = "tangent"
    description = "proportional to the tangent stiffness of the contact; vanishes continuously with the load"
    unit = "s"
    latex = r"\beta"
    words = "Damping time constant of the contact"

    keys = MappingProxyType(
        {
            "ratio": number(
                "s",
                "Damping time constant: damping over tangent stiffness of the contact",
                r"\beta",
                "0.25e-5 s",
                bounds=NOT_NEGATIVE,
                wrong_dimension='write a time, as in "0.25e-5 s": the law "tangent" multiplies the slope of the '
                "contact force [N/m]",
            )
        }
    )

    def coefficient(self, numbers: Mapping[str, sp.Expr], stiffness: sp.Expr) -> sp.Expr:
        return numbers["ratio"]

    def force(
        self, delta: sp.Expr, rate: sp.Expr, coefficient: sp.Expr, contact: Contact, rest: SmoothedRest
    ) -> sp.Expr:
        return coefficient * contact.slope(delta) * rate
