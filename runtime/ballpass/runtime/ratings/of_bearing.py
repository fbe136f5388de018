"""The ratings of a model's bearing: those that its scene gives, else those of its geometry; and its contacts.

In: the manifest's record of a bearing, and values of parameters by name (floats, or CasADi's symbols).  Out: `Ratings`,
`Contact`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ballpass.runtime.contract import BearingInfo
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.ratings import ellipse, load_ratings
from ballpass.runtime.ratings.life import ball_ratings


@dataclass(frozen=True, slots=True, kw_only=True)
class Ratings:
    """C_r, C_0r, C_u, and Q_ci, Q_ce of a ball at inner and outer ring [N]; `given` names those the scene gives.

    Examples
    --------
    >>> ratings = ratings_of(model.manifest.bearings[0], model.numbers().values)
    >>> f"{ratings.static / 1e3:.2f} kN", ratings.given
    ('6.59 kN', ())
    """

    dynamic: Any
    static: Any
    fatigue_limit: Any
    inner_ball: Any
    outer_ball: Any
    given: tuple[str, ...]


def ratings_of(bearing: BearingInfo, values: Mapping[str, Any]) -> Ratings:
    """Ratings of a bearing.

    A rating that the scene gives is a number: it does not follow parameters that are changed.  The groove radii of a
    scene that gives a contact stiffness instead are the reference ones of ISO 16281.

    Parameters
    ----------
    values : parameters by name [SI]

    Examples
    --------
    >>> ratings = ratings_of(model.manifest.bearings[0], model.numbers().values)
    >>> f"{ratings.dynamic / 1e3:.2f} kN"
    '12.79 kN'
    """
    ball, pitch = values[f"{bearing.path}.ball_diameter"], values[f"{bearing.path}.pitch_diameter"]
    inner, outer = _grooves(bearing, values)
    taken = bearing.catalogue
    dynamic = None if taken is None else taken.dynamic_rating
    static = None if taken is None else taken.static_rating
    limit = None if taken is None else taken.fatigue_limit
    numbers = {"dynamic_rating": dynamic, "static_rating": static, "fatigue_limit": limit}
    given = tuple(name for name, value in numbers.items() if value is not None)
    if dynamic is None:
        dynamic = load_ratings.dynamic_rating(bearing.balls, ball, pitch, (inner, outer))
    if static is None:
        static = load_ratings.static_rating(bearing.balls, ball, pitch, (inner, outer))
    if limit is None:
        limit = load_ratings.fatigue_limit(static, pitch)
    inner_ball, outer_ball = ball_ratings(dynamic, bearing.balls, ball / pitch, (inner, outer))
    return Ratings(
        dynamic=dynamic, static=static, fatigue_limit=limit, inner_ball=inner_ball, outer_ball=outer_ball, given=given
    )


#: Rings turn against each other above this part of the speed of the driver [1].
TURNS = 1e-9


def why_no_life(bearing: BearingInfo, values: Mapping[str, Any], shaft_speed: float) -> str:
    """Why no standard gives the bearing a life; empty where one does.

    Parameters
    ----------
    values : parameters and derived constants by name
    shaft_speed : of driver or shaft [rad/s]
    """
    if abs(values[bearing.ring_speed]) > TURNS * abs(shaft_speed):
        return ""
    name = f"The bearing {bearing.name}" if bearing.name else "The bearing"
    if shaft_speed == 0.0:
        return f"{name} does not turn: rating lives count turns. Judge it by its static safety."
    return (
        f"{name} swings: its inner ring has no mean speed against the outer one. ISO 281 and ISO 16281 hold for "
        "bearings that turn. Watch for fretting (false brinelling) at the places where the balls stand; judge the load "
        "by the static safety."
    )


def refuse_swinging(bearing: BearingInfo, values: Mapping[str, Any], shaft_speed: float) -> None:
    """RequestError where `why_no_life` has a reason."""
    reason = why_no_life(bearing, values, shaft_speed)
    if reason:
        others = "the life of a bearing that turns, or max:ball.force"
        raise RequestError(f"{bearing.prefix}life: {reason} Allowed: {others}.")


@dataclass(frozen=True, slots=True, kw_only=True)
class RacewayContact:
    """Contact of a ball with one ring.

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
        """Half axes of the ellipse across the groove and along it under a load [N]; [m]."""
        return ellipse.semi_axes(load, self.ellipticity, self.curvature_sum, self.compliance)

    def peak_pressure(self, load: Any) -> Any:
        """Pressure in its middle under a load [N]; [Pa]."""
        return ellipse.peak_pressure(load, self.ellipticity, self.curvature_sum, self.compliance)


def geometry_is_assumed(bearing: BearingInfo, values: Mapping[str, Any]) -> bool:
    """Whether the scene gives a stiffness, so that grooves and steel are the reference ones of ISO 76."""
    return f"{bearing.path}.contact.inner_groove_radius" not in values


def contacts_of(bearing: BearingInfo, values: Mapping[str, Any]) -> tuple[RacewayContact, RacewayContact]:
    """Contacts with inner and outer ring; see `geometry_is_assumed`."""
    ball, pitch = values[f"{bearing.path}.ball_diameter"], values[f"{bearing.path}.pitch_diameter"]
    found = []
    for sign, groove in zip((1.0, -1.0), _grooves(bearing, values), strict=True):
        raceway = sign * (pitch - sign * ball) / 2.0
        ratio, curvature_sum = ellipse.groove_curvatures(ball, raceway, groove * ball)
        found.append(
            RacewayContact(
                ellipticity=ellipse.ellipticity(ratio),
                curvature_sum=curvature_sum,
                compliance=ellipse.compliance(*_steel(bearing, values)),
                ball_diameter=ball,
                raceway_radius=raceway,
                groove_radius=groove * ball,
            )
        )
    inner, outer = found
    return inner, outer


def _grooves(bearing: BearingInfo, values: Mapping[str, Any]) -> tuple[Any, Any]:
    """Groove radius over ball diameter, inner and outer; the reference ones where the scene has none."""
    if geometry_is_assumed(bearing, values):
        return load_ratings.REFERENCE_GROOVES
    ball = values[f"{bearing.path}.ball_diameter"]
    inner, outer = (values[f"{bearing.path}.contact.{ring}_groove_radius"] / ball for ring in ("inner", "outer"))
    return inner, outer


def _steel(bearing: BearingInfo, values: Mapping[str, Any]) -> list[tuple[Any, Any]]:
    """Young's modulus and Poisson's ratio of rings, and of balls where they differ."""
    if geometry_is_assumed(bearing, values):
        return [load_ratings.STEEL]
    places = (f"{bearing.path}.contact", f"{bearing.path}.contact.ball_material")
    return [
        (values[f"{place}.young_modulus"], values[f"{place}.poisson_ratio"])
        for place in places
        if f"{place}.young_modulus" in values
    ]
