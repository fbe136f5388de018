"""What strength and life need of a rolling element: ratings, exponents, and its contact with a raceway.

An element is one object in one file of this folder; `RATED` in ``__init__.py`` lists them.  Its other half, what makes
a force of a deflection, is in `ballpass.derive.bearing.elements`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from ballpass.runtime.ratings.life import ElementLife


@dataclass(frozen=True, slots=True, kw_only=True)
class ElementGeometry:
    """Numbers of a bearing by which its elements are rated.

    Attributes
    ----------
    balls : number of elements
    diameter, pitch : of an element, and of the circle of their centres [m]
    contact : numbers of the scene's table of contact, by their keys
    nominal_cosine : of the contact angle that ratings are for: of a deep groove bearing 1, however it is preloaded
    cosine : of the contact angle at which it runs
    """

    balls: Any
    diameter: Any
    pitch: Any
    contact: Mapping[str, Any]
    nominal_cosine: Any = 1.0
    cosine: Any = 1.0

    @property
    def gamma(self) -> Any:
        """D_w cos(alpha)/D_pw [1]."""
        return self.nominal_cosine * self.diameter / self.pitch

    def materials(self) -> list[tuple[Any, Any]]:
        """Young's modulus [Pa] and Poisson's ratio of rings, and of elements where they differ; none if not given."""
        return [
            (self.contact[f"{part}young_modulus"], self.contact[f"{part}poisson_ratio"])
            for part in ("", "ball_material.")
            if f"{part}young_modulus" in self.contact
        ]

    def raceway_radius(self, sign: float) -> Any:
        """In the plane of rolling; without contact angle from the bearing's axis.

        Of the inner ring for the sign 1, of the outer one, and negative, for -1 [m].
        """
        return sign * (self.pitch / self.cosine - sign * self.diameter) / 2.0


class RacewayContact(ABC):
    """Contact of an element with one ring."""

    @abstractmethod
    def semi_axes(self, load: Any) -> tuple[Any, Any]:
        """Half lengths of the contact across the way of the element and along it under a load [N]; [m]."""

    @abstractmethod
    def peak_pressure(self, load: Any) -> Any:
        """Highest pressure under a load [N]; [Pa]."""

    @abstractmethod
    def creepage(self, place: Any, load: Any) -> Any:
        """Speed of slip over speed of rolling at a place across the way of the element [m] under a load [N]; [1]."""

    @abstractmethod
    def share_of_peak(self, place: Any, load: Any) -> Any:
        """Pressure integrated along the way at a place across it, over that in the middle; [1]."""

    def depth_of_pass(self, place: Any, load: Any) -> Any:
        """Depth that a pass wears off at a place across the way, over Archard's wear coefficient [N/m].

        The pressure integrated along the way, (π/2) p_0 b in the middle, times the share of the way that slips.
        """
        _, along = self.semi_axes(load)
        pressed = math.pi / 2.0 * self.peak_pressure(load) * along * self.share_of_peak(place, load)
        return pressed * abs(self.creepage(place, load))


class RatedElement(ABC):
    """A rolling element as standards rate it.

    Attributes
    ----------
    name : what stands in the scene file
    noun : what one is called
    limit_words, contact_words : where its fatigue load limit is from, and what `semi_axes` are of, in a table
    middle : where wear is measured from, in a table
    static_pressure : peak pressure that leaves a dent of 1e-4 of its diameter, ISO 76 [Pa]
    life : how its life depends on its load
    unrated : why no standard rates it; empty where one does
    """

    unrated: ClassVar[str] = ""
    name: ClassVar[str]
    noun: ClassVar[str]
    limit_words: ClassVar[str]
    contact_words: ClassVar[str]
    middle: ClassVar[str]
    static_pressure: ClassVar[float]
    life: ClassVar[ElementLife]

    @abstractmethod
    def volume(self, geometry: ElementGeometry) -> Any:
        """Of one element [m^3]."""

    @abstractmethod
    def dynamic_rating(self, geometry: ElementGeometry) -> Any:
        """C_r by ISO 281 [N]."""

    @abstractmethod
    def static_rating(self, geometry: ElementGeometry) -> Any:
        """C_0r by ISO 76 [N]."""

    @abstractmethod
    def fatigue_limit(self, static_rating: Any, pitch: Any) -> Any:
        """C_u, simplified, by ISO 281, Annex B [N]."""

    @abstractmethod
    def ring_ratings(self, dynamic_rating: Any, geometry: ElementGeometry) -> tuple[Any, Any]:
        """Q_ci and Q_ce of an element at inner and outer ring by ISO 16281 [N]."""

    @abstractmethod
    def is_assumed(self, geometry: ElementGeometry) -> bool:
        """Whether the scene gives a stiffness, so that what its geometry leaves open is that of the standards."""

    @abstractmethod
    def contacts(self, geometry: ElementGeometry) -> tuple[RacewayContact, RacewayContact]:
        """Contacts with inner and outer ring."""
