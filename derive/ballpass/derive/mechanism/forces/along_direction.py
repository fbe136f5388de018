"""Pathway: the distance of a body's point from a wall of another body, or of the frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import sympy as sp

from ballpass.derive.mechanism.balance import AppliedLoad
from ballpass.derive.mechanism.forces.force import Action, Measure, Pathway, Setting
from ballpass.derive.mechanism.kinematics import body_point
from ballpass.derive.mechanism.vectors import cross, dot, scale, subtract, unit
from ballpass.derive.scene.body_keys import BODIES, POINTS
from ballpass.derive.scene.mechanism_records import Force
from ballpass.derive.scene.quantity import SceneNumber
from ballpass.derive.scene.read_keys import quantity
from ballpass.derive.terms import subscript, symbol_of
from ballpass.derive.variables import Output


@dataclass(frozen=True, slots=True, kw_only=True)
class AlongDirection(Pathway):
    """A wall through ``points[0]`` that ``bodies[0]`` carries, normal to `direction` [rad] in its axes.

    The size is the distance of ``points[1]`` of ``bodies[1]`` from it, positive where the direction points.
    """

    key: ClassVar[str] = "direction"
    measure: ClassVar[Measure] = Measure(
        size="distance", size_unit="m", example="2 mm", amount="tension", amount_unit="N"
    )

    bodies: tuple[str, str] = BODIES.declared()
    points: tuple[str, str] = POINTS.declared()
    direction: SceneNumber = quantity(
        "rad", "Direction of NAME in the axes of its first body", r"\alpha_{INDEX}", "90 deg"
    )

    def act(self, force: Force, setting: Setting) -> Action:
        """Distance and its rate; the force on the wall acts where the point is."""
        mechanism, ledger, label, mark = setting.linkage.mechanism, setting.ledger, force.label, subscript(force.name)
        places = [body_point(mechanism, *end) for end in zip(self.bodies, self.points, strict=True)]
        poses = [setting.linkage.pose(body) for body in self.bodies]
        one, two = (pose.motion(place) for pose, place in zip(poses, places, strict=True))
        wall, words = poses[0], f"the point of {force.name} from its wall"
        along = wall.rotate(unit(symbol_of(self.direction)))
        along = ledger.name_pair(
            f"{label}.normal", "", along, "1", f"component of the normal of {force.name}", f"n_{{{mark},AXIS}}"
        )
        line = ledger.name_pair(
            f"{label}.line", "", subtract(two.position, one.position), "m", f"distance of {words}", f"d_{{{mark},AXIS}}"
        )
        distance = ledger.define(f"{label}.distance", dot(along, line), "m", f"distance of {words}", f"L_{{{mark}}}")
        setting.outputs.append(
            Output(name=distance.name, expression=distance, unit="m", description=f"Distance of {words}")
        )

        def loads(tension: sp.Expr) -> tuple[AppliedLoad, ...]:
            pull = scale(tension, along)
            (one, other), (at, end), back = self.bodies, self.points, scale(sp.Integer(-1), pull)
            return (
                AppliedLoad(body=one, at=at, point=places[0], force=pull, torque=cross(line, pull)),
                AppliedLoad(body=other, at=end, point=places[1], force=back),
            )

        rate = dot(along, subtract(two.velocity, one.velocity)) + wall.rate * cross(along, line)
        return Action(loads=loads, excess=lambda free: distance - free, rate=rate)

    def words(self) -> str:
        """Point and wall."""
        wall, point = (".".join(end) for end in zip(self.bodies, self.points, strict=True))
        return f"force on {point} from a wall at {wall}"
