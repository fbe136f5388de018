"""The RRP dyad: a rod hinged, and a slider guided, on bodies already placed, with a hinge between them.

The radicand of its positions is (L − e)(L + e), with the rod's length L and the distance e of the inner joint's path
from the rod's hinge.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import sympy as sp

from ballpass.derive.mechanism.balance import Balance, Guide
from ballpass.derive.mechanism.dyads.closure import body_span, name_gap, name_span, span_length, turn_by_span
from ballpass.derive.mechanism.dyads.dyad import Dyad, Margin, Placement, name_acceleration, name_hinge, name_rate
from ballpass.derive.mechanism.dyads.guides import guide_axis, name_direction, name_path, name_travel, slid
from ballpass.derive.mechanism.kinematics import Ledger, Play, Pose, Turn, carried, joint_point, name_joint, place
from ballpass.derive.mechanism.vectors import add, cross, dot, quarter_turn, scale, subtract
from ballpass.derive.scene.mechanism_records import Mechanism
from ballpass.derive.terms import subscript


@dataclass(frozen=True, slots=True, kw_only=True)
class RRP(Dyad):
    """Bodies: rod, slider.  The inner joint lies on a circle and a line, ahead of or behind the foot of the
    perpendicular from the rod's hinge.

    Span of the placement: of the rod, from its hinge to the inner joint; its component along the guide is the
    determinant [m].
    """

    kind: ClassVar[str] = "RRP"
    branches: ClassVar[tuple[str, ...]] = ("ahead", "behind")
    words: ClassVar[str] = "one of the outer joints prismatic"

    def branch_meaning(self) -> str:
        """What the branch decides."""
        one, inner, guide = self.joints
        return (
            f"whether joint {inner} lies ahead of or behind the foot of the perpendicular from {one} onto its path, "
            f"seen along the direction of guide {guide}"
        )

    def place(self, ledger: Ledger, mechanism: Mechanism, poses: Mapping[str, Pose], play: Play) -> Placement:
        """Position by the right triangle of rod and path, rates by the differentiated loop closure."""
        inner, (rod, slider), (hinge_joint, guide_joint) = self.inner, self.bodies, self.outer
        host = poses[self.hosts[1]]
        mark, prefix = subscript(inner.name), f"joint.{inner.name}"
        hinge = name_hinge(ledger, mechanism, hinge_joint, poses[self.hosts[0]], play)
        start, span = body_span(mechanism, rod, hinge_joint, inner)
        length = span_length(ledger, rod, span)

        slider_inner = joint_point(mechanism, inner, slider)
        path = name_path(ledger, mechanism, inner, guide_joint, host, slider, slider_inner)
        direction = name_direction(ledger, guide_joint, host.rotate(guide_axis(guide_joint)))
        normal = quarter_turn(direction)

        to_path = subtract(self.closing(path, play).position, hinge.position)
        offset = ledger.name(
            f"{prefix}.offset",
            dot(normal, to_path),
            "m",
            f"distance of the path of {inner.name} from joint {hinge_joint.name}, positive to the left of the guide",
            f"e_{{{mark}}}",
        )
        reach = ledger.define(
            f"{prefix}.determinant",
            self.sign * sp.sqrt((length - offset) * (length + offset)),
            "m",
            f"component of the span of {rod} along guide {guide_joint.name}",
            rf"\Delta_{{{mark}}}",
        )
        travel = name_travel(ledger, guide_joint, slider, "", reach - dot(direction, to_path))
        v = name_span(ledger, rod, add(scale(offset, normal), scale(reach, direction)))
        cos, sin = turn_by_span(ledger, rod, v, span, length)

        # P + v = base + s t, differentiated: w J v − s' t = r; cross product with t and scalar product with v.
        fellow = carried(path, scale(travel, direction), host.rate, host.acceleration)
        closing = self.closing(fellow, play)
        gap = name_gap(ledger, inner, "v", subtract(closing.velocity, hinge.velocity))
        rate = name_rate(ledger, rod, cross(direction, gap) / reach)
        speed = name_travel(ledger, guide_joint, slider, "speed", -dot(v, gap) / reach)
        # Seen from the frame, the slider has the host's acceleration, Coriolis' and its own along the guide.
        coriolis = scale(2 * host.rate * speed, normal)
        closure = add(subtract(add(closing.acceleration, coriolis), hinge.acceleration), scale(rate**2, v))
        gap = name_gap(ledger, inner, "a", closure)
        acceleration = name_acceleration(ledger, rod, cross(direction, gap) / reach)
        quickening = name_travel(ledger, guide_joint, slider, "acceleration", -dot(v, gap) / reach)
        joint_motion = name_joint(ledger, inner, slid(fellow, host.rate, direction, speed, quickening))

        turn = Turn(cos=cos, sin=sin, rate=rate, acceleration=acceleration)
        rod_pose = place(ledger, mechanism, rod, turn, start, hinge)
        slider_pose = place(ledger, mechanism, slider, host, slider_inner, joint_motion)
        return Placement(
            dyad=self,
            poses=(rod_pose, slider_pose),
            spans=(v,),
            determinant=reach,
            guides=(Guide(joint=guide_joint, host=host.body, slider=slider, direction=direction, travel=travel),),
            margin=Margin(
                joint=inner.name,
                expression=(length - offset) * (length + offset) / length**2,
                description=f"squared cosine of the angle between {rod} and guide {guide_joint.name}",
            ),
        )

    def solve(self, ledger: Ledger, balance: Balance, placement: Placement) -> None:
        """Inner joint: moment of the rod about its hinge, balance of the slider along the guide; then the rest."""
        (guide,), (rod, slider), (v,) = placement.guides, self.bodies, placement.spans
        moment = balance.name_moment(ledger, rod, self.outer[0])
        push = ledger.name(
            f"body.{slider}.known_push",
            dot(guide.direction, balance.known_force(slider)),
            "N",
            f"force along {guide.joint.name} of loads, inertia and reactions already known on {slider}",
            f"P_{{{subscript(slider)}}}",
        )
        t = guide.direction
        # f on the rod: v × f + K = 0 and t · (−f) + P = 0, determinant v · t.
        on_rod = (
            (moment * t[1] + push * v[0]) / placement.determinant,
            (push * v[1] - moment * t[0]) / placement.determinant,
        )
        balance.solve_hinge(ledger, self.inner, rod, on_rod)
        balance.solve_hinge_by_forces(ledger, self.outer[0], rod)
        across = -dot(guide.normal, balance.known_force(slider))
        balance.solve_guide(ledger, guide, across, about=balance.center(slider))
