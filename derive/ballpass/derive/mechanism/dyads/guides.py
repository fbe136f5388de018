"""Prismatic joints of dyads: direction of a guide, path of a point along it, travel and its rates by name."""

from __future__ import annotations

from typing import Literal

import sympy as sp

from ballpass.derive.mechanism.dyads.dyad import Margin
from ballpass.derive.mechanism.kinematics import Ledger, Motion, Pose, joint_point
from ballpass.derive.mechanism.vectors import Pair, add, cross, quarter_turn, scale, subtract, unit
from ballpass.derive.scene.mechanism_records import Joint, Mechanism
from ballpass.derive.terms import subscript, symbol_of


def guide_axis(guide: Joint) -> Pair:
    """Unit vector of a guide in the axes of its bodies."""
    assert guide.direction is not None  # a prismatic joint has a direction
    return unit(symbol_of(guide.direction))


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
