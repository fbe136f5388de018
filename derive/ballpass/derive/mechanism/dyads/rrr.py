"""Closed-form kinematics of the RRR dyad: two bodies hinged to each other and to bodies already placed.

In: the poses of the bodies that carry it.  Out: the poses of its two bodies.  The radicand is Heron's product, whose
factors are sums and differences of lengths: little cancels where the dyad is nearly straight.
"""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp

from ballpass.derive.mechanism.assembly import Group
from ballpass.derive.mechanism.dyads.dyad import (
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
    Pose,
    add,
    carried,
    dot,
    place,
    quarter_turn,
    scale,
    subscript,
    subtract,
)
from ballpass.derive.scene.records import Mechanism


def place_rrr(ledger: Ledger, mechanism: Mechanism, group: Group, poses: Mapping[str, Pose]) -> PlacedDyad:
    """Place the two bodies of the dyad on the bodies in `poses`, writing the definitions into `ledger`.

    Raises
    ------
    LinkageError
        a body whose two joints of the dyad sit on one and the same point.
    """
    inner, bodies = group.inner, group.bodies
    mark, prefix = subscript(inner.name), f"joint.{inner.name}"
    hinges = [
        name_hinge(ledger, mechanism, joint, poses[host]) for joint, host in zip(group.outer, group.hosts, strict=True)
    ]
    spans = [body_span(mechanism, body, joint, inner) for body, joint in zip(bodies, group.outer, strict=True)]
    one, two = (span_length(ledger, body, span) for body, (_, span) in zip(bodies, spans, strict=True))

    names = f"from {group.outer[0].name} to {group.outer[1].name}"
    base = ledger.name_pair(
        f"{prefix}.base",
        "",
        subtract(hinges[1].position, hinges[0].position),
        "m",
        f"component of the line {names}",
        f"d_{{{mark},AXIS}}",
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
    v1, v2 = (name_span(ledger, body, vector) for body, vector in zip(bodies, vectors, strict=True))
    turns = [
        name_turn(ledger, body, vector, span, length)
        for body, vector, (_, span), length in zip(bodies, (v1, v2), spans, (one, two), strict=True)
    ]

    # P1 + v1 = P2 + v2, differentiated: w1 J v1 − w2 J v2 = r; the scalar products with v2 and v1 give one rate each.
    gap = name_gap(ledger, inner, "v", subtract(hinges[1].velocity, hinges[0].velocity), "m/s")
    rates = [
        name_rates(ledger, body, dot(gap, other) / determinant, None)
        for body, other in zip(bodies, (v2, v1), strict=True)
    ]
    difference_of_accelerations = add(
        subtract(hinges[1].acceleration, hinges[0].acceleration),
        scale(rates[0] ** 2, v1),
        scale(-(rates[1] ** 2), v2),
    )
    gap = name_gap(ledger, inner, "a", difference_of_accelerations, "m/s^2")
    accelerations = [
        name_rates(ledger, body, None, dot(gap, other) / determinant)
        for body, other in zip(bodies, (v2, v1), strict=True)
    ]

    name_joint(ledger, inner, carried(hinges[0], v1, rates[0], accelerations[0]))
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
        dyad=placed_group(group, (v1, v2), determinant, None),
        margin=Margin(
            joint=inner.name,
            expression=heron / (4 * one**2 * two**2),
            description=f"squared sine of the transmission angle at joint {inner.name}",
        ),
    )
