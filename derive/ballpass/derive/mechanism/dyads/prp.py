"""The PRP dyad: two sliders, each guided by a body already placed, with a hinge between them: Rapson's slide.

The hinge is where the paths that both guides give it cross.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from ballpass.derive.mechanism.balance import Balance, Guide
from ballpass.derive.mechanism.dyads.closure import name_gap
from ballpass.derive.mechanism.dyads.dyad import Dyad, Placement
from ballpass.derive.mechanism.dyads.guides import (
    guide_axis,
    name_crossing,
    name_direction,
    name_path,
    name_travels,
    slid,
)
from ballpass.derive.mechanism.kinematics import Ledger, Play, Pose, carried, displaced, joint_point, name_joint, place
from ballpass.derive.mechanism.vectors import add, dot, quarter_turn, scale, subtract
from ballpass.derive.scene.mechanism_records import Mechanism


@dataclass(frozen=True, slots=True, kw_only=True)
class PRP(Dyad):
    """Bodies: two sliders, each turning with its host.

    Determinant of the placement: sine of the angle from the first guide to the second [1].
    """

    kind: ClassVar[str] = "PRP"
    branches: ClassVar[tuple[str, ...]] = ("ahead",)
    words: ClassVar[str] = "both outer joints prismatic"

    def branch_meaning(self) -> str:
        """What the branch decides."""
        one, _, two = self.joints
        return f"nothing: guides {one} and {two} meet at one place"

    def place(self, ledger: Ledger, mechanism: Mechanism, poses: Mapping[str, Pose], play: Play) -> Placement:
        """Position where both paths cross, rates by the differentiated loop closure."""
        inner, bodies, outer = self.inner, self.bodies, self.outer
        hosts = [poses[host] for host in self.hosts]
        points = [joint_point(mechanism, inner, body) for body in bodies]
        paths = [
            name_path(ledger, mechanism, inner, guide, host, body, point)
            for guide, host, body, point in zip(outer, hosts, bodies, points, strict=True)
        ]
        one, two = (
            name_direction(ledger, guide, host.rotate(guide_axis(guide)))
            for guide, host in zip(outer, hosts, strict=True)
        )
        determinant, margin = name_crossing(ledger, inner, outer, (one, two))
        both = ((outer[0], bodies[0], one), (outer[1], bodies[1], scale(-1, two)))

        # base1 + s1 t1 = base2 + s2 t2, differentiated; cross products with t2 and t1.
        between = subtract(self.closing(paths[1], play).position, paths[0].position)
        travels = name_travels(ledger, both, "", between, -determinant)
        fellows = [
            carried(path, scale(travel, direction), host.rate, host.acceleration)
            for path, travel, direction, host in zip(paths, travels, (one, two), hosts, strict=True)
        ]
        ends = fellows[0], self.closing(fellows[1], play)
        gap = name_gap(ledger, inner, "v", subtract(ends[1].velocity, ends[0].velocity))
        speeds = name_travels(ledger, both, "speed", gap, -determinant)
        turned = [
            scale(2 * host.rate * speed, quarter_turn(direction))
            for host, speed, direction in zip(hosts, speeds, (one, two), strict=True)
        ]
        closure = subtract(subtract(ends[1].acceleration, ends[0].acceleration), subtract(turned[0], turned[1]))
        gap = name_gap(ledger, inner, "a", closure)
        accelerations = name_travels(ledger, both, "acceleration", gap, -determinant)

        motion = name_joint(ledger, inner, slid(fellows[0], hosts[0].rate, one, speeds[0], accelerations[0]))
        motions = motion, displaced(motion, play.get(inner.name), 1 if inner.bodies[0] == bodies[0] else -1)
        first, second = (
            place(ledger, mechanism, body, host, point, at)
            for body, host, point, at in zip(bodies, hosts, points, motions, strict=True)
        )
        return Placement(
            dyad=self,
            poses=(first, second),
            determinant=determinant,
            guides=tuple(
                Guide(joint=guide, host=host.body, slider=body, direction=direction, travel=travel)
                for guide, host, body, direction, travel in zip(outer, hosts, bodies, (one, two), travels, strict=True)
            ),
            margin=margin,
        )

    def solve(self, ledger: Ledger, balance: Balance, placement: Placement) -> None:
        """Inner joint: balance of each slider along its guide; then the guides."""
        one, two = placement.guides
        pushes = [dot(guide.direction, balance.known_force(guide.slider)) for guide in (one, two)]
        # f on the first slider: t1 · f + P1 = 0 and t2 · (−f) + P2 = 0, determinant t1 × t2.
        force = add(scale(pushes[1], one.normal), scale(pushes[0], two.normal))
        balance.solve_hinge(ledger, self.inner, self.bodies[0], scale(1 / placement.determinant, force))
        for guide in (one, two):
            across = -dot(guide.normal, balance.known_force(guide.slider))
            balance.solve_guide(ledger, guide, across, about=balance.center(guide.slider))
