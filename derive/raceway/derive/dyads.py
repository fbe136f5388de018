"""Closed-form kinematics of one Assur dyad: positions on its branch, then velocities and accelerations.

In: the poses of the bodies that carry the dyad.  Out: the poses of its two bodies.  Positions need one square root
and no inverse function: cosine and sine of a body's angle are the quotient of its span in the plane and its span in
body axes, taken as complex numbers.  Rates follow from the differentiated loop closure, two equations at a time, by
Cramer's rule.

Radicands are products of sums and differences of lengths, so that little cancels where a dyad is nearly straight:
Heron's product for RRR, (L − e)(L + e) for RRP.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import sympy as sp

from raceway.derive.assembly import Group, point_name
from raceway.derive.errors import Fault, LinkageError
from raceway.derive.kinematics import (
    Ledger,
    Motion,
    Pair,
    Pose,
    add,
    body_point,
    carried,
    cross,
    dot,
    place,
    quarter_turn,
    scale,
    subscript,
    subtract,
)
from raceway.derive.scene import FRAME, Joint, Mechanism
from raceway.derive.terms import symbol_of


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
    """What `place_dyad` gives."""

    poses: tuple[Pose, Pose]
    dyad: Dyad
    margin: Margin


def place_dyad(ledger: Ledger, mechanism: Mechanism, group: Group, poses: Mapping[str, Pose]) -> PlacedDyad:
    """Place the two bodies of a dyad on the bodies in `poses`, writing the definitions into `ledger`.

    Raises
    ------
    LinkageError
        a body whose two joints of the dyad sit on one and the same point.
    """
    return (_place_rrr if group.kind == "RRR" else _place_rrp)(ledger, mechanism, group, poses)


def name_hinge(ledger: Ledger, mechanism: Mechanism, joint: Joint, host: Pose) -> Motion:
    """Motion of a revolute joint on a body already placed, under the names ``joint.<name>.x`` and so on."""
    motion = host.motion(body_point(mechanism, host.body, point_name(joint, host.body)))
    return _name_joint(ledger, joint, motion)


def _name_joint(ledger: Ledger, joint: Joint, motion: Motion) -> Motion:
    return ledger.name_motion(f"joint.{joint.name}", motion, f"joint {joint.name}", subscript(joint.name))


def _span(mechanism: Mechanism, body: str, outer: Joint, inner: Joint) -> tuple[Pair, Pair]:
    """Point of the outer joint, and vector from it to the inner joint, in body axes [m]."""
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


def _length(ledger: Ledger, body: str, span: Pair) -> sp.Expr:
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


def _name_turn(ledger: Ledger, body: str, vector: Pair, span: Pair, length: sp.Expr) -> Pair:
    """Cosine and sine of the body's angle: `vector` in the plane divided by `span` in body axes."""
    mark = subscript(body)
    cos = ledger.define(f"body.{body}.cos", dot(span, vector) / length**2, "1", _angle("cosine", body), f"c_{{{mark}}}")
    sin = ledger.define(f"body.{body}.sin", cross(span, vector) / length**2, "1", _angle("sine", body), f"s_{{{mark}}}")
    return cos, sin


def _angle(function: str, body: str) -> str:
    return f"{function} of the angle of {body}"


def _name_rates(ledger: Ledger, body: str, rate: sp.Expr | None, acceleration: sp.Expr | None) -> sp.Expr:
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


