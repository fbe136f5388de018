"""Assur dyads once they are placed: their records, and the parts their closed forms share.

`dyad_rrr.py` and `dyad_rrp.py` place one kind each.  Positions need one square root and no inverse function: cosine and
sine of a body's angle are the quotient of its span in the plane and its span in body axes, taken as complex numbers.
Rates follow from the differentiated loop closure, two equations at a time, by Cramer's rule.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import sympy as sp

from ballpass.derive.mechanism.assembly import Group, point_name
from ballpass.derive.mechanism.kinematics import (
    Ledger,
    Motion,
    Pair,
    Pose,
    body_point,
    cross,
    dot,
    quarter_turn,
    subscript,
    subtract,
)
from ballpass.derive.scene.errors import Fault, LinkageError
from ballpass.derive.scene.records import Joint, Mechanism


@dataclass(frozen=True, slots=True, kw_only=True)
class Guide:
    """The prismatic joint of an RRP dyad.

    Attributes
    ----------
    joint : the joint
    host, slider : the body already placed and the body that slides on it
    direction : unit vector of the guide in the frame's axes
    travel : distance [m] of the slider from where the joint's two points coincide, along `direction`
    fixed : the host is the frame, so the slider does not turn
    """

    joint: Joint
    host: str
    slider: str
    direction: Pair
    travel: sp.Expr
    fixed: bool

    @property
    def normal(self) -> Pair:
        """Unit vector to the left of `direction`."""
        return quarter_turn(self.direction)


@dataclass(frozen=True, slots=True, kw_only=True)
class Dyad:
    """A placed dyad.

    Attributes
    ----------
    kind : RRR or RRP
    bodies : RRR: in the order of the inner joint's bodies; RRP: rod, slider
    hosts : the bodies that carry them
    outer, inner : joints, `outer` in the order of `bodies`
    spans : vectors [m] from the outer to the inner joint; of the rod alone for RRP
    determinant : of the 2×2 systems for rates and forces: RRR, cross product of the spans [m^2]; RRP, component of the
        rod's span along the guide [m]
    guide : of RRP, else None
    """

    kind: Literal["RRR", "RRP"]
    bodies: tuple[str, str]
    hosts: tuple[str, str]
    outer: tuple[Joint, Joint]
    inner: Joint
    spans: tuple[Pair, ...]
    determinant: sp.Expr
    guide: Guide | None

    @property
    def joints(self) -> tuple[str, str, str]:
        """Names: outer joint of the first body, inner joint, outer joint of the second body."""
        return self.outer[0].name, self.inner.name, self.outer[1].name


@dataclass(frozen=True, slots=True, kw_only=True)
class Margin:
    """Where a dyad can be assembled: `expression` [1] is positive inside, zero at the limit, negative outside."""

    joint: str
    expression: sp.Expr
    description: str


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedDyad:
    """What `place_rrr` and `place_rrp` give."""

    poses: tuple[Pose, Pose]
    dyad: Dyad
    margin: Margin


def name_hinge(ledger: Ledger, mechanism: Mechanism, joint: Joint, host: Pose) -> Motion:
    """Motion of a revolute joint on a body already placed, under the names ``joint.<name>.x`` and so on."""
    motion = host.motion(body_point(mechanism, host.body, point_name(joint, host.body)))
    return name_joint(ledger, joint, motion)


def name_joint(ledger: Ledger, joint: Joint, motion: Motion) -> Motion:
    """The motion of a joint under the names ``joint.<name>.x`` and so on."""
    return ledger.name_motion(f"joint.{joint.name}", motion, f"joint {joint.name}", subscript(joint.name))


def body_span(mechanism: Mechanism, body: str, outer: Joint, inner: Joint) -> tuple[Pair, Pair]:
    """Point of the outer joint, and vector from it to the inner joint, in body axes [m].

    Raises
    ------
    LinkageError
        both joints sit on one and the same point.
    """
    start = body_point(mechanism, body, point_name(outer, body))
    span = subtract(body_point(mechanism, body, point_name(inner, body)), start)
    if span[0].is_zero and span[1].is_zero:
        raise LinkageError(
            [
                Fault(
                    key=f"mechanism.bodies.{body}.points",
                    problem=f"joints {outer.name} and {inner.name} sit on the same point of {body}",
                    given=f"points {point_name(outer, body)} and {point_name(inner, body)}",
                    allowed="two points at a distance",
                    remedy="give one of them another place",
                )
            ]
        )
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


def name_turn(ledger: Ledger, body: str, vector: Pair, span: Pair, length: sp.Expr) -> Pair:
    """Cosine and sine of the body's angle: `vector` in the plane divided by `span` in body axes."""
    mark = subscript(body)
    cos = ledger.define(f"body.{body}.cos", dot(span, vector) / length**2, "1", _angle("cosine", body), f"c_{{{mark}}}")
    sin = ledger.define(f"body.{body}.sin", cross(span, vector) / length**2, "1", _angle("sine", body), f"s_{{{mark}}}")
    return cos, sin


def _angle(function: str, body: str) -> str:
    return f"{function} of the angle of {body}"


def name_rates(ledger: Ledger, body: str, rate: sp.Expr | None, acceleration: sp.Expr | None) -> sp.Expr:
    """Name the rate or, where it is None, the angular acceleration of a body."""
    mark = subscript(body)
    if rate is not None:
        return ledger.name(
            f"body.{body}.rate", rate, "rad/s", f"angular velocity of {body}", rf"\dot{{\varphi}}_{{{mark}}}"
        )
    return ledger.name(
        f"body.{body}.angular_acceleration",
        acceleration,
        "rad/s^2",
        f"angular acceleration of {body}",
        rf"\ddot{{\varphi}}_{{{mark}}}",
    )


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


def placed_group(group: Group, spans: tuple[Pair, ...], determinant: sp.Expr, guide: Guide | None) -> Dyad:
    """The group with what placing it has found: spans of its bodies [m], determinant of its loop, guide."""
    return Dyad(
        kind=group.kind,
        bodies=group.bodies,
        hosts=group.hosts,
        outer=group.outer,
        inner=group.inner,
        spans=spans,
        determinant=determinant,
        guide=guide,
    )
