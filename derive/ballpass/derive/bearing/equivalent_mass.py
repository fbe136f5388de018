"""Mass that the inner ring moves: given, or Eq. (3)."""

from __future__ import annotations

import sympy as sp

from ballpass.derive.mechanism.vectors import dot, subtract
from ballpass.derive.scene.bearing_records import Bearing, EquivalentMass
from ballpass.derive.scene.errors import Fault
from ballpass.derive.scene.mechanism_records import Mechanism
from ballpass.derive.scene.table import FRAME
from ballpass.derive.terms import components, symbol_of


def inner_mass(bearing: Bearing, mechanism: Mechanism | None) -> sp.Expr:
    """Mass moved by the inner ring [kg].

    Eq. (3) takes the ring, half the crankpin, and the crank's mass by the lever rule.  l_1 - l_o1 is measured along the
    crank from its centre of mass to the far joint: for theta_1p = 0, where the rule holds, this is the printed one.

    Raises
    ------
    SceneError
        Eq. (3) for a body without exactly one far joint.
    """
    assert bearing.inner is not None  # loaded one-way
    given = bearing.inner.mass
    assert given is not None  # on no shaft that tilts
    if not isinstance(given, EquivalentMass):
        return symbol_of(given)
    assert mechanism is not None  # the reader refuses Eq. (3) without a mechanism
    assert bearing.joint is not None
    joint = mechanism.joint(bearing.joint)
    crank = mechanism.body(joint.other(FRAME))
    ends = [j.point(crank.name) for j in mechanism.joints if j is not joint and crank.name in j.bodies]
    if len(ends) != 1:
        raise Fault(
            key=f"{bearing.path}.inner_ring.equivalent_mass",
            problem=f"Eq. (3) needs one far joint of the body {crank.name!r}",
            given=f"{len(ends)} further joints",
            allowed="a crank with exactly two joints",
            remedy=f'give the mass itself: [{bearing.path}.inner_ring] mass = "0.4 kg"',
        ).error()
    near, far = (components(crank.point(name)) for name in (joint.point(crank.name), ends[0]))
    arm, rest = subtract(far, near), subtract(far, components(crank.center_of_mass))
    lever = sp.cancel(dot(rest, arm) / dot(arm, arm))
    share = sp.Rational(1, 2) if given.crank == "half" else sp.S.One
    return symbol_of(given.ring) + share * symbol_of(crank.mass) * lever + symbol_of(given.crankpin) / 2
