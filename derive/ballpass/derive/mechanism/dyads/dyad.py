"""The interface of an Assur dyad: it places two bodies at once and solves their joint reactions.

Each kind is one class in a file of its own, listed in `dyads/__init__.py`.  It says which joints form it and what its
branches are called (find), gives the poses of its bodies in closed form (place), and walks its balances (reactions).

Positions need one square root and no inverse function: cosine and sine of a body's angle are the quotient of its span
in the plane and its span in body axes, taken as complex numbers.  Rates follow from the differentiated loop closure,
two equations at a time, by Cramer's rule.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal, Self

import sympy as sp

from ballpass.derive.mechanism.balance import Balance, Guide, Mesh
from ballpass.derive.mechanism.kinematics import (
    Ledger,
    Motion,
    Play,
    Pose,
    displaced,
    joint_point,
    name_joint,
    name_turn,
    subscript,
)
from ballpass.derive.mechanism.vectors import Pair, add, cross, dot, quarter_turn, scale, subtract
from ballpass.derive.scene.errors import Fault
from ballpass.derive.scene.mechanism_records import Joint, Mechanism
from ballpass.derive.terms import symbol_of
from ballpass.derive.variables import Words


@dataclass(frozen=True, slots=True, kw_only=True)
class Margin:
    """Where a dyad can be assembled: `expression` [1] is positive inside, zero at the limit, negative outside."""

    joint: str
    expression: sp.Expr
    description: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Group(ABC):
    """Bodies that are placed together: a dyad, or a wheel in mesh.

    Attributes
    ----------
    bodies, hosts : what is placed, and the bodies already placed that carry or turn them
    """

    bodies: tuple[str, ...]
    hosts: tuple[str, ...]

    @property
    @abstractmethod
    def joints(self) -> tuple[str, ...]:
        """Names of the joints that the bodies are placed by."""

    @property
    def outputs(self) -> Sequence[Words]:
        """Of what `solve` defines besides reactions."""
        return ()

    @property
    def circles(self) -> tuple[str, str, str, str, float] | None:
        """Bodies and points on the axes of two wheels in mesh, and the first one's share of their distance."""
        return None

    def meshing(self, placement: Placement) -> Mesh | None:
        """A contact of the bodies that is no joint of the mechanism."""
        return None

    @abstractmethod
    def place(self, ledger: Ledger, mechanism: Mechanism, poses: Mapping[str, Pose], play: Play) -> Placement:
        """Place the bodies on those in `poses`, writing the definitions into `ledger`.

        Where a joint has `play`, each body has a point of its own there.

        Raises
        ------
        LinkageError
            a body whose two joints of a dyad sit on one and the same point; play that moves an axis of a gear.
        """

    @abstractmethod
    def solve(self, ledger: Ledger, balance: Balance, placement: Placement) -> None:
        """Define the reactions of the group's joints; those of later groups are known to `balance`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Dyad(Group):
    """Two bodies with a joint between them, each with one joint to a body already placed.

    Attributes
    ----------
    kind : R (revolute) or P (prismatic) for each of outer joint of the first body, inner joint, outer joint of the
        second
    branches : values of `Joint.branch` at the inner joint; the first has the sign +1.  A dyad with one position has
        one, which a scene may leave out
    words : its joints, for messages
    bodies : in the order of `kind`; where that can be read from both ends, in the order of the inner joint's bodies
    hosts : the bodies already placed that carry them
    outer, inner : joints, `outer` in the order of `bodies`
    """

    kind: ClassVar[str]
    branches: ClassVar[tuple[str, ...]]
    words: ClassVar[str]

    bodies: tuple[str, str]
    hosts: tuple[str, str]
    outer: tuple[Joint, Joint]
    inner: Joint

    @classmethod
    def find(cls, inner: Joint, outer: tuple[Joint, Joint]) -> Self | None:
        """The dyad of these joints; None where they form another one.

        Parameters
        ----------
        inner : joint between two bodies that have no place yet
        outer : the joint of each of them to a body already placed, in the order of ``inner.bodies``
        """
        letters = {"revolute": "R", "prismatic": "P"}
        for order in ((0, 1), (1, 0)):
            joints = (outer[order[0]], inner, outer[order[1]])
            if "".join(letters[joint.kind] for joint in joints) == cls.kind:
                first, second = (inner.bodies[k] for k in order)
                one, two = (outer[k] for k in order)
                hosts = (one.other(first), two.other(second))
                return cls(bodies=(first, second), hosts=hosts, outer=(one, two), inner=inner)
        return None

    @property
    def joints(self) -> tuple[str, str, str]:
        """Names: outer joint of the first body, inner joint, outer joint of the second body."""
        return self.outer[0].name, self.inner.name, self.outer[1].name

    @property
    def sign(self) -> int:
        """+1 on the first of the branches, −1 on the second."""
        return 1 if self.inner.branch in (None, self.branches[0]) else -1

    def closing(self, second: Motion, play: Play) -> Motion:
        """A point of the second body, shifted so that the loop closes as if the inner joint had no play."""
        return displaced(second, play.get(self.inner.name), -1 if self.inner.bodies[0] == self.bodies[0] else 1)

    @abstractmethod
    def branch_meaning(self) -> str:
        """The choice between the branches, as "on which side of ... the joint lies"."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Placement:
    """A group once it is placed.

    Attributes
    ----------
    dyad : what was placed
    poses : of its bodies, in their order
    spans : vectors [m] that the reactions need; each kind says which
    determinant : of the 2×2 systems for rates and forces
    margin : where it can be assembled
    guides : of its prismatic joints
    """

    dyad: Group
    poses: tuple[Pose, ...]
    spans: tuple[Pair, ...]
    determinant: sp.Expr
    margin: Margin
    guides: tuple[Guide, ...] = ()


