"""Load ratings from geometry: C_0r of ISO 76, C_r of ISO 281, and the fatigue load limit C_u.

In: balls, ball diameter, pitch diameter, groove radii [m].  Out: ratings [N].  All are of one row of balls and of a
radial load.
"""

from __future__ import annotations

from typing import Any

from ballpass.runtime.ratings import ellipse
from ballpass.runtime.ratings.branches import interpolated, larger, smaller

#: Groove radius over ball diameter, inner and outer, of ISO 76, ISO 281 and ISO 16281.
REFERENCE_GROOVES = (0.52, 0.53)
#: Peak pressure at the heaviest ball that ISO 76 allows [Pa].
STATIC_PRESSURE = 4.2e9
#: ISO 281's factor for contemporary steel and manufacture, deep groove ball bearings.
MATERIAL_FACTOR = 1.3
#: Elastic constants of ISO/TR 10657: Young's modulus [Pa], Poisson's ratio.
STEEL = (207e9, 0.3)

#: γ = D_w/D_pw of the rows of both tables.
GAMMA = tuple(k / 100.0 for k in range(41))
#: f_0 of ISO 76:2006, Table 1, deep groove ball bearings [N/mm²].
STATIC_FACTORS = (
    *(14.7, 14.9, 15.1, 15.3, 15.5, 15.7, 15.9, 16.1, 16.3, 16.5, 16.4, 16.1, 15.9, 15.6, 15.4, 15.2, 14.9, 14.7),
    *(14.4, 14.2, 14.0, 13.7, 13.5, 13.2, 13.0, 12.8, 12.5, 12.3, 12.1, 11.8, 11.6, 11.4, 11.2, 10.9, 10.7, 10.5),
    *(10.3, 10.0, 9.8, 9.6, 9.4),
)
#: f_c of ISO 281:2007, Table 2, deep groove ball bearings, from γ = 0.01 on; without b_m [N/mm^1.8].
DYNAMIC_FACTORS = (
    *(29.1, 35.8, 40.3, 43.8, 46.7, 49.1, 51.1, 52.8, 54.3, 55.5, 56.6, 57.5, 58.2, 58.8, 59.3, 59.6, 59.8, 59.9),
    *(60.0, 59.9, 59.8, 59.6, 59.3, 59.0, 58.6, 58.2, 57.7, 57.1, 56.6, 56.0, 55.3, 54.6, 53.9, 53.2, 52.4, 51.7),
    *(50.9, 50.0, 49.2, 48.4),
)


def static_factor(gamma: Any, grooves: tuple[Any, Any] = REFERENCE_GROOVES, steel: tuple[Any, Any] = STEEL) -> Any:
    """f_0 from the exact contact of the ring that governs [N/mm²].

    The heaviest of Z balls carries 5/Z of the load (Stribeck), and its contact has 4200 MPa: ISO 76 with ISO/TR 10657.

    Parameters
    ----------
    gamma : D_w/D_pw [1]
    grooves : groove radius over ball diameter, inner and outer, above 0.5 [1]
    steel : Young's modulus [Pa] and Poisson's ratio [1] of rings and balls
    """
    loads = []
    for sign, groove in zip((1.0, -1.0), grooves, strict=True):
        ratio, curvature_sum = ellipse.groove_curvatures(1.0, (1.0 / gamma - sign) / (2.0 * sign), groove)
        kappa = ellipse.ellipticity(ratio)
        loads.append(ellipse.load_at_pressure(STATIC_PRESSURE, kappa, curvature_sum, ellipse.compliance(steel)))
    return smaller(*loads) / 5.0 * 1e-6


def static_rating(
    balls: Any, ball_diameter: Any, pitch_diameter: Any, grooves: Any = REFERENCE_GROOVES, cosine: Any = 1.0
) -> Any:
    """Basic static load rating C_0r = f_0 Z D_w² cos α [N], with f_0 of `static_factor`.  Source: ISO 76:2006."""
    factor = static_factor(cosine * ball_diameter / pitch_diameter, grooves)
    return cosine * factor * balls * (1e3 * ball_diameter) ** 2


def dynamic_factor(gamma: Any) -> Any:
    """f_c of ISO 281, Table 2, linear between its rows, for γ = D_w/D_pw from 0.01 to 0.4; b_m is not in it."""
    return interpolated(gamma, GAMMA[1:], DYNAMIC_FACTORS)


def ring_ratio(gamma: Any, grooves: tuple[Any, Any] = REFERENCE_GROOVES, factor: float = 1.044) -> Any:
    """T, ratio of the capacities of the inner and the outer contact; ISO 16281:2008 [1]."""
    inner, outer = grooves
    conformity = (inner / outer) * (2.0 * outer - 1.0) / (2.0 * inner - 1.0)
    return factor * ((1.0 - gamma) / (1.0 + gamma)) ** 1.72 * conformity**0.41


def groove_effect(gamma: Any, grooves: tuple[Any, Any]) -> Any:
    """f_c of other groove radii over f_c of the reference ones, by the formula behind the table [1].

    f_c is proportional to (2 r_i/(2 r_i - D_w))^0.41 (1 + T^(10/3))^-0.3, with 1.04 in T: ISO/TR 1281-1:2008 (Lundberg
    and Palmgren 1947).  The table is this formula for 0.52 in both rings, and ISO 281 lets it stand for outer grooves
    up to 0.53; so it does here.  ISO 281 does not credit radii below the reference; this number does.
    """
    result = []
    for inner, outer in (grooves, REFERENCE_GROOVES):
        ratio = ring_ratio(gamma, (inner, outer), 1.04)
        result.append((2.0 * inner / (2.0 * inner - 1.0)) ** 0.41 * (1.0 + ratio ** (10.0 / 3.0)) ** -0.3)
    return result[0] / result[1]


def dynamic_rating(
    balls: Any,
    ball_diameter: Any,
    pitch_diameter: Any,
    grooves: tuple[Any, Any] = REFERENCE_GROOVES,
    material_factor: Any = MATERIAL_FACTOR,
    cosine: Any = 1.0,
) -> Any:
    """Basic dynamic load rating C_r [N].

    b_m f_c (cos α)^0.7 Z^(2/3) D_w^1.8, and 3.647 D_w^1.4 for D_w^1.8 above 25.4 mm, where the two meet; times
    `groove_effect`.  Source: ISO 281:2007.

    Parameters
    ----------
    balls : Z
    ball_diameter, pitch_diameter : D_w, D_pw [m]
    grooves : groove radius over ball diameter, inner and outer [1]
    material_factor : b_m [1]
    cosine : of the nominal contact angle [1]
    """
    gamma, diameter = cosine * ball_diameter / pitch_diameter, 1e3 * ball_diameter
    factor = material_factor * dynamic_factor(gamma) * groove_effect(gamma, grooves)
    return cosine**0.7 * factor * balls ** (2.0 / 3.0) * smaller(diameter**1.8, 3.647 * diameter**1.4)


def fatigue_limit(static_rating: Any, pitch_diameter: Any) -> Any:
    """Fatigue load limit C_u [N], simplified: C_0r/22, less for pitch diameters above 100 mm; ISO 281:2007, Annex B.

    Limits of catalogues come from the stress at the contacts and differ: give them where they are known.
    """
    return static_rating / 22.0 * (0.1 / larger(pitch_diameter, 0.1)) ** 0.5
