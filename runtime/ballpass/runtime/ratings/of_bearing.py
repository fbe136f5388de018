"""The ratings of a model's bearing: those its scene gives, else what follows from its geometry.

In: the manifest's record of a bearing, and values of parameters by name (floats, or CasADi's symbols).  Out: `Ratings`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ballpass.runtime.contract import BearingInfo
from ballpass.runtime.ratings import load_ratings
from ballpass.runtime.ratings.life import ball_ratings


@dataclass(frozen=True, slots=True, kw_only=True)
class Ratings:
    """C_r, C_0r, C_u, and Q_ci, Q_ce of a ball at inner and outer ring [N]; `given` names those the scene gives."""

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
    """
    ball, pitch = values[f"{bearing.path}.ball_diameter"], values[f"{bearing.path}.pitch_diameter"]
    radii = [values.get(f"{bearing.path}.contact.{ring}_groove_radius") for ring in ("inner", "outer")]
    inner, outer = (
        load_ratings.REFERENCE_GROOVES if any(r is None for r in radii) else (radius / ball for radius in radii)
    )
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
