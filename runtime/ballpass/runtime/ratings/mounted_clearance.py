"""Reduction of the clearance of a bearing by mounting and temperature: thick rings by Lamé.

In: interferences, diameters, temperatures.  Out: reductions of the diametral clearance [m].
Source: Harris & Kotzalas, Essential Concepts of Bearing Technology, 5th ed., 2006.
"""

from __future__ import annotations

import math
from typing import Any

#: Young's modulus [Pa] and Poisson's ratio of bearing steel, and its thermal expansion [1/K].
STEEL = (207e9, 0.3)
EXPANSION = 11.5e-6


def inner_growth(
    interference: Any,
    bore: Any,
    raceway_diameter: Any,
    *,
    shaft_bore: Any = 0.0,
    shaft: tuple[Any, Any] = STEEL,
    ring: tuple[Any, Any] = STEEL,
) -> Any:
    """Growth of the inner raceway's diameter by the interference on the shaft [m].

    Parameters
    ----------
    interference : of the diameters, as it acts [m]
    bore, raceway_diameter : of the inner ring [m]
    shaft_bore : of a hollow shaft [m]
    shaft, ring : Young's modulus [Pa] and Poisson's ratio [1]
    """
    inside = _sum_over_difference(bore, shaft_bore) - shaft[1]
    outside = _sum_over_difference(raceway_diameter, bore) + ring[1]
    pressure = interference / bore / (inside / shaft[0] + outside / ring[0])
    return raceway_diameter * pressure / ring[0] * 2.0 * bore**2 / (raceway_diameter**2 - bore**2)


def outer_shrinkage(
    interference: Any,
    outside: Any,
    raceway_diameter: Any,
    *,
    housing_outside: Any = math.inf,
    housing: tuple[Any, Any] = STEEL,
    ring: tuple[Any, Any] = STEEL,
) -> Any:
    """Shrinkage of the outer raceway's diameter by the interference in the housing [m].

    Parameters
    ----------
    interference : of the diameters, as it acts [m]
    outside, raceway_diameter : of the outer ring [m]
    housing_outside : diameter of a housing that is a ring [m]; infinite for a thick one
    housing, ring : Young's modulus [Pa] and Poisson's ratio [1]
    """
    around = _sum_over_difference(1.0, outside / housing_outside) + housing[1]
    within = _sum_over_difference(outside, raceway_diameter) - ring[1]
    pressure = interference / outside / (around / housing[0] + within / ring[0])
    return raceway_diameter * pressure / ring[0] * 2.0 * outside**2 / (outside**2 - raceway_diameter**2)


def thermal_reduction(
    inner_rise: Any,
    ball_rise: Any,
    outer_rise: Any,
    ball_diameter: Any,
    pitch_diameter: Any,
    expansion: Any = EXPANSION,
) -> Any:
    """Diametral clearance that a warmer inner ring takes; negative where the outer ring is the warmer one [m].

    Parameters
    ----------
    inner_rise, ball_rise, outer_rise : of the temperatures, from where the clearance was measured [K]
    ball_diameter, pitch_diameter : [m]
    expansion : of the steel [1/K]
    """
    inner, outer = pitch_diameter - ball_diameter, pitch_diameter + ball_diameter
    return expansion * (inner * inner_rise + 2.0 * ball_diameter * ball_rise - outer * outer_rise)


def _sum_over_difference(large: Any, small: Any) -> Any:
    return (large**2 + small**2) / (large**2 - small**2)
