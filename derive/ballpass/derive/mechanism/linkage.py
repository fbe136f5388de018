"""From geometry to kinematics: positions, velocities and accelerations of a planar linkage with one driver.

In: a `Mechanism` and its `Drive`.  Out: one frozen `Linkage`.  Structure only: numbers are symbols named by their path
in the scene (law 1).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
import sympy as sp

from ballpass.derive.drive import Drive
from ballpass.derive.mechanism.assembly import assemble
from ballpass.derive.mechanism.balance import JointAction
from ballpass.derive.mechanism.dyads import Group, Margin, Placement
from ballpass.derive.mechanism.evaluator import Evaluator
from ballpass.derive.mechanism.kinematics import (
    Ledger,
    Motion,
    Play,
    Pose,
    Turn,
    body_point,
    displaced,
    frame_pose,
    joint_point,
    name_turn,
    place,
)
from ballpass.derive.mechanism.vectors import Pair
from ballpass.derive.scene.errors import Fault
from ballpass.derive.scene.mechanism_records import CENTER_OF_MASS, Joint, Mechanism
from ballpass.derive.scene.table import FRAME
from ballpass.derive.terms import Definition, subscript

#: Joints that keep their two points together.
NO_PLAY: Play = MappingProxyType({})


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedPoint:
    """Place [m] of a point of a body, or of its centre of mass, in the frame's axes."""

    body: str
    point: str
    x: sp.Expr
    y: sp.Expr


@dataclass(frozen=True, slots=True, kw_only=True)
class Linkage:
    """Kinematics of a linkage as functions of the driver's motion.

    Attributes
    ----------
    drive : what turns the driven body
    driver : the driver's joint
    driven : the driven body
    definitions : ordered; each uses parameters, the drive's symbols and earlier ones only
    poses : by body, in the order of assembly; the frame is none of them
    placements : the dyads, placed, in the order of assembly
    points : all points of the frame and of the bodies, and the centres of mass, for drawing
    play : joints whose two points do not coincide
    """

    mechanism: Mechanism
    drive: Drive
    driver: Joint
    driven: str
    definitions: tuple[Definition, ...]
    poses: Mapping[str, Pose]
    placements: tuple[Placement, ...]
    points: tuple[PlacedPoint, ...]
    play: Play

    @property
    def positions(self) -> tuple[sp.Basic, ...]:
        """The coordinates of play, and of tilts: zero in the ideal linkage."""
        slope = self.poses[self.driven].slope
        moving = (*self.play.values(), *(() if slope is None else (slope,)))
        found = {symbol for motion in moving for e in motion.position for symbol in e.free_symbols}
        return tuple(sp.ordered(found))

    @property
    def dyads(self) -> tuple[Group, ...]:
        """And wheels in mesh, in the order of assembly."""
        return tuple(p.dyad for p in self.placements)

    @property
    def contacts(self) -> tuple[Joint, ...]:
        """Joints, and gears as joints."""
        return (*self.mechanism.joints, *(mesh.joint for mesh in self.meshes))

    @property
    def meshes(self) -> tuple[JointAction, ...]:
        """Contacts that are no joints of the mechanism."""
        return tuple(mesh for p in self.placements if (mesh := p.dyad.meshing(p)) is not None)

    @property
    def turns(self) -> int:
        """Turns of the driver, or periods of its swing, after which all bodies are where they were."""
        return self.turns_of(self.drive.angle)

    def turns_of(self, driver: sp.Expr) -> int:
        """Turns of the driver's angle, or of the driven body's, after which they are."""
        angles = (pose.angle for pose in self.poses.values())
        ratios = (sp.diff(angle, driver) for angle in angles if angle is not None)
        return math.lcm(*(sp.Rational(ratio).q for ratio in ratios))

    @property
    def margins(self) -> tuple[Margin, ...]:
        """Where each dyad can be assembled, in the same order."""
        return tuple(p.margin for p in self.placements)

    def pose(self, body: str) -> Pose:
        """Pose of a moving body or of the frame."""
        return frame_pose() if body == FRAME else self.poses[body]

    def motion(self, body: str, point: str) -> Motion:
        """Motion of a named point of a body."""
        return self.pose(body).motion(body_point(self.mechanism, body, point))


