"""Pathway: the angle between two bodies, of which one may be the frame."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar

import sympy as sp

from ballpass.derive.mechanism.balance import AppliedLoad
from ballpass.derive.mechanism.forces.force import Action, Measure, Pathway, Setting
from ballpass.derive.mechanism.kinematics import cross, dot, subscript
from ballpass.derive.mechanism.swing import Mean, Turns
from ballpass.derive.scene.body_keys import BODIES
from ballpass.derive.scene.records import FRAME, Force
from ballpass.derive.terms import Definition
from ballpass.runtime.contract.manifest import UsualInfo


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoBodies(Pathway):
    """A torque turns ``bodies[0]`` counter-clockwise and ``bodies[1]`` clockwise.

    The angle is that of ``bodies[1]`` in the axes of ``bodies[0]``.  Where the bodies swing against each other, its
    excess over a free one is continuous, and the mean of it over a turn of the driver lies within half a turn; else it
    lies there itself, and jumps.
    """

    measure: ClassVar[Measure] = Measure(
        size="angle", size_unit="rad", example="90 deg", amount="torque", amount_unit="N*m"
    )

    bodies: tuple[str, str] = BODIES.declared()

    def act(self, force: Force, setting: Setting) -> Action:
        """Relative angle and its rate."""
        one, two = (setting.linkage.pose(body) for body in self.bodies)
        first, second = (one.cos, one.sin), (two.cos, two.sin)

        def excess(free: sp.Expr) -> sp.Expr:
            from_free = (sp.cos(free), sp.sin(free))
            turned = (dot(first, second), cross(first, second))
            sin, cos, linkage = cross(from_free, turned), dot(from_free, turned), setting.linkage
            closed = (linkage.turns, *linkage.positions)
            turns, mean = (sp.Symbol(f"{force.label}.{name}", real=True) for name in ("turns", "mean_excess"))
            swings = sp.Max(1 - sp.Abs(turns), 0)
            words = f"the bodies of {force.name} against each other"
            setting.constants.extend(
                Definition(symbol=s, expression=e, unit=u, description=d, latex=f"{letter}_{{{subscript(force.name)}}}")
                for s, e, u, d, letter in (
                    (turns, Turns(cos, sin, *closed), "1", f"Turns of {words} in a turn of the driver", "n"),
                    (mean, swings * Mean(cos, sin, 0, *closed), "rad", f"Mean excess of {words}, if they swing", "m"),
                )
            )
            ahead, across = sp.cos(mean), sp.sin(mean)
            return mean + sp.atan2(sin * ahead - cos * across, cos * ahead + sin * across)

        def loads(torque: sp.Expr) -> tuple[AppliedLoad, ...]:
            signed = zip(self.bodies, (torque, -torque), strict=True)
            return tuple(AppliedLoad(body=body, torque=on) for body, on in signed if body != FRAME)

        return Action(loads=loads, excess=excess, rate=two.rate - one.rate)

    def words(self) -> str:
        """The two bodies."""
        return f"torque between {self.bodies[0]} and {self.bodies[1]}"

    def usual(self, force: Force) -> Iterable[UsualInfo]:
        """No whole turns, where the law depends on the angle."""
        if getattr(force.law, "free", None) is not None:
            hint = (
                "Torsion springs and stops are for bodies that swing: half a turn from the free angle the torque jumps."
            )
            yield UsualInfo(names=(f"{force.label}.turns",), least=0.0, most=0.0, hint=hint)
