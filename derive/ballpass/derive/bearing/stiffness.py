"""Stiffness of a ball between both raceways: given, or from geometry by Hertz's theory, Eq. (5)."""

from __future__ import annotations

import sympy as sp

from ballpass.derive.bearing import hertz
from ballpass.derive.scene.records import Bearing, GivenContact, HertzContact
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


def _compliance(contact: HertzContact) -> sp.Expr:
    ring, ball = contact.ring, contact.ball or contact.ring
    return sum(
        ((1 - symbol_of(m.poisson_ratio) ** 2) / symbol_of(m.young_modulus) for m in (ring, ball)), start=sp.S.Zero
    )
