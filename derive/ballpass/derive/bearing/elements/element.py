"""What a rolling element is: keys of its contact in the scene file, and what makes a force of a deflection.

An element is one object in one file of this folder; `ELEMENTS` in ``__init__.py`` lists them.  Ratings, pressure and
life are the other half: the element of the same name in `ballpass.runtime.ratings.elements`.  In names of parameters
and channels "ball" stands for any element.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from decimal import Decimal
from types import MappingProxyType
from typing import Any, ClassVar

import sympy as sp

from ballpass.derive.bearing.contact_direction import contact_cosine
from ballpass.derive.scene.bearing_records import Bearing, Material
from ballpass.derive.scene.checker import Checker
from ballpass.derive.scene.designations import BearingType
from ballpass.derive.scene.keys import Fill, filled
from ballpass.derive.scene.read_keys import Either, keys_of, read_inner, read_record
from ballpass.derive.scene.table import Table
from ballpass.derive.terms import Definition, Names, symbol_of
from ballpass.derive.variables import Words

#: What placeholders in the keys of materials stand for.
RINGS: Fill = MappingProxyType({"PART": "rings", "_OF": ""})


class RollingElement:
    """A rolling element between two rings.

    Attributes
    ----------
    name, noun : what stands in the scene file, and what one is called
    force_words : what its elastic force is
    exponent : of the deflection in the force
    fill : texts to put for others in keys whose units depend on the exponent
    derived, given : records of ``[bearing.contact]``: the stiffness follows from geometry and material, or is a number
    contact_words : what that table holds
    """

    name: ClassVar[str]
    noun: ClassVar[str]
    force_words: ClassVar[str]
    exponent: ClassVar[sp.Rational]
    fill: ClassVar[Fill] = MappingProxyType({})
    derived: ClassVar[type[Any]]
    given: ClassVar[type[Any]]
    contact_words: ClassVar[str]

    @property
    def stiffness_unit(self) -> str:
        """Unit of the stiffness factor."""
        return filled("N/m^1.5", self.fill)

    @property
    def element_material(self) -> Fill:
        """What placeholders in the keys of the elements' own material stand for."""
        return {"PART": f"{self.noun}s", "_OF": "_w"}

    @property
    def either(self) -> Either:
        """What gives the stiffness."""
        geometry = [key for key in keys_of(self.derived) if key not in keys_of(self.given)]
        return Either(
            what="the contact stiffness", groups=(("stiffness",), (*geometry, *keys_of(Material))), at="stiffness"
        )

    def read_contact(self, table: Table) -> Any:
        """The record of the table ``contact`` of a bearing; faults are noted."""
        with table.table("contact", self.contact_words) as contact:
            contact.know(*keys_of(self.derived), *keys_of(self.given), *keys_of(Material), "ball_material")
            chosen = self.either.choose(contact, keys_of(self.derived) | keys_of(Material) | keys_of(self.given))
            if chosen == ("stiffness",):
                return read_record(self.given, contact)
            contact.missing = contact.missing or not chosen
            own = None
            if contact.has("ball_material"):
                example = "young_modulus and poisson_ratio"
                own = read_inner(Material, contact, "ball_material", example, self.element_material)
            return read_record(self.derived, contact, ring=read_record(Material, contact, RINGS), ball=own)

    def fill_contact(self, ball_diameter: object, kind: BearingType) -> Mapping[str, object]:
        """Keys of the contact that a designation gives, besides steel."""
        return {}

    def check(self, checker: Checker, bearing: Bearing) -> None:
        """Note what numbers of the contact do not fit together."""

    def relations(self, bearing: Bearing) -> Sequence[tuple[str, float, str]]:
        """What numbers of the contact must be to others, see `values.value_relations`."""
        return ()

    def stiffness(self, bearing: Bearing, names: Names) -> list[Definition]:
        """k_b, and for contact from geometry the way to it."""
        total = f"Stiffness factor of a {self.noun} between both raceways, Eq. (5)"
        way: list[Definition] = []
        if isinstance(bearing.contact, self.given):
            stiffness = symbol_of(bearing.contact.stiffness)
        else:
            way, factors = self.ring_stiffnesses(bearing, names)
            stiffness = self.in_series(factors)
        return [*way, names.define(names.constant("k_b"), stiffness, self.stiffness_unit, total, "k_b")]

    def power_law(self, bearing: Bearing, names: Names) -> tuple[sp.Expr, sp.Expr]:
        """Factor and exponent of the deflection in the elastic force."""
        return names.constant("k_b"), self.exponent

    def in_series(self, factors: Sequence[sp.Expr]) -> sp.Expr:
        """Stiffness factor of contacts whose deflections add up."""
        return sum(factor ** (-1 / self.exponent) for factor in factors) ** -self.exponent

    def ring_stiffnesses(self, bearing: Bearing, names: Names) -> tuple[list[Definition], list[sp.Symbol]]:
        """Stiffness factors of the contacts with inner and outer ring, and the way to them, of one from geometry."""
        return [], []

    def contact_quantities(
        self, bearing: Bearing, names: Names, force: sp.Expr
    ) -> Mapping[str, tuple[tuple[Definition, ...], Sequence[Words]]]:
        """Pressure, half axes and approach under a force, by ring, and constants they use; none for a given stiffness.

        The constants use those of `stiffness`.
        """
        return {}

    def approach(self, ring: str, names: Names, force: sp.Expr) -> Words:
        """Approach of the element and a ring whose stiffness factor `ring_stiffnesses` defines."""
        factor = names.constant(f"k_{ring[0]}")
        words = f"Approach of {{}} with the {ring} ring"
        return "approach", (force / factor) ** (1 / self.exponent), "m", words


def compliance(contact: Any) -> sp.Expr:
    """(1 - nu^2)/E of ring and element together [1/Pa]."""
    materials = (contact.ring, contact.ball or contact.ring)
    return sum(((1 - symbol_of(m.poisson_ratio) ** 2) / symbol_of(m.young_modulus) for m in materials), start=sp.S.Zero)


def raceway_radius(ring: str, bearing: Bearing, names: Names) -> Definition:
    """Radius of a raceway from the bearing's axis; at a contact angle, in the plane in which a ball rolls."""
    inner, cosine = ring == "inner", contact_cosine(bearing)
    where = "from the bearing axis, Eq. (7)" if cosine == 1 else "in the plane of rolling"
    ball, pitch = symbol_of(bearing.ball_diameter), symbol_of(bearing.pitch_diameter)
    return names.define(
        names.constant(f"{ring}_raceway_radius"),
        (pitch / cosine - (1 if inner else -1) * ball) / 2,
        "m",
        f"Radius of the {ring} raceway {where}",
        "r_b" if inner else "R_b",
    )


def scaled(text: object, ratio: Decimal) -> str | None:
    """A length written in mm times a ratio, exactly; None where it is written otherwise."""
    number, _, unit = str(text).partition(" ")
    return f"{Decimal(number) * ratio} mm" if unit == "mm" and number.replace(".", "", 1).isdigit() else None
