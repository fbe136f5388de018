"""From the forces of a scene to what acts on each body of its linkage."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import sympy as sp

from ballpass.derive.mechanism.balance import AppliedLoad
from ballpass.derive.mechanism.forces.force import Setting
from ballpass.derive.mechanism.forces.point_force import PointForce
from ballpass.derive.mechanism.forces.two_points import TwoPoints
from ballpass.derive.mechanism.linkage import Linkage
from ballpass.derive.scene.mechanism_records import Force, Mechanism
from ballpass.derive.scene.table import FRAME
from ballpass.derive.terms import refuse_kinks
from ballpass.derive.variables import Output, Terms


@dataclass(frozen=True, slots=True, kw_only=True)
class Forces(Terms):
    """Loads on the bodies, what they are made of, and outputs.

    `of_each` are the loads by the label of their force, `requested` are outputs on request.
    """

    loads: tuple[AppliedLoad, ...]
    of_each: Mapping[str, tuple[AppliedLoad, ...]]
    outputs: tuple[Output, ...]
    requested: tuple[Output, ...] = ()


NO_FORCES = Forces(loads=(), of_each=MappingProxyType({}), outputs=())


def derive_forces(linkage: Linkage) -> Forces:
    """Derive the loads of all forces and torques of a mechanism."""
    setting = Setting(linkage=linkage)
    loads: dict[str, tuple[AppliedLoad, ...]] = {}
    for force in linkage.mechanism.forces:
        known, said = len(setting.ledger.definitions), len(setting.smoothness)
        action = force.pathway.act(force, setting)
        both = action.loads(force.law.amount(force, action, setting))
        loads[force.label] = tuple(load for load in both if load.body != FRAME)
        refuse_kinks(
            f'The {force.word} "{force.name}"',
            sp.Tuple(
                *(expression for load in loads[force.label] for expression in (*load.force, load.torque)),
                *(d.expression for d in setting.ledger.definitions[known:]),
            ),
            "sympy.Piecewise with the border of a switch of `setting.switches` in each condition, where steps end; "
            "Max, Min and Abs where `setting.smoothness` says that the force is kinked. Write one.",
            located=[switch.border.symbol for switch in setting.switches],
            kinked=len(setting.smoothness) > said,
        )
    return Forces(
        loads=tuple(load for those in loads.values() for load in those),
        of_each=MappingProxyType(loads),
        definitions=(*setting.switched, *setting.ledger.definitions),
        inputs=tuple(setting.inputs),
        outputs=tuple(setting.outputs),
        requested=tuple(setting.requested),
        smoothness=tuple(setting.smoothness),
        switches=tuple(setting.switches),
        constants=tuple(setting.constants),
    )


def drawn_forces(mechanism: Mechanism) -> tuple[tuple[str, str, str, str], ...]:
    """Forces on points: name, body, point, and input that gates it or holds its amount, or "" (acts always).

    Where the driver's angle is a coordinate there is no such input: time and amount follow from the angle.
    """
    return tuple(
        (force.name, force.pathway.body, force.pathway.point, _input(force))
        for force in mechanism.forces
        if isinstance(force.pathway, PointForce)
    )


def drawn_springs(mechanism: Mechanism) -> tuple[tuple[str, str, str, str, str], ...]:
    """Springs and stops along a line: prefix of their outputs, body and point of both ends."""
    return tuple(
        (force.label, path.bodies[0], path.points[0], path.bodies[1], path.points[1])
        for force in mechanism.forces
        if isinstance(path := force.pathway, TwoPoints)
    )


def _input(force: Force) -> str:
    """Name of the input that gates a force or holds its amount; empty where it acts always."""
    if not force.law.factor:
        return force.label
    return f"gate.{force.name}" if force.law.key else ""
