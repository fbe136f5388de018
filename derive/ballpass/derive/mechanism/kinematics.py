"""Plane motion of a rigid body in symbols, and the ledger of named definitions, which keeps expressions small.

A `Ledger` turns an expression into a named symbol and remembers the definition; a `Pose` says where a body is and how
it moves, and gives the motion of any of its points.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import sympy as sp

from ballpass.derive.mechanism.vectors import ZERO, Pair, add, quarter_turn, rotate, scale, subtract
from ballpass.derive.scene.mechanism_records import CENTER_OF_MASS, Body, Joint, Mechanism
from ballpass.derive.scene.quantity import Vector
from ballpass.derive.scene.table import FRAME
from ballpass.derive.terms import Definition, components, defined, subscript, symbol_of


class AxialPoint(tuple[sp.Expr, sp.Expr]):
    """Coordinates [m] of a point in body axes that has a place along the shaft [m]."""

    place: sp.Expr

    def __new__(cls, point: Pair, place: sp.Expr) -> AxialPoint:
        """The point at a place."""
        found = super().__new__(cls, point)
        found.place = place
        return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """Position [m], velocity [m/s] and acceleration [m/s^2] of a point in the frame's axes."""

    position: Pair
    velocity: Pair
    acceleration: Pair


AT_REST = Motion(position=ZERO, velocity=ZERO, acceleration=ZERO)

#: Joints whose two points do not coincide: by name, motion of the second body's point relative to the first body's.
Play = Mapping[str, Motion]


def displaced(motion: Motion, by: Motion | None, times: sp.Expr | int) -> Motion:
    """The motion of a point at the distance `by` `times`; the motion itself for None."""
    if by is None or times == 0:
        return motion
    one, two = (motion.position, motion.velocity, motion.acceleration), (by.position, by.velocity, by.acceleration)
    position, velocity, acceleration = (add(a, scale(sp.sympify(times), b)) for a, b in zip(one, two, strict=True))
    return Motion(position=position, velocity=velocity, acceleration=acceleration)


@dataclass(frozen=True, slots=True, kw_only=True)
class Turn:
    """How a body is turned, and turns.

    Attributes
    ----------
    cos, sin : of the angle of the body's x axis from +x [1]
    rate : angular velocity, counter-clockwise [rad/s]; structurally zero for a slider on a fixed guide
    acceleration : angular acceleration [rad/s^2]
    angle : with its whole turns, where it grows in proportion to the driver's [rad]; else None
    """

    cos: sp.Expr
    sin: sp.Expr
    rate: sp.Expr
    acceleration: sp.Expr
    angle: sp.Expr | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose(Turn):
    """Where a body is and how it moves.

    Attributes
    ----------
    body : name of the body
    anchor : the body point, in body axes, from which other points are reached [m]
    anchor_motion : its motion
    origin : motion of the body's origin
    center_of_mass : motion of the centre of mass; its accelerations are defined symbols where they are not trivial
    slope : of the body's axis along the shaft, and its rates, where it tilts
    """

    body: str
    anchor: Pair
    anchor_motion: Motion
    origin: Motion
    center_of_mass: Motion
    slope: Motion | None = None

    def rotate(self, vector: Pair) -> Pair:
        """A vector given in body axes, in the frame's axes."""
        return rotate(self.cos, self.sin, vector)

    def motion(self, point: Pair) -> Motion:
        """Motion of the body point with coordinates `point` [m] in body axes."""
        arm = self.rotate(subtract(point, self.anchor))
        moved = carried(self.anchor_motion, arm, self.rate, self.acceleration)
        return displaced(moved, self.slope, point.place if isinstance(point, AxialPoint) else 0)


def carried(anchor: Motion, arm: Pair, rate: sp.Expr, acceleration: sp.Expr) -> Motion:
    """Motion of a point that a rotating body carries at `arm` [m] from its point with the motion `anchor`."""
    turned = quarter_turn(arm)
    return Motion(
        position=add(anchor.position, arm),
        velocity=add(anchor.velocity, scale(rate, turned)),
        acceleration=add(anchor.acceleration, scale(acceleration, turned), scale(-(rate**2), arm)),
    )


