"""Hertz point contact between ball and raceway: the load-deflection factor from geometry.

In: radii and elastic constants as SymPy expressions.  Out: k in Q = k * delta^1.5, half axes of the contact ellipse and
peak pressure, exact (elliptic integrals), as expressions.

The ellipticity kappa = a/b solves one transcendental equation (Harris & Kotzalas, Essential Concepts of Bearing
Technology,
5th ed., 2006, Eqs. 6.26, 6.40; Brewe & Hamrock 1977, doi:10.1115/1.3453245).  It enters as the SymPy function
`ellipticity`, which evaluates by
mpmath's root finder, and which `lower.py` turns into an unrolled Newton iteration on arithmetic-geometric means: two
routes to one number, and derivatives pass through the second.
"""

from __future__ import annotations

from typing import Any

import mpmath
import sympy as sp


class ellipticity(sp.Function):  # type: ignore[misc]  # SymPy has no types
    # the name prints as in formulas
    """Ratio kappa = a/b >= 1 of the semi-axes of the contact ellipse, given ``ratio = A/B`` in (0, 1).

    A and B are the sums of the curvatures of both bodies in the two principal planes, A the smaller (for a ball in
    a groove: the plane across the groove).  kappa solves, with K and E of parameter m = 1 - 1/kappa^2,

        (K - E) / ((kappa^2 - 1) E) = A / (A + B)

    which is Harris' equation for F(rho) = (B - A)/(A + B), subtracted from one and halved: no cancellation for
    close conformity.
    """

    nargs = (1,)

    def _eval_evalf(self, prec: int) -> Any:
        (ratio,) = self.args
        if not ratio.is_number:
            return None
        with mpmath.workprec(prec + 20):
            value = mpmath.mpf(ratio._to_mpmath(prec + 20))
            target = mpmath.log(value / (1 + value))

            def residual(log_kappa: Any) -> Any:
                m = 1 - mpmath.exp(-2 * log_kappa)
                k, e = mpmath.ellipk(m), mpmath.ellipe(m)
                return mpmath.log((k - e) / (mpmath.expm1(2 * log_kappa) * e)) - target

            guess = mpmath.mpf("0.636") * mpmath.log(1 / value)
            root = mpmath.exp(mpmath.findroot(residual, guess))
        return sp.Float._new(root._mpf_, prec)

    def fdiff(self, argindex: int = 1) -> Any:
        """Implicit derivative; d ln(kappa) of the left side is `slope` below."""
        (ratio,) = self.args
        m = 1 - self**-2
        k, e = sp.elliptic_k(m), sp.elliptic_e(m)
        slope = e / (k - e) - 2 / m + (k - e) * (1 - m) / (e * m)
        return self / (slope * ratio * (1 + ratio))


def deflection_factor(kappa: sp.Expr) -> sp.Expr:
    """Dimensionless deflection delta* of the contact ellipse (Harris & Kotzalas 2006, Eq. 6.31)."""
    m = 1 - kappa**-2
    return 2 * sp.elliptic_k(m) / sp.pi * sp.cbrt(sp.pi / (2 * kappa**2 * sp.elliptic_e(m)))


def curvature_ratio(ball_diameter: sp.Expr, raceway_radius: sp.Expr, groove_radius: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """Ratio A/B of the principal curvature sums, and the curvature sum A + B [1/m].

    `raceway_radius` is that of the groove's bottom in the plane of rolling, positive where it is convex towards the
    ball (inner
    ring) and negative where concave (outer ring); `groove_radius` that of the groove's cross section, positive.
    """
    across = 2 / ball_diameter - 1 / groove_radius
    along = 2 / ball_diameter + 1 / raceway_radius
    return across / along, across + along


def contact_stiffness(*, kappa: sp.Expr, curvature_sum: sp.Expr, compliance: sp.Expr) -> sp.Expr:
    """Load-deflection factor of one contact, k = Q / delta^1.5 [N/m^1.5].

    `compliance` is (1 - nu1^2)/E1 + (1 - nu2^2)/E2 [1/Pa]; from Harris & Kotzalas 2006, Eq. 6.39,
    delta = delta* (3 Q compliance / (2 (A + B)))^(2/3) (A + B)/2.
    """
    return (
        sp.Rational(4, 3)
        * sp.sqrt(2)
        / (compliance * sp.sqrt(curvature_sum) * deflection_factor(kappa) ** sp.Rational(3, 2))
    )


def half_axes(*, kappa: sp.Expr, curvature_sum: sp.Expr, compliance: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """Half axes a >= b of the contact ellipse over the cube root of the force [m/N^(1/3)].

    `compliance` as in `contact_stiffness`; Harris & Kotzalas 2006, Eqs. 6.29 and 6.30.
    """
    size = sp.cbrt(3 * compliance * kappa**2 * sp.elliptic_e(1 - kappa**-2) / (sp.pi * curvature_sum))
    return size, size / kappa


def peak_pressure(major: sp.Expr, minor: sp.Expr) -> sp.Expr:
    """Peak pressure 3 Q/(2 pi a b) over the cube root of the force Q, from `half_axes` [Pa/N^(1/3)]."""
    return 3 / (2 * sp.pi * major * minor)