def name_hinge(ledger: Ledger, mechanism: Mechanism, joint: Joint, host: Pose, play: Play) -> Motion:
    """Motion of the point that a new body has at a revolute joint on a body already placed.

    That of the host is named ``joint.<name>.x`` and so on; where the joint has play, that of the new body ``joint.
    <name>.<body>.x``.
    """
    motion = name_joint(ledger, joint, host.motion(joint_point(mechanism, joint, host.body)))
    if joint.name not in play:
        return motion
    body = joint.other(host.body)
    moved = displaced(motion, play[joint.name], 1 if joint.bodies[1] == body else -1)
    words, mark = f"joint {joint.name} on {body}", f"{subscript(joint.name)},{subscript(body)}"
    return ledger.name_motion(f"joint.{joint.name}.{body}", moved, words, mark)


def name_path(
    ledger: Ledger, mechanism: Mechanism, inner: Joint, guide: Joint, host: Pose, slider: str, point: Pair
) -> Motion:
    """Motion of the place on the host where a point of the slider [m] is while both points of the guide coincide.

    `inner` names the joint that is at this point.
    """
    rail, shoe = (joint_point(mechanism, guide, body) for body in (host.body, slider))
    words = f"the path of joint {inner.name} where the points of {guide.name} coincide"
    path = host.motion(add(rail, subtract(point, shoe)))
    return ledger.name_motion(f"joint.{guide.name}.base", path, words, f"0,{subscript(guide.name)}")


def slid(fellow: Motion, rate: sp.Expr, direction: Pair, speed: sp.Expr, acceleration: sp.Expr) -> Motion:
    """Motion of a point that slides over a body, whose point there has the motion `fellow`, and which turns."""
    coriolis = scale(2 * rate * speed, quarter_turn(direction))
    return Motion(
        position=fellow.position,
        velocity=add(fellow.velocity, scale(speed, direction)),
        acceleration=add(fellow.acceleration, coriolis, scale(acceleration, direction)),
    )


def body_span(mechanism: Mechanism, body: str, outer: Joint, inner: Joint) -> tuple[Pair, Pair]:
    """Point of the outer joint, and vector from it to the inner joint, in body axes [m].

    Raises
    ------
    LinkageError
        both joints sit on one and the same point.
    """
    start = joint_point(mechanism, outer, body)
    span = subtract(joint_point(mechanism, inner, body), start)
    if span[0].is_zero and span[1].is_zero:
        raise Fault(
            key=f"mechanism.bodies.{body}.points",
            problem=f"joints {outer.name} and {inner.name} sit on the same point of {body}",
            given=f"points {outer.point(body)} and {inner.point(body)}",
            allowed="two points at a distance",
            remedy="give one of them another place",
        ).of_linkage()
    return start, span


def span_length(ledger: Ledger, body: str, span: Pair) -> sp.Expr:
    """Length of a span [m], up to its sign, which no formula of this module depends on.

    A span along a body axis is its own length: no square root of a square.
    """
    if span[1].is_zero:
        return span[0]
    if span[0].is_zero:
        return span[1]
    return ledger.define(
        f"body.{body}.length",
        sp.sqrt(span[0] ** 2 + span[1] ** 2),
        "m",
        f"distance of the two joints of {body}",
        f"l_{{{subscript(body)}}}",
    )


def name_base(ledger: Ledger, inner: Joint, names: str, ends: Sequence[Motion]) -> tuple[Pair, sp.Expr]:
    """Name the vector between the outer joints, and its square; `names`: from which joint to which."""
    prefix, mark = f"joint.{inner.name}", subscript(inner.name)
    base = ledger.name_pair(
        f"{prefix}.base",
        "",
        subtract(ends[1].position, ends[0].position),
        "m",
        f"component of the line {names}",
        f"d_{{{mark},AXIS}}",
    )
    square = ledger.define(
        f"{prefix}.base_squared", dot(base, base), "m^2", f"square of the distance {names}", f"d_{{{mark}}}^{{2}}"
    )
    return base, square


