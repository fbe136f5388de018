"""A contact of the user's own: a force at a deflection, and the exponent with which it grows, k delta^n.

Both are numbers of a run.  The stiffness is written as force and deflection, so that its unit does not depend on the
exponent: ``k N/mm^n`` is the force ``k N`` at 1 mm.  Nothing is said of shape and material, and no standard rates it.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar

import sympy as sp

from ballpass.derive.bearing.elements.element import RollingElement
from ballpass.derive.scene.bearing_records import Bearing, smoothing_key
from ballpass.derive.scene.quantity import Bounds, SceneNumber, UsualRange
from ballpass.derive.scene.read_keys import positive, quantity, read_inner
from ballpass.derive.scene.table import Table
from ballpass.derive.terms import Definition, Names, symbol_of

_WHEN = 'required with `element = "power-law"`'


@dataclass(frozen=True, slots=True, kw_only=True)
class PowerLawContact:
    """Force [N] at a deflection [m], and the exponent with which it grows [1]; `smoothing` as of `HertzContact`."""

    force: SceneNumber = positive(
        "N",
        "Force of an element between both raceways at its reference deflection",
        r"F_{\mathrm{ref}}",
        "1 kN",
        when=_WHEN,
        note="k N/mm^n is the force k N at 1 mm",
    )
    deflection: SceneNumber = positive(
        "m", "Deflection of both contacts of an element under that force", r"\delta_{\mathrm{ref}}", "20 um", when=_WHEN
    )
    exponent: SceneNumber = quantity(
        "1",
        "Exponent of the deflection in the force of an element",
        "n",
        1.3,
        when=_WHEN,
        bounds=Bounds(above=1.0),
        remedy="give the exponent of the law; 1.001 for a contact that is almost linear",
        usual=UsualRange(most=2.0, hint="Points have 3/2, lines about 10/9."),
    )
    smoothing: SceneNumber | None = smoothing_key()


class PowerLaw(RollingElement):
    """An element whose force grows with a power of its deflection."""

    name = "power-law"
    noun = "rolling element"
    force_words = "force by a power of the deflection"
    fill = MappingProxyType(
        {
            "N/m^1.5": "N/m",
            "s*m^0.5": "s",
            "s*mm^0.5": "s",
            "the paper's number as": "a time, as in",
            '; for a time, as in "0.25e-5 s", name the law "tangent"': "",
        }
    )
    derived: ClassVar[type[PowerLawContact]] = PowerLawContact
    given: ClassVar[type[PowerLawContact]] = PowerLawContact
    contact_words = "force, deflection and exponent"

    def read_contact(self, table: Table) -> Any:
        return read_inner(PowerLawContact, table, "contact", self.contact_words)

    def stiffness(self, bearing: Bearing, names: Names) -> list[Definition]:
        """k_b, that of the chord from no load to the reference deflection."""
        contact, words = bearing.contact, f"Stiffness of a {self.noun}, force over deflection of the reference"
        stiffness = symbol_of(contact.force) / symbol_of(contact.deflection)
        return [names.define(names.constant("k_b"), stiffness, self.stiffness_unit, words, "k_b")]

    def power_law(self, bearing: Bearing, names: Names) -> tuple[sp.Expr, sp.Expr]:
        exponent = symbol_of(bearing.contact.exponent)
        return names.constant("k_b") * symbol_of(bearing.contact.deflection) ** (1 - exponent), exponent