def derive_linkage(mechanism: Mechanism, drive: Drive, play: Play = NO_PLAY, slope: Motion | None = None) -> Linkage:
    """Derive the kinematics of a linkage.

    Parameters
    ----------
    mechanism : bodies, joints and driver
    drive : angle, speed and acceleration of the driven body
    play : joints whose two points do not coincide
    slope : of the axis of the driven body, where it tilts

    Raises
    ------
    LinkageError
        wrong mobility, bodies that no sequence of dyads reaches, a branch that is missing, of the wrong kind, or set
        where it means nothing.
    """
    dyads = assemble(mechanism)
    driver, ledger = mechanism.joint(mechanism.driver.joint), Ledger()
    driven = _place_driven(ledger, mechanism, driver, drive, play, slope)
    poses = {FRAME: frame_pose(), driven.body: driven}
    placements = []
    for dyad in dyads:
        placement = dyad.place(ledger, mechanism, poses, play)
        poses |= {pose.body: pose for pose in placement.poses}
        placements.append(placement)
    moving = {name: pose for name, pose in poses.items() if name != FRAME}
    return Linkage(
        mechanism=mechanism,
        drive=drive,
        driver=driver,
        driven=driven.body,
        definitions=ledger.definitions,
        poses=MappingProxyType(moving),
        placements=tuple(placements),
        points=_points(mechanism, poses),
        play=play,
    )


def check_assembly(linkage: Linkage, values: Mapping[str, float]) -> None:
    """Refuse numbers with which the linkage cannot be assembled at its start.

    Parameters
    ----------
    linkage : from `derive_linkage`
    values : SI value of every parameter, by its path

    Raises
    ------
    LinkageError
        a dyad that cannot be assembled: names the joint and the crank angle in degrees.
    KeyError
        a parameter without a value.
    """
    driven, start = linkage.poses[linkage.driven], values[linkage.mechanism.driver.start_angle.path]
    numbers: dict[sp.Symbol, Any] = {sp.Symbol(name, real=True): np.float64(v) for name, v in values.items()}
    numbers |= dict.fromkeys(linkage.positions, 0.0) | {driven.cos: np.cos(start), driven.sin: np.sin(start)}
    of_drive = sp.sympify(driven.angle).free_symbols - numbers.keys()  # the angle, or the phase of a swing
    numbers |= {symbol: start if symbol == driven.angle else 0.0 for symbol in of_drive}
    evaluator = Evaluator(linkage.definitions, [m.expression for m in linkage.margins])
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        margins = [float(margin) for margin in evaluator(numbers)]
    for margin, placement in zip(margins, linkage.placements, strict=True):
        if not margin > 0.0:  # dyads behind it cannot be placed
            joints = ", ".join(placement.dyad.joints)
            raise Fault(
                key=f"mechanism.joints.{placement.margin.joint}",
                problem=f"the linkage cannot be assembled at joint {placement.margin.joint} at the crank angle of its "
                f"start, {np.rad2deg(start):.4f} deg",
                given=f"{placement.margin.description}: {margin:.6g} there"
                + ("" if math.isfinite(margin) else ": is a length zero?"),
                allowed="above 0",
                remedy=f"change the lengths between joints {joints}, or mechanism.driver.start_angle",
            ).of_linkage()


def _place_driven(
    ledger: Ledger, mechanism: Mechanism, driver: Joint, drive: Drive, play: Play, slope: Motion | None
) -> Pose:
    body = driver.other(FRAME)
    mark, (angle, rate, acceleration) = subscript(body), drive.driven
    cos, sin = name_turn(ledger, body, sp.cos(angle), sp.sin(angle), mark)
    # Zero, but a symbol: Eq. (1) prints the crank's moment of inertia with it.
    acceleration = ledger.define(
        f"body.{body}.angular_acceleration",
        acceleration,
        "rad/s^2",
        f"angular acceleration of {body}: {drive.description}",
        rf"\ddot{{\varphi}}_{{{mark}}}",
    )
    pivot = frame_pose().motion(joint_point(mechanism, driver, FRAME))
    pivot = displaced(pivot, play.get(driver.name), 1 if driver.bodies[1] == body else -1)
    turn = Turn(cos=cos, sin=sin, rate=rate, acceleration=acceleration, angle=angle)
    return place(ledger, mechanism, body, turn, joint_point(mechanism, driver, body), pivot, slope)


def _points(mechanism: Mechanism, poses: Mapping[str, Pose]) -> tuple[PlacedPoint, ...]:
    points = []
    for name in (p.name for p in mechanism.frame_points):
        points.append(_placed(FRAME, name, poses[FRAME].motion(body_point(mechanism, FRAME, name)).position))
    for body in mechanism.bodies:
        pose = poses[body.name]
        for name in (p.name for p in body.points):
            points.append(_placed(body.name, name, pose.motion(body_point(mechanism, body.name, name)).position))
        points.append(_placed(body.name, CENTER_OF_MASS, pose.center_of_mass.position))
    return tuple(points)


def _placed(body: str, point: str, position: Pair) -> PlacedPoint:
    return PlacedPoint(body=body, point=point, x=position[0], y=position[1])
