"""The ball between two grooves: stiffness from geometry by Hertz's theory, Eq. (5), and its contact ellipses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import sympy as sp

from ballpass.derive.bearing.elements import hertz
from ballpass.derive.bearing.elements.element import RollingElement, compliance, raceway_radius, scaled
from ballpass.derive.scene.bearing_records import Bearing, GivenContact, HertzContact
from ballpass.derive.scene.checker import Checker
from ballpass.derive.scene.designations import GROOVES, BearingType
from ballpass.derive.scene.quantity import SceneNumber
from ballpass.derive.scene.units import QuantityError, parse_quantity
from ballpass.derive.terms import Definition, Names, symbol_of
from ballpass.derive.variables import Words


class Ball(RollingElement):
    """A ball between grooves."""

    name = "ball"
    noun = "ball"
    force_words = "Hertz force"
    exponent = sp.Rational(3, 2)
    derived: ClassVar[type[HertzContact]] = HertzContact
    given: ClassVar[type[GivenContact]] = GivenContact
    contact_words = "groove radii and elastic constants, or stiffness"

    def fill_contact(self, ball_diameter: object, kind: BearingType) -> Mapping[str, object]:
        """Grooves of the ratios of ISO 16281."""
        filled = {}
        for ring, ratio in zip(("inner", "outer"), GROOVES, strict=True):
            groove = scaled(ball_diameter, ratio)
            if groove is None:
                try:
                    groove = f"{parse_quantity(ball_diameter, 'm') * float(ratio)!r} m"
                except QuantityError:  # reported where the ball diameter is read
                    groove = "1 m"
            filled[f"{ring}_groove_radius"] = groove
        return filled

    def check(self, checker: Checker, bearing: Bearing) -> None:
        """Grooves are wider than the ball."""
        ball = bearing.ball_diameter
        for radius in self._grooves(bearing):
            if 0.0 < radius.value <= 0.5 * ball.value:
                checker.fault(
                    radius.path,
                    "the groove is not wider than the ball",
                    f"groove radius {checker.show(radius)}, ball diameter {checker.show(ball)}",
                    f"a radius above half the ball diameter, {0.5e3 * ball.value:.6g} mm",
                    "give 0.51 to 0.54 of the ball diameter, as deep groove ball bearings have",
                )

    def relations(self, bearing: Bearing) -> Sequence[tuple[str, float, str]]:
        return [(radius.path, 0.5, bearing.ball_diameter.path) for radius in self._grooves(bearing)]

    def ring_stiffnesses(self, bearing: Bearing, names: Names) -> tuple[list[Definition], list[sp.Symbol]]:
        contact, ball_diameter = bearing.contact, symbol_of(bearing.ball_diameter)
        out: list[Definition] = []
        factors = []
        for ring, sign, groove in (
            ("inner", 1, contact.inner_groove_radius),
            ("outer", -1, contact.outer_groove_radius),
        ):
            letter = ring[0]
            raceway = names.constant(f"{ring}_raceway_radius")
            ratio, curvature = names.constant(f"{ring}_curvature_ratio"), names.constant(f"{ring}_curvature_sum")
            kappa, factor = names.constant(f"{ring}_ellipticity"), names.constant(f"k_{letter}")
            ratio_of, sum_of = hertz.curvature_ratio(ball_diameter, sign * raceway, symbol_of(groove))
            stiffness = hertz.contact_stiffness(kappa=kappa, curvature_sum=curvature, compliance=compliance(contact))
            contacts = f"the {ring} contact"
            rows = (
                (ratio, ratio_of, "1", f"Ratio of the principal curvature sums at {contacts}", f"(A/B)_{letter}"),
                (curvature, sum_of, "1/m", f"Curvature sum at {contacts}", rf"\Sigma\rho_{letter}"),
                (kappa, hertz.ellipticity(ratio), "1", f"Ellipticity a/b of {contacts}", rf"\kappa_{letter}"),
                (factor, stiffness, self.stiffness_unit, f"Stiffness factor of {contacts}", f"k_{letter}"),
            )
            out.append(raceway_radius(ring, bearing, names))
            out += [names.define(*row) for row in rows]
            factors.append(factor)
        return out, factors

    def contact_quantities(
        self, bearing: Bearing, names: Names, force: sp.Expr
    ) -> Mapping[str, tuple[tuple[Definition, ...], Sequence[Words]]]:
        contact = bearing.contact
        if isinstance(contact, GivenContact):
            return {}
        out = {}
        for ring in ("inner", "outer"):
            letter, root = ring[0], sp.cbrt(force)
            major, minor, pressure = (names.constant(f"{ring}_{n}") for n in ("major_axis", "minor_axis", "pressure"))
            axes = hertz.half_axes(
                kappa=names.constant(f"{ring}_ellipticity"),
                curvature_sum=names.constant(f"{ring}_curvature_sum"),
                compliance=compliance(contact),
            )
            words, over = f"of the {ring} contact's ellipse", "over the cube root of the force"
            at, half = f"{{}} with the {ring} ring", "Half axis of the ellipse of"
            peak = hertz.peak_pressure(major, minor)
            constants = (
                (major, axes[0], "m/N^(1/3)", f"Half axis {words} across the groove, {over}", f"a_{letter}"),
                (minor, axes[1], "m/N^(1/3)", f"Half axis {words} along the groove, {over}", f"b_{letter}"),
                (pressure, peak, "Pa/N^(1/3)", f"Peak pressure of the {ring} contact, {over}", f"p_{letter}"),
            )
            rows = (
                ("pressure", pressure * root, "Pa", f"Peak pressure of {at}"),
                ("major_axis", major * root, "m", f"{half} {at}, across the groove"),
                ("minor_axis", minor * root, "m", f"{half} {at}, along the groove"),
            )
            out[ring] = tuple(names.define(*row) for row in constants), (*rows, self.approach(ring, names, force))
        return out

    def _grooves(self, bearing: Bearing) -> tuple[SceneNumber, ...]:
        contact = bearing.contact
        return (contact.inner_groove_radius, contact.outer_groove_radius) if isinstance(contact, HertzContact) else ()
