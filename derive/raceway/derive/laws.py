"""Contact and damping laws of one ball: force over deflection and its rate, apart from all geometry.

Each law is F(delta, delta_rate) as an expression with a declared smoothness.  Positive force pushes the rings apart.

    delta       total deflection of both contacts of the ball [m], positive under load
    delta_rate  its time derivative [m/s]

A new law is a new entry here and its name in `scene.DAMPING_LAWS`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import sympy as sp

from raceway.derive.scene import DampingLaw
from raceway.derive.terms import Smoothness


@dataclass(frozen=True, slots=True, kw_only=True)
class DampingForce:
    """A damping law.

    `force(delta, delta_rate, k_b, coefficient)` is the expression [N]; `coefficient` is c_b [N*s/m], for
    ``tangent`` the time constant beta [s].
    """

    smoothness: Smoothness
    description: str
    force: Callable[[sp.Expr, sp.Expr, sp.Expr, sp.Expr], sp.Expr]


#: Smoothness of `elastic_force`: its slope is continuous, its second derivative unbounded at delta = 0.
ELASTIC_SMOOTHNESS = Smoothness.SMOOTH


def elastic_force(delta: sp.Expr, stiffness: sp.Expr) -> sp.Expr:
    """Hertz contact of a ball between both raceways, Eq. (4) [N]."""
    return sp.Piecewise((stiffness * delta ** sp.Rational(3, 2), delta > 0), (0, True))


def _one_sided(delta: sp.Expr, rate: sp.Expr, k_b: sp.Expr, c_b: sp.Expr) -> sp.Expr:
    return sp.Piecewise((c_b * rate, rate > 0), (0, True))


def _one_sided_gated(delta: sp.Expr, rate: sp.Expr, k_b: sp.Expr, c_b: sp.Expr) -> sp.Expr:
    return sp.Piecewise((c_b * rate, sp.And(rate > 0, delta > 0)), (0, True))


def _two_sided_gated(delta: sp.Expr, rate: sp.Expr, k_b: sp.Expr, c_b: sp.Expr) -> sp.Expr:
    return sp.Piecewise((c_b * rate, delta > 0), (0, True))


def _tangent(delta: sp.Expr, rate: sp.Expr, k_b: sp.Expr, beta: sp.Expr) -> sp.Expr:
    return sp.Piecewise((beta * sp.Rational(3, 2) * k_b * sp.sqrt(delta) * rate, delta > 0), (0, True))


#: Damping laws by their name in the scene; ``none`` has no term and stands in no table.
DAMPING: dict[DampingLaw, DampingForce] = {
    "one-sided": DampingForce(
        smoothness=Smoothness.KINKED,
        description="Eq. (10) as printed: resists approach only, whether the ball touches or not",
        force=_one_sided,
    ),
    "one-sided-gated": DampingForce(
        smoothness=Smoothness.DISCONTINUOUS,
        description="Eq. (10) only while the ball is loaded; the force jumps at contact",
        force=_one_sided_gated,
    ),
    "two-sided-gated": DampingForce(
        smoothness=Smoothness.DISCONTINUOUS,
        description="viscous while the ball is loaded; the force jumps at contact",
        force=_two_sided_gated,
    ),
    "tangent": DampingForce(
        smoothness=Smoothness.KINKED,
        description="proportional to the tangent stiffness of the contact; vanishes continuously with the load",
        force=_tangent,
    ),
}
