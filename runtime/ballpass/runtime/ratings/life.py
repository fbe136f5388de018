"""Rating lives: L_10 and L_nmr of ISO 281, L_10r of ISO 16281, and mean loads.

In: ratings and loads [N].  Out: lives [turns], 10 % failed.  Loads of balls come as sequences, one entry for each ball
or each place of a raceway.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.ratings.branches import larger, smaller
from ballpass.runtime.ratings.load_ratings import REFERENCE_GROOVES, ring_ratio

MILLION = 1e6
#: a_ISO is at most this; where its bracket is smaller, the formula has no value.
MOST_MODIFIED = 50.0
#: Viscosity ratios that a_ISO covers: below it is refused, above it is taken as the upper one.
VISCOSITY_RATIOS = (0.1, 4.0)
#: Exponents of the mean over the loads of balls: where the ring turns against the load, and where it stands.
TURNING, STANDING = 3.0, 10.0 / 3.0
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


def basic_life(dynamic_rating: Any, load: Any) -> Any:
    """L_10 = (C/P)³ [turns]; ISO 281:2007."""
    return MILLION * (dynamic_rating / load) ** 3


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


def life_factor(viscosity_ratio: Any, contaminated_limit: Any) -> Any:
    """a_ISO of radial ball bearings [1]; ISO 281:2007.

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
    fall = smaller(2.2649 * kappa**-0.054381, larger(1.9987 * kappa**-0.19087, 1.9987 * kappa**-0.071739))
    bracket = 1.0 - (2.5671 - fall) ** 0.83 * contaminated_limit ** (1.0 / 3.0)
    return 0.1 * larger(bracket, (MOST_MODIFIED / 0.1) ** (-1.0 / 9.3)) ** -9.3


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
    if reliability not in RELIABILITY:
        known = ", ".join(f"{share:g}" for share in RELIABILITY)
        raise RequestError(f"No a_1 is tabulated for the reliability {reliability:g}. Allowed: {known}.")
    return RELIABILITY[reliability] * factor * life


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
    ratio = ring_ratio(gamma, grooves) ** (10.0 / 3.0)
    return (
        dynamic_rating / (0.407 * balls) * (1.0 + ratio) ** 0.3,
        dynamic_rating / (0.389 * balls) * (1.0 + 1.0 / ratio) ** 0.3,
    )


def mean_load(loads: Sequence[Any], exponent: float, shares: Sequence[Any] | None = None) -> Any:
    """(Σ U_k Q_k^w)^(1/w) [N], equal shares where none are given; the shares sum to one."""
    if shares is None:
        return (sum(load**exponent for load in loads) / len(loads)) ** (1.0 / exponent)
    return sum(share * load**exponent for share, load in zip(shares, loads, strict=True)) ** (1.0 / exponent)


def equivalent_ball_load(loads: Sequence[Any], *, turning: bool) -> Any:
    """Q_e of a ring [N]; ISO 16281:2008.

    Parameters
    ----------
    loads : of the balls [N]; the first axis of an array
    turning : whether the ring turns against the load, as the inner ring under a load that stands
    """
    return mean_load(loads, TURNING if turning else STANDING)


def sector_ball_load(cubes: Sequence[Any]) -> Any:
    """Q_e of a ring whose places bear different loads [N].

    A place of the raceway adds up damage by the cube of the loads that pass it, the places together fail by Weibull's
    law: {mean over places of ⟨Q³⟩^(10/9)}^(3/10).  It is the cubic mean where all places bear the same, and the mean of
    exponent 10/3 where each place bears one load: `equivalent_ball_load`.

    Parameters
    ----------
    cubes : ⟨Q³⟩, mean over the passes at each of equal sectors, in the ring's own coordinates [N³]
    """
    return mean_load([cube ** (1.0 / 3.0) for cube in cubes], STANDING)


def reference_life(ratings: tuple[Any, Any], equivalent_loads: tuple[Any, Any]) -> Any:
    """L_10r of both rings [turns], from Q_ci, Q_ce and Q_ei, Q_ee [N]; ISO 16281:2008."""
    rings = zip(ratings, equivalent_loads, strict=True)
    return MILLION * sum((load / rating) ** (10.0 / 3.0) for rating, load in rings) ** -0.9


def equivalent_load(dynamic_rating: Any, life: Any) -> Any:
    """Load of constant size whose L_10 is this life [N]; ISO 16281:2008."""
    return dynamic_rating * (MILLION / life) ** (1.0 / 3.0)


def miner(shares: Iterable[Any], lives: Iterable[Any]) -> Any:
    """Life 1/Σ(U_k/L_k) of a duty cycle, U_k the shares of its turns; Palmgren 1924, Miner 1945."""
    return 1.0 / sum(share / life for share, life in zip(shares, lives, strict=True))
