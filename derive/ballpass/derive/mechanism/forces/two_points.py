"""Pathway: along the line between points of two bodies, of which one may be the frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import sympy as sp

from ballpass.derive.mechanism.balance import AppliedLoad
from ballpass.derive.mechanism.forces.force import Action, Measure, Pathway, Setting
from ballpass.derive.mechanism.kinematics import body_point
from ballpass.derive.mechanism.vectors import dot, scale, subtract
from ballpass.derive.scene.body_keys import BODIES, POINTS
from ballpass.derive.scene.errors import Fault
from ballpass.derive.scene.mechanism_records import Force, Mechanism
from ballpass.derive.terms import subscript
from ballpass.derive.variables import Output


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoPoints(Pathway):
    """A tension pulls ``points[0]`` of ``bodies[0]`` and ``points[1]`` of ``bodies[1]`` towards each other."""

    measure: ClassVar[Measure] = Measure(
        size="length", size_unit="m", example="40 mm", amount="tension", amount_unit="N"
    )

    bodies: tuple[str, str] = BODIES.declared()
    points: tuple[str, str] = POINTS.declared()

    def act(self, force: Force, setting: Setting) -> Action:
        """Length, its rate and the direction of the line."""
        mechanism, ledger, label, mark = setting.linkage.mechanism, setting.ledger, force.label, subscript(force.name)
        self._refuse_hinge(force, mechanism)
        places = [body_point(mechanism, *end) for end in zip(self.bodies, self.points, strict=True)]
        one, two = (setting.linkage.pose(body).motion(place) for body, place in zip(self.bodies, places, strict=True))
        words, unit = f"the line between the points of {force.name}", "m"
        line = subtract(two.position, one.position)
        line = ledger.name_pair(f"{label}.line", "", line, unit, f"component of {words}", f"d_{{{mark},AXIS}}")
        length = ledger.define(f"{label}.length", sp.sqrt(dot(line, line)), "m", f"length of {words}", f"L_{{{mark}}}")
        along = scale(1 / length, line)
        rate = dot(along, subtract(two.velocity, one.velocity))
        setting.outputs.append(Output(name=length.name, expression=length, unit="m", description=f"Length of {words}"))

        def loads(tension: sp.Expr) -> tuple[AppliedLoad, ...]:
            pull = scale(tension, along)
            ends = zip(self.bodies, self.points, places, (pull, scale(sp.Integer(-1), pull)), strict=True)
            return tuple(AppliedLoad(body=body, at=name, point=place, force=on) for body, name, place, on in ends)

        return Action(loads=loads, excess=lambda free: length - free, rate=rate)

    def _refuse_hinge(self, force: Force, mechanism: Mechanism) -> None:
        """A line between the points that a revolute joint keeps together has no direction."""
        ends = set(zip(self.bodies, self.points, strict=True))
        for joint in mechanism.joints:
            if joint.kind == "revolute" and set(zip(joint.bodies, joint.points, strict=True)) == ends:
                raise Fault(
                    key=f"mechanism.{force.table}.{force.name}.points",
                    problem=f"joint {joint.name} keeps the two points together: the line between them has no direction",
                    given=" and ".join(".".join(end) for end in sorted(ends)),
                    allowed="two points at a distance",
                    remedy="give another point of one body; for a spring that turns, [mechanism.torsion_springs.NAME]",
                ).of_linkage()

    def words(self) -> str:
        """The two points."""
        ends = " and ".join(".".join(end) for end in zip(self.bodies, self.points, strict=True))
        return f"force along the line between {ends}"
