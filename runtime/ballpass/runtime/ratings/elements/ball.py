"""The ball as ISO 76, ISO 281 and ISO 16281 rate it, and its contact with a groove by Hertz."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from ballpass.runtime.ratings import ellipse, groove_slip, life, load_ratings
from ballpass.runtime.ratings.elements.rated import ElementGeometry, RacewayContact, RatedElement


@dataclass(frozen=True, slots=True, kw_only=True)
class GrooveContact(RacewayContact):
    """Contact of a ball with the groove of one ring.

    Attributes
    ----------
    ellipticity, curvature_sum, compliance : of Hertz's theory [1], [1/m], [1/Pa]
    ball_diameter, raceway_radius, groove_radius : the radius of the raceway is negative for the outer ring [m]
    """

    ellipticity: Any
    curvature_sum: Any
    compliance: Any
    ball_diameter: Any
    raceway_radius: Any
    groove_radius: Any

    def semi_axes(self, load: Any) -> tuple[Any, Any]:
        return ellipse.semi_axes(load, self.ellipticity, self.curvature_sum, self.compliance)

    def peak_pressure(self, load: Any) -> Any:
        return ellipse.peak_pressure(load, self.ellipticity, self.curvature_sum, self.compliance)

    def creepage(self, place: Any, load: Any) -> Any:
        across, _ = self.semi_axes(load)
        return groove_slip.creepage(place, across, self.ball_diameter, self.raceway_radius, self.groove_radius)

    def share_of_peak(self, place: Any, load: Any) -> Any:
        across, _ = self.semi_axes(load)
        return 1.0 - (place / across) ** 2


class RatedBall(RatedElement):
    """A ball between grooves; those of a scene that gives a stiffness instead are the reference ones of ISO 16281."""

    name = "ball"
    noun = "ball"
    limit_words = "C_0r/22"
    contact_words = "half axes of the contact ellipse"
    middle = "groove's centre"
    static_pressure = load_ratings.STATIC_PRESSURE
    life = life.BALLS

    def volume(self, geometry: ElementGeometry) -> Any:
        return math.pi / 6.0 * geometry.diameter**3

    def dynamic_rating(self, geometry: ElementGeometry) -> Any:
        return load_ratings.dynamic_rating(*self._sizes(geometry), cosine=geometry.nominal_cosine)

    def static_rating(self, geometry: ElementGeometry) -> Any:
        return load_ratings.static_rating(*self._sizes(geometry), cosine=geometry.nominal_cosine)

    def fatigue_limit(self, static_rating: Any, pitch: Any) -> Any:
        return load_ratings.fatigue_limit(static_rating, pitch)

    def ring_ratings(self, dynamic_rating: Any, geometry: ElementGeometry) -> tuple[Any, Any]:
        at_angle = dynamic_rating / geometry.nominal_cosine**0.7
        return life.ball_ratings(at_angle, geometry.balls, geometry.gamma, self._grooves(geometry))

    def is_assumed(self, geometry: ElementGeometry) -> bool:
        return "inner_groove_radius" not in geometry.contact

    def contacts(self, geometry: ElementGeometry) -> tuple[RacewayContact, RacewayContact]:
        inner, outer = (
            self._contact(geometry, sign, groove)
            for sign, groove in zip((1.0, -1.0), self._grooves(geometry), strict=True)
        )
        return inner, outer

    def _contact(self, geometry: ElementGeometry, sign: float, groove: Any) -> GrooveContact:
        raceway = geometry.raceway_radius(sign)
        ratio, curvature_sum = ellipse.groove_curvatures(geometry.diameter, raceway, groove * geometry.diameter)
        return GrooveContact(
            ellipticity=ellipse.ellipticity(ratio),
            curvature_sum=curvature_sum,
            compliance=ellipse.compliance(*(geometry.materials() or [load_ratings.STEEL])),
            ball_diameter=geometry.diameter,
            raceway_radius=raceway,
            groove_radius=groove * geometry.diameter,
        )

    def _sizes(self, geometry: ElementGeometry) -> tuple[Any, Any, Any, tuple[Any, Any]]:
        return geometry.balls, geometry.diameter, geometry.pitch, self._grooves(geometry)

    def _grooves(self, geometry: ElementGeometry) -> tuple[Any, Any]:
        """Groove radius over ball diameter, inner and outer."""
        if self.is_assumed(geometry):
            return load_ratings.REFERENCE_GROOVES
        inner, outer = (geometry.contact[f"{ring}_groove_radius"] / geometry.diameter for ring in ("inner", "outer"))
        return inner, outer
