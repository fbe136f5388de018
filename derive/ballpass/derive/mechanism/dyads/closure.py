"""Loop closure of dyads: vectors between their joints in body axes and in the plane, and what closes the loop."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from ballpass.derive.mechanism.kinematics import Ledger, Motion, joint_point, name_turn
from ballpass.derive.mechanism.vectors import Pair, cross, dot, subtract
from ballpass.derive.scene.errors import Fault
from ballpass.derive.scene.mechanism_records import Joint, Mechanism
from ballpass.derive.terms import subscript


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


def name_gap(ledger: Ledger, inner: Joint, order: str, gap: Pair) -> Pair:
    """Name the right-hand side of the loop closure's first ("v") or second ("a") derivative."""
    what, unit = {"v": ("velocity", "m/s"), "a": ("acceleration", "m/s^2")}[order]
    words = f"component of the {what} that closes the loop at {inner.name}"
    latex = rf"\delta {order}_{{{subscript(inner.name)},AXIS}}"
    return ledger.name_pair(f"joint.{inner.name}.closure", order, gap, unit, words, latex)
