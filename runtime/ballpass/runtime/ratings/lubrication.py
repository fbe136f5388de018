"""Viscosity of an oil by its grade, and contamination factor by cleanliness: what a drawing says of lubrication.

In: grade and temperature, cleanliness.  Out: kinematic viscosity [m²/s], e_C [1].

Sources: ISO 3448 (grades at 40 °C); ASTM D2270 for the viscosity at 100 °C of an oil of the viscosity index 95, as
usual for mineral oils; ASTM D341 between and beyond (Walther).  Classes of cleanliness: ISO 281:2007.  The formulas
over the code of ISO 4406 are those of ISO 281:2007, Annex A, as remembered: they were not compared with the printed
annex.
"""

from __future__ import annotations

import math

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.ratings.life import CONTAMINATION

#: Kinematic viscosity at 100 °C by grade, its viscosity at 40 °C; viscosity index 95 [mm²/s].
AT_100 = dict(
    zip(
        (10, 15, 22, 32, 46, 68, 100, 150, 220, 320, 460, 680, 1000, 1500),
        (2.64, 3.38, 4.25, 5.29, 6.65, 8.53, 11.07, 14.55, 18.75, 23.96, 30.35, 39.06, 49.86, 64.22),
        strict=True,
    )
)
#: Names of the grades in scene files.
GRADES = tuple(f"VG {grade}" for grade in AT_100)
#: 0 °C [K].
ZERO_CELSIUS = 273.15
#: Of e_C = min(a κ^0.68 D_pw^0.55, 1) (1 - b/D_pw^(1/3)), D_pw in mm, by filter and code of ISO 4406: a and b.
FILTERS = {
    "in line": {
        "-/13/10": (0.0864, 0.5663),
        "-/15/12": (0.0432, 0.9987),
        "-/17/14": (0.0288, 1.6329),
        "-/19/16": (0.0216, 2.3362),
    },
    "off line": {
        "-/13/10": (0.0864, 0.6796),
        "-/15/12": (0.0288, 1.141),
        "-/17/14": (0.0133, 1.67),
        "-/19/16": (0.00864, 2.5164),
        "-/21/18": (0.00411, 3.8974),
    },
}


def viscosity(grade: str, celsius: float) -> float:
    """Kinematic viscosity of a mineral oil [m²/s], by Walther's line through its viscosities at 40 and 100 °C.

    Parameters
    ----------
    grade : of `GRADES`
    celsius : temperature of the bearing [°C]

    Raises
    ------
    RequestError
        No such grade.
    """
    if grade not in GRADES:
        raise RequestError(f"There is no oil grade {grade!r}. Allowed: {', '.join(GRADES)}.")
    number = int(grade.removeprefix("VG "))

    def walther(value: float) -> float:
        return math.log10(math.log10(value + 0.7))

    cold, hot, here = (math.log10(ZERO_CELSIUS + t) for t in (40.0, 100.0, celsius))
    slope = (walther(number) - walther(AT_100[number])) / (hot - cold)
    return float(1e-6 * (10.0 ** (10.0 ** (walther(number) - slope * (here - cold))) - 0.7))


def contamination_of_class(cleanliness: str, pitch_diameter: float) -> float:
    """e_C of a class of cleanliness, the lower end of its range; D_pw in m."""
    small, large = CONTAMINATION[cleanliness]
    return (small if pitch_diameter < 0.1 else large)[0]


def contamination_of_code(code: str, where: str, viscosity_ratio: float, pitch_diameter: float) -> float:
    """e_C of a circulating oil by its code of ISO 4406 and its filter, of a bath as with a filter off line; D_pw in m.

    Raises
    ------
    RequestError
        ISO 281 has no factor for the code with this filter.
    """
    known = FILTERS[where]
    if code not in known:
        raise RequestError(f"No e_C for {code} with a filter {where}. Allowed: {', '.join(known)}.")
    diameter, (film, size) = 1e3 * pitch_diameter, known[code]
    share = min(film * viscosity_ratio**0.68 * diameter**0.55, 1.0)
    return float(max(share * (1.0 - size / diameter ** (1.0 / 3.0)), 0.0))