def _place_rrr(ledger: Ledger, mechanism: Mechanism, group: Group, poses: Mapping[str, Pose]) -> PlacedDyad:
    inner, bodies = group.inner, group.bodies
    mark, prefix = subscript(inner.name), f"joint.{inner.name}"
    hinges = [
        name_hinge(ledger, mechanism, joint, poses[host]) for joint, host in zip(group.outer, group.hosts, strict=True)
    ]
    spans = [_span(mechanism, body, joint, inner) for body, joint in zip(bodies, group.outer, strict=True)]
    one, two = (_length(ledger, body, span) for body, (_, span) in zip(bodies, spans, strict=True))

    names = f"from {group.outer[0].name} to {group.outer[1].name}"
    base = ledger.name_pair(
        f"{prefix}.base",
        "",
        subtract(hinges[1].position, hinges[0].position),
        "m",
        f"component of the line {names}",
        "{}",
        f"d,{mark}",
    )
    square = ledger.define(
        f"{prefix}.base_squared", dot(base, base), "m^2", f"square of the distance {names}", f"d_{{{mark}}}^{{2}}"
    )
    difference, total = one - two, one + two
    heron = ledger.define(
        f"{prefix}.heron",
        (total**2 - square) * (square - difference**2),
        "m^4",
        f"Heron's product at joint {inner.name}: 16 times the squared area of the triangle of the joints",
        f"H_{{{mark}}}",
    )
    # v1 and v2 lead from the outer joints to the inner one; v1 × v2 is twice the triangle's area, signed by the branch.
    determinant = ledger.define(
        f"{prefix}.determinant",
        sp.Rational(group.sign, 2) * sp.sqrt(heron),
        "m^2",
        f"cross product of the two spans at joint {inner.name}",
        rf"\Delta_{{{mark}}}",
    )
    across = quarter_turn(base)
    ahead = (square + difference * total) / 2
    behind = (square - difference * total) / 2
    vectors = (
        scale(1 / square, add(scale(ahead, base), scale(determinant, across))),
        scale(1 / square, add(scale(-behind, base), scale(determinant, across))),
    )
    v1, v2 = (
        ledger.name_pair(
            f"body.{body}.span", "", vector, "m", f"component of the span of {body}", "{}", subscript(body)
        )
        for body, vector in zip(bodies, vectors, strict=True)
    )
    turns = [
        _name_turn(ledger, body, vector, span, length)
        for body, vector, (_, span), length in zip(bodies, (v1, v2), spans, (one, two), strict=True)
    ]

    # P1 + v1 = P2 + v2, differentiated: w1 J v1 − w2 J v2 = r; the scalar products with v2 and v1 give one rate each.
    gap = _name_gap(ledger, inner, "v", subtract(hinges[1].velocity, hinges[0].velocity), "m/s")
    rates = [
        _name_rates(ledger, body, dot(gap, other) / determinant, None)
        for body, other in zip(bodies, (v2, v1), strict=True)
    ]
    difference_of_accelerations = add(
        subtract(hinges[1].acceleration, hinges[0].acceleration),
        scale(rates[0] ** 2, v1),
        scale(-(rates[1] ** 2), v2),
    )
    gap = _name_gap(ledger, inner, "a", difference_of_accelerations, "m/s^2")
    accelerations = [
        _name_rates(ledger, body, None, dot(gap, other) / determinant)
        for body, other in zip(bodies, (v2, v1), strict=True)
    ]

    _name_joint(ledger, inner, carried(hinges[0], v1, rates[0], accelerations[0]))
    first, second = (
        place(
            ledger,
            mechanism,
            body,
            cos=turns[i][0],
            sin=turns[i][1],
            rate=rates[i],
            acceleration=accelerations[i],
            anchor=spans[i][0],
            anchor_motion=hinges[i],
        )
        for i, body in enumerate(bodies)
    )
    return PlacedDyad(
        poses=(first, second),
        dyad=_dyad(group, (v1, v2), determinant, None),
        margin=Margin(
            joint=inner.name,
            expression=heron / (4 * one**2 * two**2),
            description=f"squared sine of the transmission angle at joint {inner.name}",
        ),
    )


def _name_gap(ledger: Ledger, inner: Joint, order: str, gap: Pair, unit: str) -> Pair:
    """Name the right-hand side of the loop closure's derivative."""
    return ledger.name_pair(
        f"joint.{inner.name}.closure",
        order,
        gap,
        unit,
        f"component of the {'velocity' if order == 'v' else 'acceleration'} that closes the loop at {inner.name}",
        "{}",
        f"{order},{subscript(inner.name)}",
    )


