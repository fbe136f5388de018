"""Hunt and Crossley's law: damping in proportion to the contact force, alpha F d(delta)/dt.

K. H. Hunt, F. R. E. Crossley, J. Appl. Mech. 42 (1975) 440, doi:10.1115/1.3423596.  Lankarani and Nikravesh take the
factor alpha from the loss in an impact, 3 (1 - e^2)/(4 v) for the coefficient of restitution e at the speed v (J. Mech.
Des. 112 (1990) 369, doi:10.1115/1.2912617): the energy lost is then (1 - e^2) of the kinetic energy for e near one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from ballpass.derive.bearing.laws.law import DampingLaw
from ballpass.derive.scene.quantity import Bounds, Quantity
from ballpass.derive.scene.schema import Table, listing

if TYPE_CHECKING:
    import sympy as sp

    from ballpass.derive.bearing.laws.contact import Contact, Rest


class HuntCrossley(DampingLaw):
    """Resists in proportion to the contact's force."""

    name = "hunt-crossley"
    description = "proportional to the contact force; vanishes smoothly with the load"
    unit = "s/m"
    latex = r"\alpha"
    words = "Hysteresis damping factor of the contact"

    def read(self, table: Table) -> tuple[Quantity, ...]:
        keys = ("hysteresis", "restitution", "impact_speed")
        table.know(*keys)
        present = tuple(key for key in keys if key in table.data)
        if present not in (keys[:1], keys[1:]):
            problem, remedy = "the damping factor is missing", 'add hysteresis = "0.2 s/m"'
            if "hysteresis" in present:
                problem, remedy = "the damping factor is given twice", "delete hysteresis, or the other two"
            elif present:
                problem = "half of what gives the damping factor is missing"
                remedy = 'add impact_speed = "0.1 m/s"' if "restitution" in present else "add restitution = 0.8"
            table.fault(
                "",
                problem,
                given=listing(present) if present else "neither",
                allowed='hysteresis (as in "0.2 s/m"), or restitution (as in 0.8) and impact_speed (as in "0.1 m/s")',
                remedy=remedy,
            )
        numbers = []
        if "hysteresis" in present:
            numbers.append(table.quantity("hysteresis", "s/m", self.words, r"\alpha", example="0.2 s/m"))
        if "restitution" in present:
            words = "Coefficient of restitution of a ball's contact"
            numbers.append(table.quantity("restitution", "1", words, "e", example="0.8"))
        if "impact_speed" in present:
            words = "Speed of impact that the coefficient of restitution holds for"
            numbers.append(table.quantity("impact_speed", "m/s", words, "v_0", example="0.1 m/s"))
        return tuple(numbers)

    def bounds(self, key: str) -> Bounds:
        return {
            "restitution": Bounds(least=0.0, most=1.0),
            "impact_speed": Bounds(above=0.0),
        }.get(key, Bounds(least=0.0))

    def coefficient(self, numbers: Mapping[str, sp.Expr], stiffness: sp.Expr) -> sp.Expr:
        if "hysteresis" in numbers:
            return numbers["hysteresis"]
        return 3 * (1 - numbers["restitution"] ** 2) / (4 * numbers["impact_speed"])

    def force(self, delta: sp.Expr, rate: sp.Expr, coefficient: sp.Expr, contact: Contact, rest: Rest) -> sp.Expr:
        return coefficient * contact.force(delta) * rate
