"""Contact and damping laws of one ball: force over deflection and its rate, apart from all geometry.

Each law is F(delta, delta_rate) as an expression with a declared smoothness.  Positive force pushes the rings apart.

    delta       total deflection of both contacts of the ball [m], positive under load
    delta_rate  its time derivative [m/s]

A new law is a new entry here and its name in `scene.DAMPING_LAWS`.

Smoothed laws
-------------
Hertz's law has no second derivative at contact onset, gated laws jump there, one-sided ones have a kink at rest.  Where
a scene gives a half width w, the positive part max(z, 0) becomes, within |z| < w, the integral of a quintic step,

    ramp(z) = w v^4 (2 v^2 - 6 v + 5),    step(z) = v^3 (6 v^2 - 15 v + 10),    v = (1 + z/w)/2,

with step = d(ramp)/dz.  Outside nothing changes: ramp = max(z, 0), step = 0 or 1 exactly.  ramp is three times
continuously differentiable, step twice; 0 <= ramp - max(z, 0) <= 5 w/32.  Hertz's law with ramp(delta) for delta_+ is
never softer, off by at most `SMOOTHED_HERTZ_ERROR` k_b w^1.5, and three times continuously differentiable.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import sympy as sp

from ballpass.derive.scene.records import DampingLaw
from ballpass.derive.terms import Smoothness


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


#: Largest error of the smoothed Hertz law over k_b w^1.5: maximum of ramp(z)^1.5 - z_+^1.5 for w = 1, rounded up.
SMOOTHED_HERTZ_ERROR = 0.0668

#: Largest error of `ramp` over w, met at zero.
RAMP_ERROR = 5.0 / 32.0


def _within(value: sp.Expr, width: sp.Expr) -> sp.Expr:
    """v, from 0 to 1 across the width."""
    return (1 + value / width) / 2


def ramp(value: sp.Expr, width: sp.Expr) -> sp.Expr:
    """Positive part of `value`, smoothed within `width`; three times continuously differentiable."""
    v = _within(value, width)
    return sp.Piecewise((value, value > width), (width * v**4 * (2 * v**2 - 6 * v + 5), value > -width), (0, True))


def step(value: sp.Expr, width: sp.Expr) -> sp.Expr:
    """1 where `value` is positive, smoothed within `width`; twice continuously differentiable."""
    v = _within(value, width)
    return sp.Piecewise((1, value > width), (v**3 * (6 * v**2 - 15 * v + 10), value > -width), (0, True))


def smoothed_elastic_force(delta: sp.Expr, stiffness: sp.Expr, width: sp.Expr) -> sp.Expr:
    """Hertz contact with a contact onset smoothed within `width` [N]."""
    v = _within(delta, width)
    # ramp^1.5 with the square root of v^4 taken: no derivative divides by zero at the edge
    onset = stiffness * v**6 * (width * (2 * v**2 - 6 * v + 5)) ** sp.Rational(3, 2)
    return sp.Piecewise((stiffness * delta ** sp.Rational(3, 2), delta > width), (onset, delta > -width), (0, True))


def _smoothed_tangent(delta: sp.Expr, k_b: sp.Expr, width: sp.Expr) -> sp.Expr:
    """Slope of the smoothed elastic force [N/m]."""
    z = sp.Symbol("z", real=True)
    return sp.diff(smoothed_elastic_force(z, k_b, width), z).subs(z, delta)


@dataclass(frozen=True, slots=True, kw_only=True)
class SmoothedDamping:
    """A damping force with smoothed onset and kink as an expression [N]."""

    smoothness: Smoothness
    force: sp.Expr


def smoothed_damping(
    law: DampingLaw,
    delta: sp.Expr,
    rate: sp.Expr,
    k_b: sp.Expr,
    coefficient: sp.Expr,
    *,
    width: sp.Expr | None,
    rate_width: sp.Expr | None,
) -> SmoothedDamping:
    """A damping law smoothed within `width` of contact onset [m] and within `rate_width` of rest [m/s].

    None leaves that switch as it is.
    """
    if width is None and rate_width is None:
        plain = DAMPING[law]
        return SmoothedDamping(smoothness=plain.smoothness, force=plain.force(delta, rate, k_b, coefficient))
    if law == "tangent":
        assert width is not None  # the reader allows no width of the rate here
        force = coefficient * _smoothed_tangent(delta, k_b, width) * rate
        return SmoothedDamping(smoothness=Smoothness.TWICE_SMOOTH, force=force)
    one_sided, gated = law.startswith("one-sided"), law.endswith("gated")
    force = coefficient * rate
    if one_sided:
        force = coefficient * (_positive(rate) if rate_width is None else ramp(rate, rate_width))
    if gated:
        force = force * (_touching(delta) if width is None else step(delta, width))
    if gated and width is None:
        smoothness = Smoothness.DISCONTINUOUS
    elif one_sided and rate_width is None:
        smoothness = Smoothness.KINKED
    else:
        smoothness = Smoothness.TWICE_SMOOTH
    return SmoothedDamping(smoothness=smoothness, force=force)


def _positive(value: sp.Expr) -> sp.Expr:
    return sp.Piecewise((value, value > 0), (0, True))


def _touching(delta: sp.Expr) -> sp.Expr:
    return sp.Piecewise((1, delta > 0), (0, True))


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