def _place_rrp(ledger: Ledger, mechanism: Mechanism, group: Group, poses: Mapping[str, Pose]) -> PlacedDyad:
    inner, (rod, slider), (hinge_joint, guide_joint) = group.inner, group.bodies, group.outer
    host = poses[group.hosts[1]]
    mark, prefix = subscript(inner.name), f"joint.{inner.name}"
    rail, rail_mark = f"joint.{guide_joint.name}", subscript(guide_joint.name)
    hinge = name_hinge(ledger, mechanism, hinge_joint, poses[group.hosts[0]])
    start, span = _span(mechanism, rod, hinge_joint, inner)
    length = _length(ledger, rod, span)

    # The inner joint's path is the line through `base` along the guide, both carried by the host.
    slider_inner = body_point(mechanism, slider, point_name(inner, slider))
    slider_guide = body_point(mechanism, slider, point_name(guide_joint, slider))
    host_guide = body_point(mechanism, host.body, point_name(guide_joint, host.body))
    path = host.motion(add(host_guide, subtract(slider_inner, slider_guide)))
    words = f"the path of joint {inner.name} where the points of {guide_joint.name} coincide"
    path = ledger.name_motion(f"{rail}.base", path, words, f"0,{rail_mark}")
    assert guide_joint.direction is not None  # a prismatic joint has a direction
    angle = symbol_of(guide_joint.direction)
    direction = ledger.name_pair(
        f"{rail}.direction",
        "",
        host.rotate((sp.cos(angle), sp.sin(angle))),
        "1",
        f"component of the direction of guide {guide_joint.name}",
        "{}",
        f"t,{rail_mark}",
    )
    normal = quarter_turn(direction)

    to_path = subtract(path.position, hinge.position)
    offset = ledger.name(
        f"{prefix}.offset",
        dot(normal, to_path),
        "m",
        f"distance of the path of {inner.name} from joint {hinge_joint.name}, positive to the left of the guide",
        f"e_{{{mark}}}",
    )
    reach = ledger.define(
        f"{prefix}.determinant",
        group.sign * sp.sqrt((length - offset) * (length + offset)),
        "m",
        f"component of the span of {rod} along guide {guide_joint.name}",
        rf"\Delta_{{{mark}}}",
    )
    travel = ledger.name(
        f"{rail}.travel",
        reach - dot(direction, to_path),
        "m",
        f"travel of {slider} along guide {guide_joint.name}",
        f"s_{{{rail_mark}}}",
    )
    v = ledger.name_pair(
        f"body.{rod}.span",
        "",
        add(scale(offset, normal), scale(reach, direction)),
        "m",
        f"component of the span of {rod}",
        "{}",
        subscript(rod),
    )
    cos, sin = _name_turn(ledger, rod, v, span, length)

    # P + v = base + s t, differentiated: w J v − s' t = r; cross product with t and scalar product with v.
    fellow = carried(path, scale(travel, direction), host.rate, host.acceleration)
    gap = _name_gap(ledger, inner, "v", subtract(fellow.velocity, hinge.velocity), "m/s")
    rate = _name_rates(ledger, rod, cross(direction, gap) / reach, None)
    speed = ledger.name(
        f"{rail}.speed",
        -dot(v, gap) / reach,
        "m/s",
        f"speed of {slider} along guide {guide_joint.name}",
        rf"\dot{{s}}_{{{rail_mark}}}",
    )
    # Seen from the frame, the slider has the host's acceleration, Coriolis' and its own along the guide.
    carried_along = add(fellow.acceleration, scale(2 * host.rate * speed, normal))
    closure = add(subtract(carried_along, hinge.acceleration), scale(rate**2, v))
    gap = _name_gap(ledger, inner, "a", closure, "m/s^2")
    acceleration = _name_rates(ledger, rod, None, cross(direction, gap) / reach)
    quickening = ledger.name(
        f"{rail}.acceleration",
        -dot(v, gap) / reach,
        "m/s^2",
        f"acceleration of {slider} along guide {guide_joint.name}",
        rf"\ddot{{s}}_{{{rail_mark}}}",
    )
    joint_motion = _name_joint(
        ledger,
        inner,
        Motion(
            position=fellow.position,
            velocity=add(fellow.velocity, scale(speed, direction)),
            acceleration=add(carried_along, scale(quickening, direction)),
        ),
    )

    rod_pose = place(
        ledger,
        mechanism,
        rod,
        cos=cos,
        sin=sin,
        rate=rate,
        acceleration=acceleration,
        anchor=start,
        anchor_motion=hinge,
    )
    slider_pose = place(
        ledger,
        mechanism,
        slider,
        cos=host.cos,
        sin=host.sin,
        rate=host.rate,
        acceleration=host.acceleration,
        anchor=slider_inner,
        anchor_motion=joint_motion,
    )
    guide = Guide(
        joint=guide_joint,
        host=host.body,
        slider=slider,
        direction=direction,
        travel=travel,
        fixed=host.body == FRAME,
    )
    return PlacedDyad(
        poses=(rod_pose, slider_pose),
        dyad=_dyad(group, (v,), reach, guide),
        margin=Margin(
            joint=inner.name,
            expression=(length - offset) * (length + offset) / length**2,
            description=f"squared cosine of the angle between {rod} and guide {guide_joint.name}",
        ),
    )


def _dyad(group: Group, spans: tuple[Pair, ...], determinant: sp.Expr, guide: Guide | None) -> Dyad:
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
