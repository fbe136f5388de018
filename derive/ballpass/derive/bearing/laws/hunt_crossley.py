"""Hunt and Crossley's law: damping in proportion to the contact force, alpha F d(delta)/dt.

K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42 (1975) 440, doi:10.1115/1.3423596.  Lankarani and Nikravesh take the
factor alpha from the loss in an impact, 3 (1 - e^2)/(4 v) for the coefficient of restitution e at the speed v (J. Mech.
Des. 112 (1990) 369, doi:10.1115/1.2912617): the energy lost is then (1 - e^2) of the kinetic energy for e near one.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import sympy as sp

from ballpass.derive.bearing.laws.contact import Contact, SmoothedRest
from ballpass.derive.bearing.laws.law import DampingLaw
from ballpass.derive.scene.quantity import NOT_NEGATIVE, POSITIVE, Bounds
from ballpass.derive.scene.read_keys import Either, number


class HuntCrossley(DampingLaw):
    """Resists in proportion to the contact's force."""

    name = "hunt-crossley"
    description = "proportional to the contact force; vanishes smoothly with the load"
    unit = "s/m"
    latex = r"\alpha"
    words = "Hysteresis damping factor of the contact"

    keys = MappingProxyType(
        {
            "hysteresis": number("s/m", words, r"\alpha", "0.2 s/m", bounds=NOT_NEGATIVE),
            "restitution": number(
                "1",
                "Coefficient of restitution of a ball's contact",
                "e",
                0.8,
                bounds=Bounds(least=0.0, most=1.0),
                note="accurate near one only, see {doc}`../../theory/damping`",
            ),
            "impact_speed": number(
                "m/s",
                "Speed of impact that the coefficient of restitution holds for",
                "v_0",
                "0.1 m/s",
                bounds=POSITIVE,
            ),
        }
    )
    one_of = (Either(what="the damping factor", groups=(("hysteresis",), ("restitution", "impact_speed"))),)

    def coefficient(self, numbers: Mapping[str, sp.Expr], stiffness: sp.Expr) -> sp.Expr:
        if "hysteresis" in numbers:
            return numbers["hysteresis"]
        return 3 * (1 - numbers["restitution"] ** 2) / (4 * numbers["impact_speed"])

    def force(
        self, delta: sp.Expr, rate: sp.Expr, coefficient: sp.Expr, contact: Contact, rest: SmoothedRest
    ) -> sp.Expr:
        return coefficient * contact.force(delta) * rate
