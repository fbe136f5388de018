"""What ratings and lives of a bearing need and its equations do not, as frozen records in SI units; see `records`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from ballpass.derive.scene.keys import ChoiceKey, Needs
from ballpass.derive.scene.quantity import Bounds
from ballpass.derive.scene.read_keys import Either, not_negative, positive, quantity
from ballpass.runtime.ratings.life import CONTAMINATION
from ballpass.runtime.ratings.lubrication import FILTERS, GRADES


def _rating(symbol: str) -> Any:
    return positive(
        "N",
        f"The manufacturer's ${symbol}$",
        example="13.5 kN",
        optional=True,
        setting=True,
        remedy="delete the key for the value that follows from the geometry",
        note="instead of the one computed from the geometry",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Catalogue:
    """Catalogue data of a bearing, for its ratings; the derived equations do not depend on them.

    `designation` and `clearance_group` are empty where the scene names none; `clearance_range` is that of the group
    [m] in operation, after `mounting_loss` [m].  Ratings and fatigue load limit [N] are None where the scene does not
    give them.
    """

    designation: str
    clearance_group: str
    clearance_range: tuple[float, float] | None
    dynamic_rating: float | None = _rating("C")
    static_rating: float | None = _rating("C_0")
    fatigue_limit: float | None = _rating("C_u")
    mounting_loss: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Lubrication:
    """Lubricant film and contamination, for the life factor of ISO 281; the derived equations do not depend on it.

    Of `viscosity_ratio` [1], kinematic `viscosity` at the bearing's temperature [m^2/s], and grade of the oil with
    temperature [°C] one is given, and of `contamination`, e_C [1], a class of `cleanliness`, and the code of the oil.
    """

    one_of: ClassVar[tuple[Either, ...]] = (
        Either(what="the film", groups=(("viscosity_ratio",), ("viscosity",), ("oil_grade", "temperature_celsius"))),
        Either(what="the contamination", groups=(("contamination",), ("cleanliness",), ("oil_code",))),
    )

    viscosity_ratio: float | None = quantity(
        "1",
        "Viscosity ratio κ",
        example=1.2,
        setting=True,
        bounds=Bounds(least=0.1),  # ISO 281 has no life factor for a thinner film
        remedy="take a thicker lubricant, or delete the table and judge by the life without it",
    )
    viscosity: float | None = positive(
        "m^2/s",
        "Kinematic viscosity at the bearing's temperature",
        example="32 mm^2/s",
        setting=True,
        remedy="give that of the oil at the bearing's temperature",
        note="κ follows at each speed",
    )
    oil_grade: str | None = ChoiceKey(
        words="Viscosity grade of the oil, ISO 3448", choices=GRADES, note="mineral oil, viscosity index 95"
    ).declared()
    temperature_celsius: float | None = quantity(
        "1",
        "Temperature of the bearing in degrees Celsius",
        example=70,
        setting=True,
        bounds=Bounds(least=-20.0, most=150.0),
        remedy="give the temperature in degrees Celsius, as a plain number",
        note="a plain number: scenes have no units with an offset",
    )
    contamination: float | None = quantity(
        "1",
        "Contamination factor $e_C$ of ISO 281",
        example=0.5,
        setting=True,
        bounds=Bounds(least=0.0, most=1.0),
        remedy="write contamination = 0.5 where cleanliness is normal",
        note="1 is clean; classes in {doc}`../../theory/life`",
    )
    cleanliness: str | None = ChoiceKey(
        words="Class of cleanliness of ISO 281",
        choices=tuple(CONTAMINATION),
        note="$e_C$ is the lower end of its range",
    ).declared()
    oil_code: str | None = ChoiceKey(
        words="Cleanliness code of a circulating oil or a bath, ISO 4406",
        choices=tuple(FILTERS["off line"]),
        note="$e_C$ follows with `filter`, κ and pitch diameter",
    ).declared()
    filter: str | None = ChoiceKey(
        words="Where the oil is filtered",
        choices=tuple(FILTERS),
        optional=True,
        needs=(
            Needs(
                key="oil_code",
                why="a filter belongs to the code of an oil",
                remedy="delete the key, or give oil_code instead of the contamination",
            ),
        ),
        note='default `"off line"`, also for a bath',
    ).declared()


@dataclass(frozen=True, slots=True, kw_only=True)
class Alignment:
    """Tilt of the rings by misalignment [rad] and bending of the shaft [m], for a hand formula beside the life."""

    one_of: ClassVar[tuple[Either, ...]] = (Either(groups=(("span", "shaft_diameter"),), optional=True),)

    misalignment: float | None = not_negative(
        "rad",
        "Angle between the axes of shaft and housing at the bearing",
        example="2 arcmin",
        setting=True,
        optional=True,
    )
    span: float | None = positive(
        "m",
        "Distance of the two bearings of the shaft, its load in the middle",
        example="200 mm",
        setting=True,
    )
    shaft_diameter: float | None = positive(
        "m",
        "Diameter of the shaft, round and of steel",
        example="20 mm",
        setting=True,
    )