def name_span(ledger: Ledger, body: str, vector: Pair) -> Pair:
    """Name the vector from a body's outer joint to its inner joint, in the frame's axes."""
    return ledger.name_pair(
        f"body.{body}.span",
        "",
        vector,
        "m",
        f"component of the vector between the two joints of {body}",
        f"u_{{{subscript(body)},AXIS}}",
    )


def turn_by_span(ledger: Ledger, body: str, vector: Pair, span: Pair, length: sp.Expr) -> Pair:
    """Cosine and sine of the body's angle: `vector` in the plane divided by `span` in body axes."""
    cos, sin = dot(span, vector) / length**2, cross(span, vector) / length**2
    return name_turn(ledger, body, cos, sin, subscript(body))


def name_rate(ledger: Ledger, body: str, rate: sp.Expr) -> sp.Expr:
    """Name the angular velocity of a body."""
    latex = rf"\dot{{\varphi}}_{{{subscript(body)}}}"
    return ledger.name(f"body.{body}.rate", rate, "rad/s", f"angular velocity of {body}", latex)


def name_acceleration(ledger: Ledger, body: str, acceleration: sp.Expr) -> sp.Expr:
    """Name the angular acceleration of a body."""
    latex = rf"\ddot{{\varphi}}_{{{subscript(body)}}}"
    name = f"body.{body}.angular_acceleration"
    return ledger.name(name, acceleration, "rad/s^2", f"angular acceleration of {body}", latex)


def guide_axis(guide: Joint) -> Pair:
    """Unit vector of a guide in the axes of its bodies."""
    assert guide.direction is not None  # a prismatic joint has a direction
    angle = symbol_of(guide.direction)
    return sp.cos(angle), sp.sin(angle)


def name_direction(ledger: Ledger, guide: Joint, direction: Pair) -> Pair:
    """Name the unit vector of a guide in the frame's axes."""
    return ledger.name_pair(
        f"joint.{guide.name}.direction",
        "",
        direction,
        "1",
        f"component of the direction of guide {guide.name}",
        f"t_{{{subscript(guide.name)},AXIS}}",
    )


def name_travel(
    ledger: Ledger, guide: Joint, slider: str, order: Literal["", "speed", "acceleration"], value: sp.Expr
) -> sp.Expr:
    """Name the travel [m] along a guide or, by `order`, its speed or acceleration."""
    unit, accent = {"": ("m", "s"), "speed": ("m/s", r"\dot{s}"), "acceleration": ("m/s^2", r"\ddot{s}")}[order]
    word, latex = order or "travel", f"{accent}_{{{subscript(guide.name)}}}"
    return ledger.name(f"joint.{guide.name}.{word}", value, unit, f"{word} of {slider} along guide {guide.name}", latex)


def name_travels(
    ledger: Ledger,
    guides: tuple[tuple[Joint, str, Pair], tuple[Joint, str, Pair]],
    order: Literal["", "speed", "acceleration"],
    way: Pair,
    determinant: sp.Expr,
) -> tuple[sp.Expr, sp.Expr]:
    """Name the components of a vector along two guides: joint, slider and direction of each.

    `determinant` is the cross product of both directions.
    """
    one, two = guides
    return (
        name_travel(ledger, one[0], one[1], order, cross(way, two[2]) / determinant),
        name_travel(ledger, two[0], two[1], order, cross(one[2], way) / determinant),
    )


def name_crossing(
    ledger: Ledger, inner: Joint, guides: tuple[Joint, Joint], directions: tuple[Pair, Pair]
) -> tuple[sp.Expr, Margin]:
    """Name the sine of the angle from one guide to another [1], which is zero where they are parallel; its margin."""
    words = f"guide {guides[0].name} to guide {guides[1].name}"
    latex = rf"\Delta_{{{subscript(inner.name)}}}"
    sine = ledger.define(
        f"joint.{inner.name}.determinant", cross(*directions), "1", f"sine of the angle from {words}", latex
    )
    words = f"squared sine of the angle between guides {guides[0].name} and {guides[1].name}"
    return sine, Margin(joint=inner.name, expression=sine**2, description=words)


def name_gap(ledger: Ledger, inner: Joint, order: str, gap: Pair, unit: str) -> Pair:
    """Name the right-hand side of the loop closure's derivative."""
    return ledger.name_pair(
        f"joint.{inner.name}.closure",
        order,
        gap,
        unit,
        f"component of the {'velocity' if order == 'v' else 'acceleration'} that closes the loop at {inner.name}",
        rf"\delta {order}_{{{subscript(inner.name)},AXIS}}",
    )
