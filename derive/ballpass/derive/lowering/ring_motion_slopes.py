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
    by_ring : for each coefficient that is no constant of a run the places of the summands of dS
    by_turn : for each entry of S the products that its derivative by the cage's angle adds up: coefficient, sign, place
    """

    summands: ca.Function
    by_ring: dict[int, tuple[int, int]]
    by_turn: list[list[tuple[int, int, int]]]

    def by_relative(self, sums: ca.SX, totals: ca.SX, r: ca.SX) -> ca.SX:
        """d(S)/d(r) from the totals of the summands; cosine and sine of the cage's angle turn all balls at once."""
        turned = [sum(sign * (r[k] * totals[place]) for k, sign, place in products) for products in self.by_turn]
        turn = ca.vertcat(turned[0] - sums[1], turned[1] + sums[0])
        pairs = (totals[[*self.by_ring[k]]] if k in self.by_ring else ca.SX(2, 1) for k in range(RINGS))
        return ca.horzcat(*pairs, -r[RINGS + 1] * turn, r[RINGS] * turn)


@cache
def ring_motion_slopes() -> RingMotionSlopes:
    """The summands of `relative_motion`."""
    co, si, by_delta, by_rate = (ca.SX.sym(name) for name in ("co", "si", "Fd", "Fv"))
    direction, r = ca.vertcat(co, si), ca.SX.sym("r", RINGS)
    motion = ca.vertcat(*relative_motion(r, co, si))
    by_coefficient = ca.jacobian(motion, r)
    turned = ca.jacobian(ca.jtimes(motion, direction, ca.vertcat(-si, co)), r)
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
    by_ring = {k: (find(by_coefficient[:, k], co)[1], find(by_coefficient[:, k], si)[1]) for k in moving}
    by_turn = [[(k, *find(turned[:, k], along)) for k in moving] for along in (co, si)]
    made = ca.Function("summands", [co, si, by_delta, by_rate], [ca.vertcat(*summands)])
    return RingMotionSlopes(summands=made, by_ring=by_ring, by_turn=by_turn)
