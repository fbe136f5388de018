"""The RPR dyad: two bodies that slide on each other, each hinged to a body already placed: slotted lever and block.

The hinges are at P₁, P₂ and d = P₂ − P₁.  Seen from the first body, the second hinge moves on a line along the guide at
the distance e from the first hinge, so that x = ±√(d² − e²) is the component of d along the guide.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import sympy as sp

from ballpass.derive.mechanism.balance import Balance, Guide
from ballpass.derive.mechanism.dyads.closure import name_base, name_gap
from ballpass.derive.mechanism.dyads.dyad import Dyad, Margin, Placement, name_acceleration, name_hinge, name_rate
from ballpass.derive.mechanism.dyads.guides import guide_axis, name_direction, name_travel
from ballpass.derive.mechanism.kinematics import Ledger, Play, Pose, Turn, joint_point, name_turn, place
from ballpass.derive.mechanism.vectors import add, cross, dot, quarter_turn, scale, subtract
from ballpass.derive.scene.mechanism_records import Mechanism
from ballpass.derive.terms import subscript


@dataclass(frozen=True, slots=True, kw_only=True)
class RPR(Dyad):
    """Bodies: that of the guide (``bodies[0]`` of the inner joint), and the one that slides on it; they turn together.

    Span of the placement: from the first body's hinge to the second's; its component along the guide is the determinant
    [m].
    """

    kind: ClassVar[str] = "RPR"
    branches: ClassVar[tuple[str, ...]] = ("ahead", "behind")
    words: ClassVar[str] = "the joint between them prismatic"

    def branch_meaning(self) -> str:
        """What the branch decides."""
        one, guide, two = self.joints
        return f"whether joint {two} lies ahead of or behind joint {one}, seen along the direction of guide {guide}"

    def place(self, ledger: Ledger, mechanism: Mechanism, poses: Mapping[str, Pose], play: Play) -> Placement:
        """Position by the right triangle of the hinges and the guide, rates by the differentiated loop closure."""
        guide, (first, second), (one, two) = self.inner, self.bodies, self.outer
        prefix, mark, names = f"joint.{guide.name}", subscript(guide.name), f"from {one.name} to {two.name}"
        hosts = [poses[host] for host in self.hosts]
        hinges = [
            name_hinge(ledger, mechanism, joint, host, play) for joint, host in zip(self.outer, hosts, strict=True)
        ]
        starts = [joint_point(mechanism, joint, body) for joint, body in zip(self.outer, self.bodies, strict=True)]
        span, square = name_base(ledger, guide, names, hinges)
        # In the axes that both bodies share: d = to_guide + travel t − to_hinge, with the components x and e.
        axis = guide_axis(guide)
        rail, shoe = (joint_point(mechanism, guide, body) for body in (first, second))
        between = subtract(subtract(rail, starts[0]), subtract(shoe, starts[1]))
        offset = ledger.name(
            f"{prefix}.offset",
            cross(axis, between),
            "m",
            f"distance of the path of {two.name} from joint {one.name}, positive to the left of the guide",
            f"e_{{{mark}}}",
        )
        reach = ledger.define(
            f"{prefix}.determinant",
            self.sign * sp.sqrt(square - offset**2),
            "m",
            f"component along guide {guide.name} of the line {names}",
            rf"\Delta_{{{mark}}}",
        )
        along = subtract(scale(reach, span), scale(offset, quarter_turn(span)))
        direction = name_direction(ledger, guide, scale(1 / square, along))
        cos, sin = name_turn(ledger, first, dot(axis, direction), cross(axis, direction), mark)
        travel = name_travel(ledger, guide, second, "", reach - dot(axis, between))

        # d differentiated: w J d + s' t = r; cross product with t and scalar product with d.
        gap = name_gap(ledger, guide, "v", subtract(hinges[1].velocity, hinges[0].velocity))
        rate = name_rate(ledger, first, cross(direction, gap) / reach)
        speed = name_travel(ledger, guide, second, "speed", dot(span, gap) / reach)
        closure = add(
            subtract(hinges[1].acceleration, hinges[0].acceleration),
            scale(rate**2, span),
            scale(-2 * rate * speed, quarter_turn(direction)),
        )
        gap = name_gap(ledger, guide, "a", closure)
        acceleration = name_acceleration(ledger, first, cross(direction, gap) / reach)

        turn = Turn(cos=cos, sin=sin, rate=rate, acceleration=acceleration)
        lever, block = (
            place(ledger, mechanism, body, turn, start, hinge)
            for body, start, hinge in zip(self.bodies, starts, hinges, strict=True)
        )
        # Where the hinges come to lie on each other there is no direction: d by the arms that could part them.
        arms = [
            subtract(joint_point(mechanism, joint, host.body), host.anchor)
            for joint, host in zip(self.outer, hosts, strict=True)
        ]
        return Placement(
            dyad=self,
            poses=(lever, block),
            spans=(span,),
            determinant=reach,
            guides=(Guide(joint=guide, host=first, slider=second, direction=direction, travel=travel),),
            margin=Margin(
                joint=guide.name,
                expression=(square - offset**2) / (square + dot(arms[0], arms[0]) + dot(arms[1], arms[1])),
                description=f"squared component along guide {guide.name} of the line {names}, by the squared lengths "
                "of this line and of the arms of both joints on their bodies",
            ),
        )

    def solve(self, ledger: Ledger, balance: Balance, placement: Placement) -> None:
        """Inner joint: moments of both bodies about their hinges, together and of the second; hinges: forces."""
        (guide,), (first, second), (one, two) = placement.guides, self.bodies, self.outer
        moments = balance.name_moment(ledger, first, one) + balance.name_moment(ledger, second, two)
        # f n on the second body, −f n on the first: moments about P1 of both, d × (f n) = x f, and K1 + K2 of the rest.
        balance.solve_guide(ledger, guide, moments / placement.determinant, about=balance.point(two, second))
        balance.solve_hinge_by_forces(ledger, two, second)
        balance.solve_hinge_by_forces(ledger, one, first)