class Ledger:
    """Ordered definitions of one derivation: ``symbol := expression``."""

    def __init__(self) -> None:
        self._definitions: list[Definition] = []

    @property
    def definitions(self) -> tuple[Definition, ...]:
        """What has been named so far; each uses earlier ones only."""
        return tuple(self._definitions)

    def define(self, name: str, expression: sp.Expr, unit: str, description: str, latex: str) -> sp.Symbol:
        """Define a symbol for the expression and return it."""
        self._definitions.append(defined(name, expression, unit, description[0].upper() + description[1:], latex))
        return self._definitions[-1].symbol

    def name(self, name: str, expression: sp.Expr, unit: str, description: str, latex: str) -> sp.Expr:
        """As `define`, but numbers and symbols, which need no name, are returned unchanged."""
        expression = sp.sympify(expression)
        if expression.is_number or expression.is_Symbol:
            return expression
        return self.define(name, expression, unit, description, latex)

    def name_motion(self, name: str, motion: Motion, words: str, mark: str) -> Motion:
        """Name position, velocity and acceleration of a point: ``name.x``, ``.y``, ``.vx`` ... ``.ay``."""
        return Motion(
            position=self.name_pair(name, "", motion.position, "m", f"position of {words}", f"AXIS_{{{mark}}}"),
            velocity=self.name_pair(
                name, "v", motion.velocity, "m/s", f"velocity of {words}", rf"\dot{{AXIS}}_{{{mark}}}"
            ),
            acceleration=self.name_pair(
                name, "a", motion.acceleration, "m/s^2", f"acceleration of {words}", rf"\ddot{{AXIS}}_{{{mark}}}"
            ),
        )

    def name_pair(self, name: str, prefix: str, pair: Pair, unit: str, description: str, latex: str) -> Pair:
        """Name the components of a vector: ``name.<prefix>x`` and ``name.<prefix>y``; AXIS in `latex` becomes x, y."""
        x, y = (
            self.name(f"{name}.{prefix}{axis}", value, unit, f"{axis} {description}", latex.replace("AXIS", axis))
            for axis, value in zip("xy", pair, strict=True)
        )
        return x, y


def name_turn(ledger: Ledger, body: str, cos: sp.Expr, sin: sp.Expr, mark: str) -> Pair:
    """Name cosine and sine of a body's angle."""
    return (
        ledger.name(f"body.{body}.cos", cos, "1", f"cosine of the angle of {body}", f"c_{{{mark}}}"),
        ledger.name(f"body.{body}.sin", sin, "1", f"sine of the angle of {body}", f"s_{{{mark}}}"),
    )


def place(
    ledger: Ledger,
    mechanism: Mechanism,
    body: str,
    turn: Turn,
    anchor: Pair,
    anchor_motion: Motion,
    slope: Motion | None = None,
) -> Pose:
    """The `Pose` of a moving body; the acceleration of its centre of mass gets names for the equations of motion."""
    center = _at_place(mechanism.body(body), CENTER_OF_MASS, mechanism.body(body).center_of_mass)
    bare = Pose(
        body=body,
        cos=turn.cos,
        sin=turn.sin,
        rate=turn.rate,
        acceleration=turn.acceleration,
        angle=turn.angle,
        anchor=anchor,
        anchor_motion=anchor_motion,
        origin=anchor_motion,
        center_of_mass=anchor_motion,
        slope=slope,
    )
    mass_point = bare.motion(center)
    named = ledger.name_pair(
        f"body.{body}.center_of_mass",
        "a",
        mass_point.acceleration,
        "m/s^2",
        f"acceleration of the centre of mass of {body}",
        rf"\ddot{{AXIS}}_{{o,{subscript(body)}}}",
    )
    return replace(bare, origin=bare.motion(ZERO), center_of_mass=replace(mass_point, acceleration=named))


def frame_pose() -> Pose:
    """The frame: at rest, its axes those of the plane."""
    return Pose(
        body=FRAME,
        cos=sp.S.One,
        sin=sp.S.Zero,
        rate=sp.S.Zero,
        acceleration=sp.S.Zero,
        angle=sp.S.Zero,
        anchor=ZERO,
        anchor_motion=AT_REST,
        origin=AT_REST,
        center_of_mass=AT_REST,
    )


def body_point(mechanism: Mechanism, body: str, point: str) -> Pair:
    """Coordinates [m] of a named point in the axes of its body or of the frame."""
    if body == FRAME:
        return components(next(p.position for p in mechanism.frame_points if p.name == point))
    return _at_place(mechanism.body(body), point, mechanism.body(body).point(point))


def _at_place(body: Body, name: str, vector: Vector) -> Pair:
    point, place = components(vector), dict(body.positions).get(name)
    return point if place is None else AxialPoint(point, symbol_of(place))


def joint_point(mechanism: Mechanism, joint: Joint, body: str) -> Pair:
    """Coordinates [m] of a joint's point in the axes of one of its bodies."""
    return body_point(mechanism, body, joint.point(body))


def name_joint(ledger: Ledger, joint: Joint, motion: Motion) -> Motion:
    """The motion of a joint under the names ``joint.<name>.x`` and so on."""
    return ledger.name_motion(f"joint.{joint.name}", motion, f"joint {joint.name}", subscript(joint.name))
