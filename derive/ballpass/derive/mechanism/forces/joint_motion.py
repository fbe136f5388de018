"""Pathways: the relative motion that a joint allows, the angle of a hinge or the distance along a guide."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Literal

from ballpass.derive.mechanism.balance import AppliedLoad
from ballpass.derive.mechanism.forces.force import Action, Measure, Pathway, Setting
from ballpass.derive.mechanism.kinematics import joint_point
from ballpass.derive.mechanism.vectors import dot, scale, subtract
from ballpass.derive.scene.errors import Fault
from ballpass.derive.scene.keys import TextKey
from ballpass.derive.scene.mechanism_records import Force, Joint


@dataclass(frozen=True, slots=True, kw_only=True)
class JointMotion(Pathway):
    """The motion of ``bodies[1]`` of a joint against ``bodies[0]``; an amount works against a positive rate."""

    kind: ClassVar[Literal["revolute", "prismatic"]]
    other: ClassVar[str]

    joint: str = TextKey(
        words="The joint",
        example="B",
        note="revolute (friction) or prismatic (guide friction), with or without a bearing",
    ).declared()

    def act(self, force: Force, setting: Setting) -> Action:
        """Rate of the joint, and the loads on its bodies by an amount."""
        joints = {joint.name: joint for joint in setting.linkage.mechanism.joints}
        joint = joints.get(self.joint)
        if joint is None or joint.kind != self.kind:
            fits = [name for name, other in joints.items() if other.kind == self.kind]
            given = "there is no such joint" if joint is None else f"this joint is {joint.kind}"
            raise Fault(
                key=f"mechanism.{force.table}.{force.name}.joint",
                problem=f"{given}, and [mechanism.{force.table}] is for {self.kind} joints",
                given=f'"{self.joint}"',
                allowed=", ".join(fits) or f"nothing: the linkage has no {self.kind} joint",
                remedy="name one of these" if joint is None else f"write [mechanism.{self.other}.{force.name}]",
            ).of_linkage()
        return self.along(joint, setting)

    @abstractmethod
    def along(self, joint: Joint, setting: Setting) -> Action:
        """The action at a joint of the right kind."""

    def words(self) -> str:
        """The joint."""
        return f"friction of joint {self.joint}"


@dataclass(frozen=True, slots=True, kw_only=True)
class JointTurn(JointMotion):
    """At a revolute joint: a torque turns ``bodies[0]`` counter-clockwise and ``bodies[1]`` clockwise."""

    kind = "revolute"
    other = "guide_friction"
    column: ClassVar[str] = "torque"
    measure: ClassVar[Measure] = Measure(
        size="angle", size_unit="rad", example="1 rad/s", amount="torque", amount_unit="N*m"
    )

    def along(self, joint: Joint, setting: Setting) -> Action:
        """Relative angular velocity; play of the joint does not change it."""
        one, two = (setting.linkage.pose(body) for body in joint.bodies)
        return Action(
            loads=lambda torque: tuple(
                AppliedLoad(body=body, torque=on) for body, on in zip(joint.bodies, (torque, -torque), strict=True)
            ),
            rate=two.rate - one.rate,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class JointTravel(JointMotion):
    """At a prismatic joint: a force pushes ``bodies[0]`` along the guide and ``bodies[1]`` back."""

    kind = "prismatic"
    other = "friction"
    measure: ClassVar[Measure] = Measure(
        size="travel", size_unit="m", example="10 mm/s", amount="force", amount_unit="N"
    )

    def along(self, joint: Joint, setting: Setting) -> Action:
        """Rate of the travel; both points of the joint lie on one line along the guide, in which the force acts."""
        guides = (guide for placement in setting.linkage.placements for guide in placement.guides)
        guide = next(guide for guide in guides if guide.joint == joint)
        places = [joint_point(setting.linkage.mechanism, joint, body) for body in joint.bodies]
        one, two = (setting.linkage.pose(body).motion(place) for body, place in zip(joint.bodies, places, strict=True))
        return Action(
            loads=lambda force: tuple(
                AppliedLoad(body=body, point=place, force=scale(on, guide.direction))
                for body, place, on in zip(joint.bodies, places, (force, -force), strict=True)
            ),
            rate=dot(guide.direction, subtract(two.velocity, one.velocity)),
        )
