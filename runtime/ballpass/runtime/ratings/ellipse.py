"""Contact of a ball and a groove by Hertz: ellipse, peak pressure, and the load of a pressure.

In: curvatures, elastic constants, load.  Out: semi-axes and pressures.  A model's own constants hold ellipticity and
curvature sum of its bearings (``inner_ellipticity``, ``inner_curvature_sum``); the functions here are for
other geometry, such as that of ISO 76.

Source: Harris & Kotzalas, Essential Concepts of Bearing Technology, 5th ed., 2006, chapter 6.
"""

from __future__ import annotations

import math
from typing import Any

#: Steps of the arithmetic-geometric mean and of Newton's method: both double the digits at each; enough for a/b < 1000.
AGM_STEPS = 7
NEWTON_STEPS = 5


def elliptic_integrals(ellipticity: Any) -> tuple[Any, Any]:
    """E(m) of the second kind, and (K(m) - E(m))/E(m) without cancellation, for m = 1 - 1/ellipticity²."""
    a, b = 1.0, 1.0 / ellipticity
    difference = (1.0 - b * b) / 2.0  # sum of 2^(n-1) c_n²: (K - E)/K
    for step in range(AGM_STEPS):
        c = (a - b) / 2.0
        a, b = (a + b) / 2.0, (a * b) ** 0.5
        difference = difference + 2.0**step * c * c
    return math.pi / (2.0 * a) * (1.0 - difference), difference / (1.0 - difference)


def ellipticity(ratio: Any) -> Any:
    """Ratio a/b of the semi-axes of the contact ellipse.

    Parameters
    ----------
    ratio : A/B of the sums of both bodies' curvatures across and along the groove, in (0, 1) [1]
    """
    target = ratio / (1.0 + ratio)  # (K - E)/((κ² - 1) E) = A/(A + B): Harris, Eq. 6.26
    kappa = ratio**-0.636  # Brewe and Hamrock 1977, doi:10.1115/1.3453245, to 3 %
    for _ in range(NEWTON_STEPS):
        m = 1.0 - kappa**-2
        _, excess = elliptic_integrals(kappa)
        left = excess / (kappa * kappa - 1.0) / target
        slope = 1.0 / excess - 2.0 / m + excess * (1.0 - m) / m  # d ln(left)/d ln(κ)
        kappa = kappa * (1.0 - (left - 1.0) / (left * slope))
    return kappa


def groove_curvatures(ball_diameter: Any, raceway_radius: Any, groove_radius: Any) -> tuple[Any, Any]:
    """Ratio A/B of the curvature sums [1], and A + B [1/m]; the raceway's radius is negative for an outer ring [m]."""
    across = 2.0 / ball_diameter - 1.0 / groove_radius
    along = 2.0 / ball_diameter + 1.0 / raceway_radius
    return across / along, across + along


def compliance(ring: tuple[Any, Any], ball: tuple[Any, Any] | None = None) -> Any:
    """(1 - ν²)/E of ring and ball together [1/Pa], from Young's modulus [Pa] and Poisson's ratio [1] of each."""
    return sum((1.0 - poisson**2) / young for young, poisson in (ring, ring if ball is None else ball))


def semi_axes(load: Any, ellipticity: Any, curvature_sum: Any, compliance: Any) -> tuple[Any, Any]:
    """Semi-axes of the contact ellipse, across the groove and along it [m].

    Parameters
    ----------
    load : of the ball [N]
    ellipticity : a/b [1]
    curvature_sum : A + B [1/m]
    compliance : of both bodies, see `compliance` [1/Pa]
    """
    second, _ = elliptic_integrals(ellipticity)
    along = (3.0 * second * load * compliance / (math.pi * ellipticity * curvature_sum)) ** (1.0 / 3.0)
    return ellipticity * along, along


def peak_pressure(load: Any, ellipticity: Any, curvature_sum: Any, compliance: Any) -> Any:
    """Pressure in the middle of the contact, 3 Q/(2 π a b) [Pa]; see `semi_axes`."""
    return (load / load_at_pressure(1.0, ellipticity, curvature_sum, compliance)) ** (1.0 / 3.0)


def load_at_pressure(pressure: Any, ellipticity: Any, curvature_sum: Any, compliance: Any) -> Any:
    """Load of a ball whose contact has this peak pressure [N]; see `semi_axes`."""
    second, _ = elliptic_integrals(ellipticity)
    return 8.0 * math.pi * ellipticity * (second * compliance / curvature_sum) ** 2 * pressure**3 / 3.0
