"""Slopes of the sums of the balls' forces by the relative motion of the rings, from the deflection by CasADi.

In: deflection and rate of a ball over coefficients r and its direction (`relative_motion`).  Out: `RingMotionSlopes`:
the distinct summands that slopes are made of, and which of them each derivative adds up.  The deflection is affine in
the direction, so many of the summands are equal and one sum over the balls serves several derivatives; that is found
here, by values at a point without symmetry, and not written by hand.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import casadi as ca

#: Coefficients of deflection and rate; behind them, cosine and sine of the cage's angle.
RINGS = 5
RELATIVE = RINGS + 2

#: Values of (co, si, slope by the deflection, slope by the rate) at which summands are compared.
_POINT = (0.7310585786, -0.4621171573, 1.6487212707, -2.2360679775)
_SAME = 1e-12


def relative_motion(r: ca.SX, co: ca.SX, si: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Geometric deflection of a ball and its rate at a direction."""
    return r[0] + r[1] * co + r[2] * si, r[3] * co + r[4] * si


@dataclass(frozen=True, slots=True, kw_only=True)
class RingMotionSlopes:
    """What the slopes of S = (sum F co, sum F si) are made of.

    Attributes
    ----------
    summands : (co, si, slope of F by the deflection, by the rate) -> distinct summands
    by_ring : for each coefficient the places of the summands of dS; none for one that is a constant of a run
    by_turn : for each entry of S the products that its derivative by the cage's angle adds up: sign, coefficient, place
    """

    summands: ca.Function
    by_ring: tuple[tuple[int, int] | None, ...]
    by_turn: tuple[tuple[tuple[int, int, int], ...], ...]

    def by_coefficients(self, totals: ca.SX) -> ca.SX:
        """d(S)/d(r) of deflection and rate, from the totals of the summands; zero for constants."""
        pairs = (ca.SX(2, 1) if places is None else ca.vertcat(*(totals[k] for k in places)) for places in self.by_ring)
        return ca.horzcat(*pairs)

    def by_relative(self, sums: ca.SX, totals: ca.SX, r: ca.SX) -> ca.SX:
        """The same, and by cosine and sine of the cage's angle, which turns all balls at once."""
        turned = []
        for products in self.by_turn:
            total = ca.SX(0.0)
            for sign, k, place in products:
                total = total + r[k] * totals[place] if sign > 0 else total - r[k] * totals[place]
            turned.append(total)
        turn = ca.vertcat(turned[0] - sums[1], turned[1] + sums[0])
        return ca.horzcat(self.by_coefficients(totals), -r[RINGS + 1] * turn, r[RINGS] * turn)


@cache
def ring_motion_slopes() -> RingMotionSlopes:
    """The summands of `relative_motion`."""
    co, si, by_delta, by_rate = (ca.SX.sym(name) for name in ("co", "si", "Fd", "Fv"))
    direction, r = ca.vertcat(co, si), ca.SX.sym("r", RINGS)
    motion = ca.vertcat(*relative_motion(r, co, si))
    by_coefficient = ca.jacobian(motion, r)
    by_turn = ca.jacobian(ca.jtimes(motion, direction, ca.vertcat(-si, co)), r)
    summands: list[ca.SX] = []
    values: list[float] = []

    def find(slopes: ca.SX, along: ca.SX) -> tuple[int, int]:
        """Sign and place of a summand among the distinct ones; new ones go behind."""
        summand = by_delta * (slopes[0] * along) + by_rate * (slopes[1] * along)
        value = float(ca.Function("value", [ca.vertcat(direction, by_delta, by_rate)], [summand])(_POINT))
        for place, known in enumerate(values):
            if abs(abs(value) - abs(known)) < _SAME:
                return (1 if value * known > 0.0 else -1), place
        summands.append(summand)
        values.append(value)
        return 1, len(values) - 1

    # what no direction changes is made of constants of a run: nothing that moves enters by it
    moving = [k for k in range(RINGS) if ca.depends_on(by_coefficient[:, k], direction)]
    by_ring: list[tuple[int, int] | None] = [None] * RINGS
    for k in moving:
        by_ring[k] = find(by_coefficient[:, k], co)[1], find(by_coefficient[:, k], si)[1]
    products = []
    for along in (co, si):
        found = [(k, *find(by_turn[:, k], along)) for k in moving]
        products.append(tuple((sign, k, place) for k, sign, place in found))
    return RingMotionSlopes(
        summands=ca.Function("summands", [co, si, by_delta, by_rate], [ca.vertcat(*summands)]),
        by_ring=tuple(by_ring),
        by_turn=tuple(products),
    )
