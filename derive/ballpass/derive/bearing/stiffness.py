"""Contact of a ball with both raceways: stiffness, given or from geometry by Hertz's theory, Eq. (5); its ellipses."""

from __future__ import annotations

import sympy as sp

from ballpass.derive.bearing import hertz
from ballpass.derive.scene.bearing_records import Bearing, GivenContact, HertzContact
from ballpass.derive.terms import Definition, Names, symbol_of


def stiffness_constants(bearing: Bearing, names: Names) -> list[Definition]:
    """k_b, and for contact from geometry the way to it."""
    contact, stiffness = bearing.contact, names.constant("k_b")
    total = "Stiffness factor of a ball between both raceways, Eq. (5)"
    if isinstance(contact, GivenContact):
        return [names.define(stiffness, symbol_of(contact.stiffness), "N/m^1.5", total, "k_b")]
    ball_diameter, pitch_diameter = symbol_of(bearing.ball_diameter), symbol_of(bearing.pitch_diameter)
    out: list[Definition] = []
    factors = []
    for ring, sign, groove in (("inner", 1, contact.inner_groove_radius), ("outer", -1, contact.outer_groove_radius)):
        letter = ring[0]
        raceway = names.constant(f"{ring}_raceway_radius")
        ratio, curvature = names.constant(f"{ring}_curvature_ratio"), names.constant(f"{ring}_curvature_sum")
        kappa, factor = names.constant(f"{ring}_ellipticity"), names.constant(f"k_{letter}")
        ratio_of, sum_of = hertz.curvature_ratio(ball_diameter, sign * raceway, symbol_of(groove))
        out += [
            names.define(
                raceway,
                (pitch_diameter - sign * ball_diameter) / 2,
                "m",
                f"Radius of the {ring} raceway from the bearing axis, Eq. (7)",
                "r_b" if ring == "inner" else "R_b",
            ),
            names.define(
                ratio, ratio_of, "1", f"Ratio of the principal curvature sums at the {ring} contact", rf"(A/B)_{letter}"
            ),
            names.define(curvature, sum_of, "1/m", f"Curvature sum at the {ring} contact", rf"\Sigma\rho_{letter}"),
            names.define(
                kappa, hertz.ellipticity(ratio), "1", f"Ellipticity a/b of the {ring} contact", rf"\kappa_{letter}"
            ),
            names.define(
                factor,
                hertz.contact_stiffness(kappa=kappa, curvature_sum=curvature, compliance=_compliance(contact)),
                "N/m^1.5",
                f"Stiffness factor of the {ring} contact",
                f"k_{letter}",
            ),
        ]
        factors.append(factor)
    out.append(names.define(stiffness, hertz.series_stiffness(*factors), "N/m^1.5", total, "k_b"))
    return out


def ellipse_constants(bearing: Bearing, names: Names) -> dict[str, tuple[Definition, Definition, Definition]]:
    """By ring, half axes of the contact ellipse and peak pressure, all over the cube root of the ball's force.

    They use constants of `stiffness_constants`; none where the stiffness is given.
    """
    contact = bearing.contact
    if isinstance(contact, GivenContact):
        return {}
    out = {}
    for ring in ("inner", "outer"):
        letter = ring[0]
        major, minor, pressure = (names.constant(f"{ring}_{n}") for n in ("major_axis", "minor_axis", "pressure"))
        axes = hertz.half_axes(
            kappa=names.constant(f"{ring}_ellipticity"),
            curvature_sum=names.constant(f"{ring}_curvature_sum"),
            compliance=_compliance(contact),
        )
        words, over = f"of the {ring} contact's ellipse", "over the cube root of the force"
        out[ring] = (
            names.define(major, axes[0], "m/N^(1/3)", f"Half axis {words} across the groove, {over}", f"a_{letter}"),
            names.define(minor, axes[1], "m/N^(1/3)", f"Half axis {words} along the groove, {over}", f"b_{letter}"),
            names.define(
                pressure,
                hertz.peak_pressure(major, minor),
                "Pa/N^(1/3)",
                f"Peak pressure of the {ring} contact, {over}",
                f"p_{letter}",
            ),
        )
    return out


def _compliance(contact: HertzContact) -> sp.Expr:
    ring, ball = contact.ring, contact.ball or contact.ring
    return sum(
        ((1 - symbol_of(m.poisson_ratio) ** 2) / symbol_of(m.young_modulus) for m in (ring, ball)), start=sp.S.Zero
    )
