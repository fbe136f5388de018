"""The RPP dyad: a block, hinged to a body already placed, that slides on a yoke, which a body already placed guides:
the Scotch yoke.

Neither body turns against the one that guides the yoke, so both travels follow from two linear equations.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from ballpass.derive.mechanism.balance import Balance, Guide
from ballpass.derive.mechanism.dyads.closure import name_gap
from ballpass.derive.mechanism.dyads.dyad import Dyad, Placement, name_hinge
from ballpass.derive.mechanism.dyads.guides import (
    guide_axis,
    name_crossing,
    name_direction,
    name_path,
    name_travels,
    slid,
)
from ballpass.derive.mechanism.kinematics import Ledger, Play, Pose, carried, joint_point, place
from ballpass.derive.mechanism.vectors import add, dot, quarter_turn, scale, subtract
from ballpass.derive.scene.mechanism_records import Mechanism
from ballpass.derive.terms import subscript


@dataclass(frozen=True, slots=True, kw_only=True)
class RPP(Dyad):
    """Bodies: block, yoke.  Where the block's hinge is decides how far both have travelled.

    Determinant of the placement: sine of the angle from the inner guide to the outer one [1].
    """

    kind: ClassVar[str] = "RPP"
    branches: ClassVar[tuple[str, ...]] = ("ahead",)
    words: ClassVar[str] = "the joint between them and one of the outer joints prismatic"

    def branch_meaning(self) -> str:
        """What the branch decides."""
        _, slot, guide = self.joints
        return f"nothing: guides {slot} and {guide} meet at one place"

    def place(self, ledger: Ledger, mechanism: Mechanism, poses: Mapping[str, Pose], play: Play) -> Placement:
        """Position by both guides' components of the way to the hinge, rates by the same of its derivatives."""
        slot, (block, yoke), (hinge_joint, guide_joint) = self.inner, self.bodies, self.outer
        host = poses[self.hosts[1]]
        hinge = name_hinge(ledger, mechanism, hinge_joint, poses[self.hosts[0]], play)
        pin, shoe = (joint_point(mechanism, joint, block) for joint in (hinge_joint, slot))
        rail, foot = (joint_point(mechanism, joint, yoke) for joint in (slot, guide_joint))
        place_of_pin = add(rail, subtract(pin, shoe))  # on the yoke, while the points of the slot coincide
        path = name_path(ledger, mechanism, hinge_joint, guide_joint, host, yoke, place_of_pin)
        axes = guide_axis(slot), guide_axis(guide_joint)
        along, way = (
            name_direction(ledger, joint, host.rotate(axis))
            for joint, axis in zip((slot, guide_joint), axes, strict=True)
        )
        determinant, margin = name_crossing(ledger, slot, (slot, guide_joint), axes)
        both = ((slot, block, along), (guide_joint, yoke, way))

        # base + s1 t1 + s2 t2 = P, seen from the host; cross products with t2 and t1.
        moved = subtract(hinge.position, path.position)
        travels = name_travels(ledger, both, "", moved, determinant)
        fellow = carried(path, moved, host.rate, host.acceleration)
        gap = name_gap(ledger, slot, "v", subtract(hinge.velocity, fellow.velocity))
        speeds = name_travels(ledger, both, "speed", gap, determinant)
        coriolis = scale(2 * host.rate, quarter_turn(gap))
        gap = name_gap(ledger, slot, "a", subtract(subtract(hinge.acceleration, fellow.acceleration), coriolis))
        accelerations = name_travels(ledger, both, "acceleration", gap, determinant)

        under = host.motion(joint_point(mechanism, guide_joint, host.body))
        under = carried(under, scale(travels[1], way), host.rate, host.acceleration)
        words, mark = f"joint {guide_joint.name} on {yoke}", f"{subscript(guide_joint.name)},{subscript(yoke)}"
        anchor = slid(under, host.rate, way, speeds[1], accelerations[1])
        anchor = ledger.name_motion(f"joint.{guide_joint.name}.{yoke}", anchor, words, mark)
        return Placement(
            dyad=self,
            poses=(
                place(ledger, mechanism, block, host, pin, hinge),
                place(ledger, mechanism, yoke, host, foot, anchor),
            ),
            determinant=determinant,
            guides=(
                Guide(joint=slot, host=yoke, slider=block, direction=along, travel=travels[0]),
                Guide(joint=guide_joint, host=host.body, slider=yoke, direction=way, travel=travels[1]),
            ),
            margin=margin,
        )

    def solve(self, ledger: Ledger, balance: Balance, placement: Placement) -> None:
        """Inner joint: balance of the yoke along its guide; then the hinge, and the yoke's guide."""
        (slot, guide), (block, yoke) = placement.guides, self.bodies
        # f n1 on the block, −f n1 on the yoke: t2 · (−f n1) + P = 0, and t2 · n1 is the determinant.
        push = dot(guide.direction, balance.known_force(yoke)) / placement.determinant
        balance.solve_guide(ledger, slot, push, about=balance.point(self.outer[0], block))
        balance.solve_hinge_by_forces(ledger, self.outer[0], block)
        across = -dot(guide.normal, balance.known_force(yoke))
        balance.solve_guide(ledger, guide, across, about=balance.center(yoke))
