"""The RRR dyad: two bodies hinged to each other and to bodies already placed.

The radicand of its positions is Heron's product, whose factors are sums and differences of lengths: little cancels
where the dyad is nearly straight.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import sympy as sp

from ballpass.derive.mechanism.balance import Balance
from ballpass.derive.mechanism.dyads.closure import body_span, name_base, name_gap, name_span, span_length, turn_by_span
from ballpass.derive.mechanism.dyads.dyad import Dyad, Margin, Placement, name_acceleration, name_hinge, name_rate
from ballpass.derive.mechanism.kinematics import Ledger, Play, Pose, Turn, carried, name_joint, place
from ballpass.derive.mechanism.vectors import add, dot, quarter_turn, scale, subtract
from ballpass.derive.scene.mechanism_records import Mechanism
from ballpass.derive.terms import subscript


@dataclass(frozen=True, slots=True, kw_only=True)
class RRR(Dyad):
    """The inner joint lies on two circles, left or right of the line between their centres.

    Spans of the placement: from the outer joint of each body to the inner joint; their cross product is the determinant
    [m^2].
    """

    kind: ClassVar[str] = "RRR"
    branches: ClassVar[tuple[str, ...]] = ("left", "right")
    words: ClassVar[str] = "three revolute joints"

    def branch_meaning(self) -> str:
        """What the branch decides."""
        one, inner, two = self.joints
        return f"on which side of the line from {one} to {two} joint {inner} lies"

    def place(self, ledger: Ledger, mechanism: Mechanism, poses: Mapping[str, Pose], play: Play) -> Placement:
        """Position by Heron's product, rates by the differentiated loop closure."""
        inner, bodies = self.inner, self.bodies
        mark, prefix = subscript(inner.name), f"joint.{inner.name}"
        outer = zip(self.outer, self.hosts, strict=True)
        hinges = [name_hinge(ledger, mechanism, joint, poses[host], play) for joint, host in outer]
        ends = (hinges[0], self.closing(hinges[1], play))
        spans = [body_span(mechanism, body, joint, inner) for body, joint in zip(bodies, self.outer, strict=True)]
        one, two = (span_length(ledger, body, span) for body, (_, span) in zip(bodies, spans, strict=True))

        names = f"from {self.outer[0].name} to {self.outer[1].name}"
        base, square = name_base(ledger, inner, names, ends)
        difference, total = one - two, one + two
        heron = ledger.define(
            f"{prefix}.heron",
            (total**2 - square) * (square - difference**2),
            "m^4",
            f"Heron's product at joint {inner.name}: 16 times the squared area of the triangle of the joints",
            f"H_{{{mark}}}",
        )
        # v1 and v2 lead from the outer joints to the inner one; v1 × v2 is twice the triangle's area, signed by branch.
        determinant = ledger.define(
            f"{prefix}.determinant",
            sp.Rational(self.sign, 2) * sp.sqrt(heron),
            "m^2",
            f"cross product of the two spans at joint {inner.name}",
            rf"\Delta_{{{mark}}}",
        )
        across = quarter_turn(base)
        ahead = (square + difference * total) / 2
        behind = (square - difference * total) / 2
        vectors = (
            scale(1 / square, add(scale(ahead, base), scale(determinant, across))),
            scale(1 / square, add(scale(-behind, base), scale(determinant, across))),
        )
        v1, v2 = (name_span(ledger, body, vector) for body, vector in zip(bodies, vectors, strict=True))
        turns = [
            turn_by_span(ledger, body, vector, span, length)
            for body, vector, (_, span), length in zip(bodies, (v1, v2), spans, (one, two), strict=True)
        ]

        # P1 + v1 = P2 + v2, differentiated: w1 J v1 − w2 J v2 = r; scalar products with v2 and v1 give one rate each.
        gap = name_gap(ledger, inner, "v", subtract(ends[1].velocity, ends[0].velocity))
        rates = [
            name_rate(ledger, body, dot(gap, other) / determinant) for body, other in zip(bodies, (v2, v1), strict=True)
        ]
        difference_of_accelerations = add(
            subtract(ends[1].acceleration, ends[0].acceleration),
            scale(rates[0] ** 2, v1),
            scale(-(rates[1] ** 2), v2),
        )
        gap = name_gap(ledger, inner, "a", difference_of_accelerations)
        accelerations = [
            name_acceleration(ledger, body, dot(gap, other) / determinant)
            for body, other in zip(bodies, (v2, v1), strict=True)
        ]

        name_joint(ledger, inner, carried(hinges[0], v1, rates[0], accelerations[0]))
        first, second = (
            place(ledger, mechanism, body, Turn(cos=cos, sin=sin, rate=rate, acceleration=acceleration), start, hinge)
            for body, (cos, sin), rate, acceleration, (start, _), hinge in zip(
                bodies, turns, rates, accelerations, spans, hinges, strict=True
            )
        )
        return Placement(
            dyad=self,
            poses=(first, second),
            spans=(v1, v2),
            determinant=determinant,
            margin=Margin(
                joint=inner.name,
                expression=heron / (4 * one**2 * two**2),
                description=f"squared sine of the transmission angle at joint {inner.name}",
            ),
        )

    def solve(self, ledger: Ledger, balance: Balance, placement: Placement) -> None:
        """Inner joint: moments of each body about its outer joint.  Outer joints: balance of forces."""
        outer = list(zip(self.bodies, self.outer, strict=True))
        one, two = (balance.name_moment(ledger, body, joint) for body, joint in outer)
        v1, v2 = placement.spans
        # v1 × f + K1 = 0 and v2 × (−f) + K2 = 0, determinant v1 × v2.
        force = scale(-1 / placement.determinant, add(scale(one, v2), scale(two, v1)))
        balance.solve_hinge(ledger, self.inner, self.bodies[0], force)
        for body, joint in outer:
            balance.solve_hinge_by_forces(ledger, joint, body)
