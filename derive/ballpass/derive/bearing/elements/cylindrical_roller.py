"""The cylindrical roller between two raceways: line contacts, stiffness by Palmgren, pressure and width by Hertz.

The roller does not tilt; its load is even over its effective length.  Each contact approaches by
3.84e-5 Q^0.9/l^0.8, of steel, lengths in mm (Palmgren 1959; Harris & Kotzalas, Essential Concepts of Bearing
Technology, 5th ed., 2006, Eq. 6.54), other materials by their compliance to the power 0.9.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar

import sympy as sp

from ballpass.derive.bearing.elements.element import RollingElement, compliance, raceway_radius
from ballpass.derive.scene.bearing_records import Bearing, Material, smoothing_key
from ballpass.derive.scene.designations import BearingType
from ballpass.derive.scene.quantity import SceneNumber, UsualRange
from ballpass.derive.scene.read_keys import positive
from ballpass.derive.terms import Definition, Names, symbol_of
from ballpass.derive.variables import Words

#: Approach of a steel roller and a raceway over Q^0.9/l^0.8, in m, N, m; and the compliance of that steel [1/Pa].
APPROACH = sp.Rational(384, 10**10) * sp.Integer(1000) ** sp.Rational(-4, 5)
STEEL = sp.Rational(2 * 91, 100) / sp.Integer(207 * 10**9)


def _length() -> Any:
    return positive(
        "m",
        "Effective length of a roller",
        "l",
        "9 mm",
        when="required with rollers",
        usual=UsualRange(least=0.5, most=20.0, of="ball_diameter", hint="Check that no width of a bearing was given."),
        note="without its rounded ends",
    )


def _crown() -> Any:
    return positive(
        "m",
        "Radius of the profile of a crowned roller",
        "R_c",
        "5 m",
        optional=True,
        when="optional, with rollers; default: straight",
        note="for wear alone: the load stays even over the length",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class LineContact:
    """Contact of a roller from geometry: effective length, radius of the crown or None [m], materials."""

    length: SceneNumber = _length()
    crown_radius: SceneNumber | None = _crown()
    ring: Material
    ball: Material | None
    smoothing: SceneNumber | None = smoothing_key()


@dataclass(frozen=True, slots=True, kw_only=True)
class GivenLineContact:
    """Contact stiffness of a roller between both raceways [N/m^(10/9)]; the rest as of `LineContact`."""

    stiffness: SceneNumber = positive(
        "N/m^(10/9)", "Contact stiffness of a roller between both raceways", "k_b", "6e8 N/m^(10/9)"
    )
    length: SceneNumber = _length()
    crown_radius: SceneNumber | None = _crown()
    smoothing: SceneNumber | None = smoothing_key()


class CylindricalRoller(RollingElement):
    """A cylindrical roller, or a needle."""

    name = "cylindrical-roller"
    noun = "roller"
    force_words = "line contact force"
    exponent = sp.Rational(10, 9)
    fill = MappingProxyType({"m^1.5": "m^(10/9)", "m^0.5": "m^(1/9)"})
    derived: ClassVar[type[LineContact]] = LineContact
    given: ClassVar[type[GivenLineContact]] = GivenLineContact
    contact_words = "length and elastic constants, or length and stiffness"

    def fill_contact(self, ball_diameter: object, kind: BearingType) -> Mapping[str, object]:
        return {"length": f"{kind.length} mm"}

    def ring_stiffnesses(self, bearing: Bearing, names: Names) -> tuple[list[Definition], list[sp.Symbol]]:
        contact = bearing.contact
        softer = (compliance(contact) / STEEL) ** sp.Rational(9, 10)
        approach = APPROACH * softer * symbol_of(contact.length) ** sp.Rational(-4, 5)
        factors = [names.constant(f"k_{ring[0]}") for ring in ("inner", "outer")]
        value, unit = approach**-self.exponent, self.stiffness_unit
        return [
            names.define(factor, value, unit, f"Stiffness factor of the {ring} contact", f"k_{ring[0]}")
            for factor, ring in zip(factors, ("inner", "outer"), strict=True)
        ], factors

    def contact_quantities(
        self, bearing: Bearing, names: Names, force: sp.Expr
    ) -> Mapping[str, tuple[tuple[Definition, ...], Sequence[Words]]]:
        contact = bearing.contact
        if isinstance(contact, GivenLineContact):
            return {}
        length, soft = symbol_of(contact.length), compliance(contact)
        out = {}
        for ring, sign in (("inner", 1), ("outer", -1)):
            letter, radius = ring[0], raceway_radius(ring, bearing, names)
            curvature = names.constant(f"{ring}_curvature_sum")
            width, pressure = names.constant(f"{ring}_half_width"), names.constant(f"{ring}_pressure")
            over, root = "over the root of the force", sp.sqrt(force)
            both = 2 / symbol_of(bearing.ball_diameter) + sign / radius.symbol
            half, peak = sp.sqrt(4 * soft / (sp.pi * length * curvature)), sp.sqrt(curvature / (sp.pi * length * soft))
            constants = (
                (curvature, both, "1/m", f"Curvature sum at the {ring} contact", rf"\Sigma\rho_{letter}"),
                (width, half, "m/N^0.5", f"Half width of the {ring} contact, {over}", f"b_{letter}"),
                (pressure, peak, "Pa/N^0.5", f"Peak pressure of the {ring} contact, {over}", f"p_{letter}"),
            )
            at = f"{{}} with the {ring} ring"
            rows = (
                ("pressure", pressure * root, "Pa", f"Peak pressure of {at}"),
                ("half_width", width * root, "m", f"Half width of {at}"),
            )
            out[ring] = (radius, *(names.define(*row) for row in constants)), (*rows, self.approach(ring, names, force))
        return out
