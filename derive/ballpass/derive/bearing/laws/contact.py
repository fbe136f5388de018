"""Contact of a rolling element between both raceways, Eq. (4), and its smoothed form.

    delta       total deflection of both contacts of the ball [m], positive under load
    delta_rate  its time derivative [m/s]

Hertz's law has no second derivative at contact onset, gated laws jump there, one-sided ones have a kink at rest.  Where
a scene gives a half width w, the positive part max(z, 0) becomes, within |z| < w, the integral of a quintic step,

    ramp(z) = w v^4 (2 v^2 - 6 v + 5),    step(z) = v^3 (6 v^2 - 15 v + 10),    v = (1 + z/w)/2,

with step = d(ramp)/dz.  Outside nothing changes: ramp = max(z, 0), step = 0 or 1 exactly.  ramp is three times
continuously differentiable, step twice; 0 <= ramp - max(z, 0) <= 5 w/32.  The law k_b delta^n with ramp(delta) for
delta_+ is never softer, of balls (n = 1.5) off by at most `SMOOTHED_HERTZ_ERROR` k_b w^1.5, and three times
continuously differentiable.

Damping laws are written with `Contact` and `Rest`, so that each has its smoothed form without a word about it.
"""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

#: Largest error of the smoothed Hertz law over k_b w^1.5: maximum of ramp(z)^1.5 - z_+^1.5 for w = 1, rounded up.
SMOOTHED_HERTZ_ERROR = 0.0668


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact:
    """Contact of one element: its factor k_b, the exponent n of the deflection (of balls 3/2), and the half width of
    its smoothed onset [m], or None."""

    stiffness: sp.Expr
    exponent: sp.Expr
    width: sp.Expr | None = None

    def force(self, delta: sp.Expr) -> sp.Expr:
        """Elastic force, Eq. (4) [N]."""
        sharp = self.stiffness * delta**self.exponent
        if self.width is None:
            return sp.Piecewise((sharp, delta > 0), (0, True))
        v = _within(delta, self.width)
        # ramp^n with the power of v^4 taken apart: no derivative divides by zero at the edge
        onset = self.stiffness * v ** (4 * self.exponent) * (self.width * (2 * v**2 - 6 * v + 5)) ** self.exponent
        return sp.Piecewise((sharp, delta > self.width), (onset, delta > -self.width), (0, True))

    def slope(self, delta: sp.Expr) -> sp.Expr:
        """Slope of the elastic force [N/m]."""
        z = sp.Symbol("z", real=True)
        return sp.diff(self.force(z), z).subs(z, delta)

    def gate(self, delta: sp.Expr) -> sp.Expr:
        """1 while the ball touches both raceways, else 0; twice continuously differentiable where it is smoothed."""
        if self.width is None:
            return sp.Piecewise((1, delta > 0), (0, True))
        v = _within(delta, self.width)
        step = v**3 * (6 * v**2 - 15 * v + 10)
        return sp.Piecewise((1, delta > self.width), (step, delta > -self.width), (0, True))


@dataclass(frozen=True, slots=True, kw_only=True)
class SmoothedRest:
    """What one-sided laws do where the rate passes zero; `width` is the half width of their smoothed kink [m/s]."""

    width: sp.Expr | None = None

    def positive(self, rate: sp.Expr) -> sp.Expr:
        """Positive part of a rate; three times continuously differentiable where it is smoothed."""
        if self.width is None:
            return sp.Piecewise((rate, rate > 0), (0, True))
        v = _within(rate, self.width)
        ramp = self.width * v**4 * (2 * v**2 - 6 * v + 5)
        return sp.Piecewise((rate, rate > self.width), (ramp, rate > -self.width), (0, True))


def _within(value: sp.Expr, width: sp.Expr) -> sp.Expr:
    """v, from 0 to 1 across the width."""
    return (1 + value / width) / 2
