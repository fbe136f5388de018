"""Rating lives: L_10 and L_nmr of ISO 281, L_10r of ISO 16281, and mean loads.

In: ratings and loads [N].  Out: lives [turns], 10 % failed.  Loads of balls come as sequences, one entry for each ball
or each place of a raceway.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.ratings.branches import larger, smaller
from ballpass.runtime.ratings.load_ratings import REFERENCE_GROOVES, ring_ratio

MILLION, KILO = 1e6, 1e3
#: a_ISO is at most this; where its bracket is smaller, the formula has no value.
MOST_MODIFIED = 50.0
#: Viscosity ratios that a_ISO covers: below it is refused, above it is taken as the upper one.
VISCOSITY_RATIOS = (0.1, 4.0)
#: a_1 by reliability; ISO 281:2007.
RELIABILITY = {0.90: 1.0, 0.95: 0.64, 0.96: 0.55, 0.97: 0.47, 0.98: 0.37, 0.99: 0.25}
#: Contamination factor e_C by cleanliness: lowest and highest, D_pw below 100 mm, and from there on; ISO 281:2007
#: (the formulas of its Annex A, which give one number, are not here).
CONTAMINATION = {
    "extreme cleanliness": ((1.0, 1.0), (1.0, 1.0)),
    "high cleanliness": ((0.6, 0.8), (0.8, 0.9)),
    "normal cleanliness": ((0.5, 0.6), (0.6, 0.8)),
    "slight contamination": ((0.3, 0.5), (0.4, 0.6)),
    "typical contamination": ((0.1, 0.3), (0.2, 0.4)),
    "severe contamination": ((0.0, 0.1), (0.0, 0.1)),
    "very severe contamination": ((0.0, 0.0), (0.0, 0.0)),
}

#: F_a/(Z D_w²) [N/mm²] and e of deep groove ball bearings; ISO 281:2007, Table 3.
AXIAL_LIMITS = (
    (0.172, 0.345, 0.689, 1.03, 1.38, 2.07, 3.45, 5.17, 6.89),
    (0.19, 0.22, 0.26, 0.28, 0.30, 0.34, 0.38, 0.42, 0.44),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class LifeFactor:
    """Numbers in a_ISO of a kind of element, see `life_factor`; `falls` are those of its three branches over κ."""

    most: float
    falls: tuple[float, float, float]
    power: float
    limit_power: Fraction
    exponent: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ElementLife:
    """How the life of a kind of rolling element depends on its load.

    Attributes
    ----------
    basic : exponent of L_10 over C/P
    turning : exponent of the load of an element where the ring turns against the load
    weibull : slope of the scatter of lives (Weibull's)
    factor : of lubricant and dirt
    """

    basic: Fraction
    turning: Fraction
    weibull: Fraction
    factor: LifeFactor

    @property
    def standing(self) -> Fraction:
        """Exponent where the ring stands: its places fail together, by Weibull's law."""
        return self.turning * self.weibull


#: ISO 281:2007 and ISO 16281:2008, radial ball bearings.
BALLS = ElementLife(
    basic=Fraction(3),
    turning=Fraction(3),
    weibull=Fraction(10, 9),
    factor=LifeFactor(
        most=2.5671, falls=(2.2649, 1.9987, 1.9987), power=0.83, limit_power=Fraction(1, 3), exponent=9.3
    ),
)


def basic_life(dynamic_rating: Any, load: Any, of: ElementLife = BALLS) -> Any:
    """L_10 = (C/P)³ of balls, (C/P)^(10/3) of rollers [turns]; ISO 281:2007."""
    return MILLION * (dynamic_rating / load) ** float(of.basic)


def axial_factors(angle: float, *, deep_groove: bool) -> tuple[float, float, float]:
    """X, Y and e of a single-row radial ball bearing: P = X F_r + Y F_a where F_a/F_r exceeds e, else F_r.

    X = 1 - 0.4 ξ/η, Y = 0.4 cot α/η, e = ξ tan α, which Table 3 of ISO 281:2007 is made of (ISO/TR 1281-1:2008, 7.2).
    The table has them over the load or the nominal angle, and takes the angle from it; here it is that of the scene.

    Parameters
    ----------
    angle : contact angle in operation, above zero [rad]
    deep_groove : whether the bearing has no contact angle of its own; else one of angular contact
    """
    if deep_groove:
        test, reduction = 1.05, 1.0 - 0.4 * np.sin(np.radians(5.0))
    else:
        test, reduction = 1.25, 1.0 - (0.4 if angle < np.radians(17.5) else 1.0 / 2.75) * np.sin(angle)
    return 1.0 - 0.4 * test / reduction, float(0.4 / (np.tan(angle) * reduction)), float(test * np.tan(angle))


def table_angle(axial: float, balls: int, ball_diameter: float) -> float:
    """Contact angle of which the e of the table of ISO 281 is, linear between its rows, constant beyond [rad].

    Parameters
    ----------
    axial : F_a [N]
    ball_diameter : D_w [m]
    """
    return float(np.arctan(np.interp(axial / (balls * (KILO * ball_diameter) ** 2), *AXIAL_LIMITS) / 1.05))


def combined_load(radial: Any, axial: Any, angle: float, *, deep_groove: bool) -> Any:
    """P of a radial and an axial load [N]; ISO 281:2007, see `axial_factors`."""
    if angle == 0.0:
        return radial
    x, y, e = axial_factors(angle, deep_groove=deep_groove)
    return np.where(axial > e * radial, x * radial + y * axial, radial)


def hours(turns: Any, speed: Any) -> Any:
    """Hours of a number of turns at a speed [rad/s]."""
    return turns * 2.0 * np.pi / speed / 3600.0


def static_safety(static_rating: Any, load: Any) -> Any:
    """s_0 = C_0/P_0 [1]; ISO 76:2006."""
    return static_rating / load


def reference_viscosity(speed: float, pitch_diameter: float) -> float:
    """Viscosity ν_1 that just separates the surfaces [m²/s]; ISO 281:2007.

    The two branches of the standard do not meet: at 1000 rpm the upper one is 2 % lower.

    Parameters
    ----------
    speed : of the rings to each other [rad/s]
    pitch_diameter : D_pw [m]
    """
    rpm, diameter = abs(speed) * 30.0 / np.pi, 1e3 * pitch_diameter
    power = 45000.0 * rpm**-0.83 if rpm < 1000.0 else 4500.0 * rpm**-0.5
    return float(1e-6 * power * diameter**-0.5)


def viscosity_ratio(viscosity: float, speed: float, pitch_diameter: float) -> float:
    """κ = ν/ν_1 [1], the lubricant's kinematic viscosity at the bearing's temperature [m²/s] over what is needed."""
    return viscosity / reference_viscosity(speed, pitch_diameter)


def life_factor(viscosity_ratio: Any, contaminated_limit: Any, of: LifeFactor = BALLS.factor) -> Any:
    """a_ISO of radial bearings [1]; ISO 281:2007.

    Parameters
    ----------
    viscosity_ratio : κ, from 0.1; above 4 as 4
    contaminated_limit : e_C C_u/P

    Raises
    ------
    RequestError
        κ below 0.1, for which ISO 281 has no factor.
    """
    least, most = VISCOSITY_RATIOS
    if isinstance(viscosity_ratio, float | int | np.ndarray) and not np.all(np.asarray(viscosity_ratio) >= least):
        raise RequestError(
            f"The viscosity ratio {np.min(viscosity_ratio):.3g} is below {least}: ISO 281 has no life factor for so "
            f"thin a film. Allowed: {least} and above. Take a thicker lubricant, or judge by the basic life alone."
        )
    kappa = smaller(viscosity_ratio, most)
    # three branches that meet at 0.4 and 1; each is the one wanted where it is between the two others
    thin, middle, thick = of.falls
    fall = smaller(thin * kappa**-0.054381, larger(middle * kappa**-0.19087, thick * kappa**-0.071739))
    bracket = 1.0 - (of.most - fall) ** of.power * contaminated_limit ** float(of.limit_power)
    return 0.1 * larger(bracket, (MOST_MODIFIED / 0.1) ** (-1.0 / of.exponent)) ** -of.exponent


def modified_life(life: Any, factor: Any, reliability: float = 0.90) -> Any:
    """a_1 a_ISO L [turns]: L_nm of a basic life (ISO 281:2007), L_nmr of a reference life (ISO 16281:2008).

    Parameters
    ----------
    factor : a_ISO, see `life_factor`
    reliability : one of `RELIABILITY`

    Raises
    ------
    RequestError
        A reliability that is not in the table.
    """
    return RELIABILITY[of_table(reliability)] * factor * life


def of_table(reliability: float) -> float:
    """The reliability of the table of a_1 that is meant [1].

    Raises
    ------
    RequestError
        It is none of them.
    """
    for share in RELIABILITY:
        if abs(share - reliability) < 1e-9:
            return share
    known = ", ".join(f"{share:g}" for share in RELIABILITY)
    raise RequestError(f"No a_1 is tabulated for the reliability {reliability:g}. Allowed: {known}.")


def ball_ratings(
    dynamic_rating: Any, balls: Any, gamma: Any, grooves: tuple[Any, Any] = REFERENCE_GROOVES
) -> tuple[Any, Any]:
    """Q_ci and Q_ce, loads of a ball for a life of a million turns of inner and outer ring [N]; ISO 16281:2008.

    Parameters
    ----------
    dynamic_rating : C_r [N]
    balls : Z
    gamma : D_w/D_pw [1]
    grooves : groove radius over ball diameter, inner and outer [1]
    """
    ratio, power = ring_ratio(gamma, grooves) ** float(BALLS.standing), float(1 / BALLS.standing)
    return (
        dynamic_rating / (0.407 * balls) * (1.0 + ratio) ** power,
        dynamic_rating / (0.389 * balls) * (1.0 + 1.0 / ratio) ** power,
    )


def mean_load(loads: Sequence[Any], exponent: float, shares: Sequence[Any] | None = None) -> Any:
    """(Σ U_k Q_k^w)^(1/w) [N], equal shares where none are given; the shares sum to one."""
    if shares is None:
        return (sum(load**exponent for load in loads) / len(loads)) ** (1.0 / exponent)
    return sum(share * load**exponent for share, load in zip(shares, loads, strict=True)) ** (1.0 / exponent)


def equivalent_ball_load(loads: Sequence[Any], *, turning: bool, of: ElementLife = BALLS) -> Any:
    """Q_e of a ring [N]; ISO 16281:2008.

    Parameters
    ----------
    loads : of the balls [N]; the first axis of an array
    turning : whether the ring turns against the load, as the inner ring under a load that stands
    """
    return mean_load(loads, float(of.turning if turning else of.standing))


def sector_ball_load(powers: Sequence[Any], of: ElementLife = BALLS) -> Any:
    """Q_e of a ring whose places bear different loads [N].

    A place of the raceway adds up damage by a power of the loads that pass it, of balls the third, and the places
    together fail by Weibull's law: of balls {mean over places of ⟨Q³⟩^(10/9)}^(3/10).  It is the mean of a turning ring
    where all places bear the same, and that of a standing one where each place bears one load: `equivalent_ball_load`.

    Parameters
    ----------
    powers : ⟨Q³⟩ (of rollers ⟨Q⁴⟩), mean over the passes at each of equal sectors, in the ring's own coordinates
    """
    return mean_load([power ** float(1 / of.turning) for power in powers], float(of.standing))


def reference_life(ratings: tuple[Any, Any], equivalent_loads: tuple[Any, Any], of: ElementLife = BALLS) -> Any:
    """L_10r of both rings [turns], from Q_ci, Q_ce and Q_ei, Q_ee [N]; ISO 16281:2008."""
    rings = zip(ratings, equivalent_loads, strict=True)
    return MILLION * sum((load / rating) ** float(of.standing) for rating, load in rings) ** -float(1 / of.weibull)


def raceway_loads(powers: Any, of: ElementLife = BALLS) -> tuple[Any, Any]:
    """Q_ei and Q_ee [N], see `sector_ball_load`.

    Parameters
    ----------
    powers : mean powers of the loads, in kN, that pass each place of the outer, then of the inner raceway, shape
        (..., 2, places)
    """
    outer, inner = (KILO * sector_ball_load(np.moveaxis(powers[..., ring, :], -1, 0), of) for ring in (0, 1))
    return np.asarray(inner), np.asarray(outer)  # arrays: a number of Python's that is zero has no reciprocal


def raceway_life(ratings: tuple[Any, Any], powers: Any, of: ElementLife = BALLS) -> Any:
    """L_10r [turns] of such powers, infinite without a load; `ratings` are Q_ci and Q_ce [N]."""
    with np.errstate(divide="ignore"):
        return reference_life(ratings, raceway_loads(powers, of), of)


def equivalent_load(dynamic_rating: Any, life: Any, of: ElementLife = BALLS) -> Any:
    """Load of constant size whose L_10 is this life [N]; ISO 16281:2008."""
    return dynamic_rating * (MILLION / life) ** float(1 / of.basic)
