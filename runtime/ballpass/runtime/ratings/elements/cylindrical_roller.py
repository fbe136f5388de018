"""The cylindrical roller as ISO 76, ISO 281 and ISO 16281 rate it, and its line contact with a raceway by Hertz.

Rollers do not tilt, so that all parts of their length carry alike.  Sources: ISO 76:2006, ISO 281:2007 with the formula
of f_c behind its table (Lundberg and Palmgren 1952), ISO 16281:2008; Harris & Kotzalas, Essential Concepts of Bearing
Technology, 5th ed., 2006, chapter 6.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from ballpass.runtime.ratings import ellipse, load_ratings
from ballpass.runtime.ratings.branches import larger
from ballpass.runtime.ratings.elements.rated import ElementGeometry, RacewayContact, RatedElement
from ballpass.runtime.ratings.life import ElementLife, LifeFactor

#: ISO 281's factor for contemporary steel and making, cylindrical roller bearings.
MATERIAL_FACTOR = 1.1
#: Factor of f_c that stands for edge stresses and uneven loading, λν.
REDUCTION = 0.83


@dataclass(frozen=True, slots=True, kw_only=True)
class RollerContact(RacewayContact):
    """Contact of a roller with one ring.

    Attributes
    ----------
    length : effective [m]
    curvature_sum : in the plane of rolling [1/m]
    compliance : of both bodies [1/Pa]
    crown : curvature of the roller's profile, 0 where it is straight [1/m]
    """

    length: Any
    curvature_sum: Any
    compliance: Any
    crown: Any

    def semi_axes(self, load: Any) -> tuple[Any, Any]:
        """Half the effective length, and the half width [m]."""
        width = (4.0 * load * self.compliance / (math.pi * self.length * self.curvature_sum)) ** 0.5
        return self.length / 2.0 + 0.0 * load, width

    def peak_pressure(self, load: Any) -> Any:
        return (load * self.curvature_sum / (math.pi * self.length * self.compliance)) ** 0.5

    def creepage(self, place: Any, load: Any) -> Any:
        """Slip of a crowned roller, zero on two lines half-way to its ends; a straight one rolls without [1].

        As in a groove (Heathcote), the contact takes the mean curvature of both profiles, of which the raceway's is
        straight; the load over the length is even, and so is friction on both sides of the lines.
        """
        return self.curvature_sum * self.crown / 4.0 * (place**2 - (self.length / 4.0) ** 2)

    def share_of_peak(self, place: Any, load: Any) -> Any:
        return 1.0


class RatedCylindricalRoller(RatedElement):
    """A cylindrical roller of an effective length; steel is that of ISO 76 where a scene gives a stiffness."""

    name = "cylindrical-roller"
    noun = "roller"
    limit_words = "C_0r/8.2"
    contact_words = "half length and width of the contact"
    middle = "roller's middle"
    static_pressure = 4.0e9
    life = ElementLife(
        basic=Fraction(10, 3),
        turning=Fraction(4),
        weibull=Fraction(9, 8),
        factor=LifeFactor(
            most=1.5859, falls=(1.3993, 1.2348, 1.2348), power=1.0, limit_power=Fraction(2, 5), exponent=9.185
        ),
    )

    def volume(self, geometry: ElementGeometry) -> Any:
        return math.pi / 4.0 * geometry.diameter**2 * geometry.contact["length"]

    def dynamic_rating(self, geometry: ElementGeometry) -> Any:
        """C_r = b_m f_c l^(7/9) Z^(3/4) D_w^(29/27), lengths in mm [N]."""
        length, diameter = 1e3 * geometry.contact["length"], 1e3 * geometry.diameter
        factor = MATERIAL_FACTOR * dynamic_factor(geometry.gamma)
        return factor * length ** (7.0 / 9.0) * geometry.balls**0.75 * diameter ** (29.0 / 27.0)

    def static_rating(self, geometry: ElementGeometry) -> Any:
        """C_0r = 44 (1 - γ) Z l D_w, lengths in mm: 4000 MPa at the heaviest roller [N]."""
        area = 1e6 * geometry.contact["length"] * geometry.diameter
        return 44.0 * (1.0 - geometry.gamma) * geometry.balls * area

    def fatigue_limit(self, static_rating: Any, pitch: Any) -> Any:
        return static_rating / 8.2 * (0.1 / larger(pitch, 0.1)) ** 0.3

    def ring_ratings(self, dynamic_rating: Any, geometry: ElementGeometry) -> tuple[Any, Any]:
        power, root = float(self.life.standing), float(1 / self.life.standing)
        ratio = ring_ratio(geometry.gamma, 1.038) ** power
        return (
            dynamic_rating / (0.378 * geometry.balls) * (1.0 + ratio) ** root,
            dynamic_rating / (0.364 * geometry.balls) * (1.0 + 1.0 / ratio) ** root,
        )

    def is_assumed(self, geometry: ElementGeometry) -> bool:
        return not geometry.materials()

    def contacts(self, geometry: ElementGeometry) -> tuple[RacewayContact, RacewayContact]:
        radius = geometry.contact.get("crown_radius")
        inner, outer = (
            RollerContact(
                length=geometry.contact["length"],
                curvature_sum=2.0 / geometry.diameter + 1.0 / geometry.raceway_radius(sign),
                compliance=ellipse.compliance(*(geometry.materials() or [load_ratings.STEEL])),
                crown=0.0 if radius is None else 1.0 / radius,
            )
            for sign in (1.0, -1.0)
        )
        return inner, outer


def ring_ratio(gamma: Any, factor: float) -> Any:
    """Ratio of the capacities of the inner and the outer contact [1]."""
    return factor * ((1.0 - gamma) / (1.0 + gamma)) ** (143.0 / 108.0)


def dynamic_factor(gamma: Any) -> Any:
    """f_c of ISO 281 for cylindrical rollers, by the formula that its table is made of."""
    both = (1.0 + ring_ratio(gamma, 1.04) ** 4.5) ** (-2.0 / 9.0)
    return 207.9 * REDUCTION * both * gamma ** (2.0 / 9.0) * (1.0 - gamma) ** (29.0 / 27.0) / (1.0 + gamma) ** 0.25
