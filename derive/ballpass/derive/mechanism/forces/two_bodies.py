"""Pathway: the angle between two bodies, of which one may be the frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import sympy as sp

from ballpass.derive.mechanism.balance import AppliedLoad
from ballpass.derive.mechanism.forces.force import Action, Measure, Pathway, Setting
from ballpass.derive.mechanism.kinematics import cross, dot, subscript
from ballpass.derive.mechanism.swing import Jumps
from ballpass.derive.scene.body_keys import BODIES
from ballpass.derive.scene.read_keys import declared
from ballpass.derive.scene.records import FRAME, Force
from ballpass.derive.terms import Definition


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoBodies(Pathway):
    """A torque turns ``bodies[0]`` counter-clockwise and ``bodies[1]`` clockwise.

    The angle is that of ``bodies[1]`` in the axes of ``bodies[0]``; its excess over a free one lies within half a turn.
    """

    measure: ClassVar[Measure] = Measure(
        size="angle", size_unit="rad", example="90 deg", amount="torque", amount_unit="N*m"
    )

    bodies: tuple[str, str] = declared(BODIES)

    def act(self, force: Force, setting: Setting) -> Action:
        """Relative angle and its rate."""
        one, two = (setting.linkage.pose(body) for body in self.bodies)
        first, second = (one.cos, one.sin), (two.cos, two.sin)

        def excess(free: sp.Expr) -> sp.Expr:
            from_free = (sp.cos(free), sp.sin(free))
            turned = (dot(first, second), cross(first, second))
            sin, cos = cross(from_free, turned), dot(from_free, turned)
            setting.constants.append(
                Definition(
                    symbol=sp.Symbol(f"{force.label}.jumps", real=True),
                    expression=Jumps(cos, sin, *setting.linkage.positions),
                    unit="1",
                    description=f"Jumps of the angle of {force.name} by a turn, in a turn of the driver",
                    latex=rf"n_{{{subscript(force.name)}}}",
                )
            )
            return sp.atan2(sin, cos)

        def loads(torque: sp.Expr) -> tuple[AppliedLoad, ...]:
            signed = zip(self.bodies, (torque, -torque), strict=True)
            return tuple(AppliedLoad(body=body, torque=on) for body, on in signed if body != FRAME)

        return Action(loads=loads, excess=excess, rate=two.rate - one.rate)

    def words(self) -> str:
        """The two bodies."""
        return f"torque between {self.bodies[0]} and {self.bodies[1]}"
