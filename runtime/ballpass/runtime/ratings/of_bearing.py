"""The ratings of a model's bearing: those that its scene gives, else those of its geometry; and its contacts.

In: the manifest's record of a bearing, and values of parameters by name (floats, or CasADi's symbols).  Out: `Ratings`,
`RacewayContact`; how the bearing's rolling elements are rated says `ballpass.runtime.ratings.elements`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import BearingInfo
from ballpass.runtime.ratings.branches import cosine
from ballpass.runtime.ratings.elements import RATED, ElementGeometry, RacewayContact, RatedElement, element_words
from ballpass.runtime.ratings.life import ElementLife
from ballpass.runtime.time.timeline import turns_steadily

__all__ = ["RacewayContact"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Ratings:
    """C_r, C_0r, C_u, and Q_ci, Q_ce of a ball at inner and outer ring [N]; `given` names those the scene gives.

    `life` says how the life of the bearing's elements depends on their load.

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
    life: ElementLife


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
    element, geometry = rated_element(bearing), geometry_of(bearing, values)
    names = ("dynamic_rating", "static_rating", "fatigue_limit")
    dynamic, static, limit = (getattr(bearing.catalogue, name, None) for name in names)
    given = tuple(name for name, value in zip(names, (dynamic, static, limit), strict=True) if value is not None)
    dynamic = element.dynamic_rating(geometry) if dynamic is None else dynamic
    static = element.static_rating(geometry) if static is None else static
    limit = element.fatigue_limit(static, geometry.pitch) if limit is None else limit
    inner_ball, outer_ball = element.ring_ratings(dynamic, geometry)
    return Ratings(
        dynamic=dynamic,
        static=static,
        fatigue_limit=limit,
        inner_ball=inner_ball,
        outer_ball=outer_ball,
        given=given,
        life=element.life,
    )


def bearing_words(text: str, bearings: Iterable[BearingInfo], channel: str = "") -> str:
    """A text on balls, with what they are called in the bearings, or in that one of them which has the output."""
    return element_words(text, [one.element for one in bearings if not channel or channel.startswith(one.prefix)])


def rated_element(bearing: BearingInfo) -> RatedElement:
    """The bearing's rolling element as standards rate it."""
    return RATED[bearing.element]


def geometry_of(bearing: BearingInfo, values: Mapping[str, Any]) -> ElementGeometry:
    """What the bearing's elements are rated by; `values` are parameters by name [SI].

    Raises
    ------
    RequestError
        No standard rates them.
    """
    if unrated := rated_element(bearing).unrated:
        raise RequestError(f"{bearing.path}: {unrated} Allowed without: forces and motion.")
    contact, nominal = f"{bearing.path}.contact.", values.get(f"{bearing.path}.contact_angle")
    return ElementGeometry(
        balls=bearing.balls,
        diameter=values[f"{bearing.path}.ball_diameter"],
        pitch=values[f"{bearing.path}.pitch_diameter"],
        nominal_cosine=1.0 if nominal is None else cosine(nominal),
        cosine=contact_cosine(bearing, values),
        contact={name.removeprefix(contact): values[name] for name in values if name.startswith(contact)},
    )


def contact_cosine(bearing: BearingInfo, values: Mapping[str, Any]) -> Any:
    """Cosine of the contact angle of a run, 1 where the scene names none; `values` with derived constants."""
    return values.get(f"{bearing.path}.cos_contact_angle", 1.0)


def inner_ring_mass(bearing: BearingInfo, values: Mapping[str, float]) -> float | None:
    """Mass with which an inner ring moves on its own [kg]; None where it moves with its body: coupled two-way."""
    return values.get(f"{bearing.path}.m_ei", values.get(f"{bearing.path}.inner_ring.mass"))


def radial_gap(bearing: BearingInfo, values: Mapping[str, float]) -> float:
    """How far the inner ring moves until a ball is in contact [m]; `values` with derived constants."""
    return values.get(f"{bearing.path}.radial_gap", 0.5 * values[f"{bearing.path}.clearance"])


def fit_clearances(bearing: BearingInfo, values: Mapping[str, Any]) -> tuple[float, ...]:
    """Least, lowest probable, mean, highest probable and largest clearance in operation by class of fit [m].

    The spread is that of the scene file, about the clearance in `values`; empty without a class.
    """
    if bearing.fit is None:
        return ()
    mean = bearing.fit.clearance[2]
    return tuple(values[f"{bearing.path}.clearance"] + (each - mean) for each in bearing.fit.clearance)


def why_no_life(bearing: BearingInfo, values: Mapping[str, Any], shaft_speed: float) -> str:
    """Why no standard gives the bearing a life; empty where one does.

    Parameters
    ----------
    values : parameters and derived constants by name
    shaft_speed : of driver or shaft [rad/s]
    """
    if unrated := rated_element(bearing).unrated:
        return unrated
    if turns_steadily(bearing, values, shaft_speed):
        return ""
    name = f"The bearing {bearing.name}" if bearing.name else "The bearing"
    if shaft_speed == 0.0:
        return f"{name} does not turn: rating lives count turns. Judge it by its static safety."
    return (
        f"{name} swings: its inner ring has no mean speed against the outer one. ISO 281 and ISO 16281 hold for "
        "bearings that turn. Watch for fretting (false brinelling) at the places where the rolling elements stand; "
        "judge the load by the static safety. It holds for rolling elements that begin where ball_angle says: vary "
        "that over a pitch."
    )


def contacts_of(bearing: BearingInfo, values: Mapping[str, Any]) -> tuple[RacewayContact, RacewayContact]:
    """Contacts with inner and outer ring; of a scene that gives a stiffness those of ISO 76's grooves and steel."""
    return rated_element(bearing).contacts(geometry_of(bearing, values))
