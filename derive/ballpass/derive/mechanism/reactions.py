"""From kinematics to joint reactions and drive torque: Newton–Euler, Eq. (1) of the paper.

In: a `Mechanism`, its `Linkage` and the loads on it.  Out: `Reactions`: the linear equations A r = b, and their
solution in closed form.

Each moving body gives force balances along x and y and a moment balance about its centre of mass; inertia terms and
applied loads stand in b.  The solution walks the dyads from the last to the first: two equations for the inner joint,
then one balance after the other.  No general elimination takes place, so the solution is as accurate as LAPACK's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import sympy as sp

from ballpass.derive.mechanism.balance import DRIVE_TORQUE, AppliedLoad, Balance
from ballpass.derive.mechanism.kinematics import Ledger, joint_point
from ballpass.derive.mechanism.linkage import Linkage
from ballpass.derive.mechanism.vectors import Pair
from ballpass.derive.scene.errors import Fault, LinkageError
from ballpass.derive.terms import Definition


@dataclass(frozen=True, slots=True, kw_only=True)
class Reactions:
    """Joint reactions and drive torque.

    Attributes
    ----------
    matrix, unknowns, right_side : A (n × n), r (n), b (n) of A r = b; the driver's joint and torque come last
    rows : body and balance (``x``, ``y``, ``moment``) of each equation
    definitions : the solution, ordered; the unknowns are among the symbols
    joint_force : by joint or gear, force [N] of ``bodies[1]`` on ``bodies[0]``
    joint_moment : by prismatic joint, moment [N*m] of ``bodies[1]`` on ``bodies[0]`` with the force at ``points[1]``; a
        joint whose moment was not asked for is none of them
    drive_torque : torque [N*m] of the drive on the driven body, counter-clockwise
    on_driven : forces [N] on the driven body but that of the driver's joint, with the names of their points
    """

    matrix: sp.ImmutableMatrix
    unknowns: tuple[sp.Symbol, ...]
    right_side: sp.ImmutableMatrix
    rows: tuple[tuple[str, str], ...]
    definitions: tuple[Definition, ...]
    joint_force: Mapping[str, Pair]
    joint_moment: Mapping[str, sp.Expr]
    drive_torque: sp.Expr
    on_driven: tuple[tuple[str, Pair], ...]


def derive_reactions(linkage: Linkage, loads: Sequence[AppliedLoad], moments: frozenset[str]) -> Reactions:
    """Derive A r = b and its solution.

    Parameters
    ----------
    linkage : from `derive_linkage`
    loads : applied forces and torques
    moments : prismatic joints on the frame whose guide moment is wanted; each adds the moment balance of its slider

    Raises
    ------
    LinkageError
        a body without inertia whose moment balance is needed.
    """
    mechanism = linkage.mechanism
    guides = {guide.joint.name: guide for p in linkage.placements for guide in p.guides}
    _refuse_massless_turning(linkage)
    driver, driven = linkage.driver, linkage.driven
    balance = Balance(mechanism, linkage.poses, driver, guides, linkage.meshes, loads, moments)
    matrix, right_side, rows = balance.equations(driven)
    ledger = Ledger()
    for placement in reversed(linkage.placements):
        placement.dyad.solve(ledger, balance, placement)
    torque = -balance.known_moment(driven, joint_point(mechanism, driver, driven))
    on_driven = tuple(balance.known_forces(driven))
    balance.solve_hinge_by_forces(ledger, driver, driven)
    ledger.define(DRIVE_TORQUE.name, torque, "N*m", f"torque of the drive on {driven}, counter-clockwise", "M_d")
    forces = {joint.name: balance.force_symbols(ledger, joint) for joint in linkage.contacts}
    return Reactions(
        matrix=matrix,
        unknowns=balance.unknowns,
        right_side=right_side,
        rows=rows,
        definitions=ledger.definitions,
        joint_force=MappingProxyType(forces),
        joint_moment=MappingProxyType({n: c.moment for n, c in balance.contacts.items() if c.moment is not None}),
        drive_torque=DRIVE_TORQUE,
        on_driven=on_driven,
    )


def _refuse_massless_turning(linkage: Linkage) -> None:
    faults = [
        Fault(
            key=f"mechanism.bodies.{body.name}.inertia",
            problem=f"the moment balance of {body.name} is needed, and the body has no moment of inertia",
            given="nothing",
            allowed="a moment of inertia about the centre of mass; bodies that guides keep from turning need none",
            remedy=f'give mechanism.bodies.{body.name}.inertia, as in inertia = "611.7 kg*mm^2"',
        )
        for body in linkage.mechanism.bodies
        if body.inertia is None and linkage.poses[body.name].rate != 0
    ]
    if faults:
        raise LinkageError(faults)
