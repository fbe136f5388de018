"""A contact of the user's own, k delta^n: no standard rates it."""

from __future__ import annotations

from typing import Any

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.ratings import life
from ballpass.runtime.ratings.elements.rated import RatedElement


class RatedPowerLaw(RatedElement):
    """An element of which force and deflection are known, and neither shape nor material."""

    name = "power-law"
    noun = "rolling element"
    unrated = (
        'element = "power-law" says nothing of shape and material: no standard gives it load ratings, a life or a '
        'contact pressure. For these write element = "ball" or "cylindrical-roller".'
    )
    limit_words = contact_words = middle = ""
    static_pressure = 0.0
    life = life.BALLS  # the generated code sums powers of loads, which nothing reads here

    def _refuse(self, *_: Any, **__: Any) -> Any:
        raise RequestError(f"{self.unrated} Allowed without: forces and motion.")

    volume = dynamic_rating = static_rating = fatigue_limit = ring_ratings = is_assumed = contacts = _refuse
