"""Closed-form kinematics of the RRP dyad: a rod hinged, and a slider guided, on bodies already placed.

In: the poses of the bodies that carry it.  Out: the poses of rod and slider.  The radicand is (L − e)(L + e), with the
rod's length L and the distance e of the inner joint's path from the rod's hinge.
"""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp

from ballpass.derive.mechanism.assembly import Group, point_name
from ballpass.derive.mechanism.dyads.dyad import (
    Guide,
    Margin,
    PlacedDyad,
    body_span,
    name_gap,
    name_hinge,
    name_joint,
    name_rates,
    name_span,
    name_turn,
    placed_group,
    span_length,
)
from ballpass.derive.mechanism.kinematics import (
    Ledger,
    Motion,
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
from ballpass.derive.scene.records import FRAME, Mechanism
from ballpass.derive.terms import symbol_of


def place_rrp(ledger: Ledger, mechanism: Mechanism, group: Group, poses: Mapping[str, Pose]) -> PlacedDyad:
    """Place the two bodies of the dyad on the bodies in `poses`, writing the definitions into `ledger`.

    Raises
    ------
    LinkageError
        a body whose two joints of the dyad sit on one and the same point.
    """
    inner, (rod, slider), (hinge_joint, guide_joint) = group.inner, group.bodies, group.outer
    host = poses[group.hosts[1]]
    mark, prefix = subscript(inner.name), f"joint.{inner.name}"
    rail, rail_mark = f"joint.{guide_joint.name}", subscript(guide_joint.name)
    hinge = name_hinge(ledger, mechanism, hinge_joint, poses[group.hosts[0]])
    start, span = body_span(mechanism, rod, hinge_joint, inner)
    length = span_length(ledger, rod, span)

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
        f"t_{{{rail_mark},AXIS}}",
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
    v = name_span(ledger, rod, add(scale(offset, normal), scale(reach, direction)))
    cos, sin = name_turn(ledger, rod, v, span, length)

    # P + v = base + s t, differentiated: w J v − s' t = r; cross product with t and scalar product with v.
    fellow = carried(path, scale(travel, direction), host.rate, host.acceleration)
    gap = name_gap(ledger, inner, "v", subtract(fellow.velocity, hinge.velocity), "m/s")
    rate = name_rates(ledger, rod, cross(direction, gap) / reach, None)
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
    gap = name_gap(ledger, inner, "a", closure, "m/s^2")
    acceleration = name_rates(ledger, rod, None, cross(direction, gap) / reach)
    quickening = ledger.name(
        f"{rail}.acceleration",
        -dot(v, gap) / reach,
        "m/s^2",
        f"acceleration of {slider} along guide {guide_joint.name}",
        rf"\ddot{{s}}_{{{rail_mark}}}",
    )
    joint_motion = name_joint(
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
        dyad=placed_group(group, (v,), reach, guide),
        margin=Margin(
            joint=inner.name,
            expression=(length - offset) * (length + offset) / length**2,
            description=f"squared cosine of the angle between {rod} and guide {guide_joint.name}",
        ),
    )
