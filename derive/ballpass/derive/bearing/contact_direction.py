"""Direction of the contact of a ball: its angle to the radial plane, and the gap that is left in that direction.

In: a bearing.  Out: a `ContactDirection`.

The rings move in their plane, and the contact angle alpha is a constant of the run.  A ball is deflected by
cos(alpha) (delta_r - g), delta_r the approach of the rings along the ball, and pushes along the contact: its radial
part is F_j cos(alpha).  The radial gap g is half the clearance where the scene gives the angle.  Where it gives an
axial displacement delta_a of the rings, the centres of the grooves, A = r_i + r_e - D_w apart without load, are
a = A - P_d/2 apart radially and delta_a axially: tan(alpha) = delta_a/a, and the ball is deflected by
a/cos(alpha) - A before any load (Harris & Kotzalas, Essential Concepts of Bearing Technology, 5th ed., 2006, ch. 7).
"""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from ballpass.derive.scene.bearing_records import Bearing
from ballpass.derive.terms import Definition, names_of, symbol_of


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactDirection:
    """Cosine of the contact angle, radial gap [m], constants in them; 1 and P_d/2 where the scene names no angle."""

    cosine: sp.Expr
    gap: sp.Expr
    constants: tuple[Definition, ...] = ()

    def deflection(self, approach: sp.Expr) -> sp.Expr:
        """Deflection of a ball [m] from the approach of the rings along it [m]."""
        return self.cosine * (approach - self.gap)


def contact_cosine(bearing: Bearing) -> sp.Expr:
    """Cosine of the contact angle: a constant that `contact_direction` defines, or 1."""
    if bearing.contact_angle is None and bearing.axial_displacement is None:
        return sp.S.One
    return names_of(bearing).constant("cos_contact_angle")


def ball_turns(bearing: Bearing) -> sp.Expr:
    """Turns of a ball, seen from the cage, for one of the cage over the outer raceway, on which balls roll."""
    return contact_cosine(bearing) + symbol_of(bearing.pitch_diameter) / symbol_of(bearing.ball_diameter)


def contact_direction(bearing: Bearing) -> ContactDirection:
    """The direction of the contacts of a bearing."""
    names, cosine = names_of(bearing), contact_cosine(bearing)
    half = symbol_of(bearing.clearance) / 2
    if cosine == 1:
        return ContactDirection(cosine=cosine, gap=half)
    words = "Cosine of the contact angle"
    if bearing.axial_displacement is None:
        assert bearing.contact_angle is not None
        angle = sp.cos(symbol_of(bearing.contact_angle))
        return ContactDirection(
            cosine=cosine, gap=half, constants=(names.define(cosine, angle, "1", words, r"\cos\alpha"),)
        )
    contact, axial = bearing.contact, symbol_of(bearing.axial_displacement)
    curvature = (
        symbol_of(contact.inner_groove_radius)
        + symbol_of(contact.outer_groove_radius)
        - symbol_of(bearing.ball_diameter)
    )
    apart, gap = names.constant("groove_centre_distance"), names.constant("radial_gap")
    radial = apart - half
    constants = (
        names.define(apart, curvature, "m", "Distance of the centres of the grooves without load", "A"),
        names.define(cosine, radial / sp.sqrt(radial**2 + axial**2), "1", words, r"\cos\alpha"),
        names.define(
            gap, (apart - radial / cosine) / cosine, "m", "Radial gap between ball and raceways, negative: preload", "g"
        ),
    )
    return ContactDirection(cosine=cosine, gap=gap, constants=constants)
