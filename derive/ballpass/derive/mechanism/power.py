"""Inertia of a linkage's bodies and the work of its loads, for its equations of motion.

In: the poses of the bodies, and loads on them.  Out: `Inertia` and `Effort`, each with the velocity that belongs to it.
"""

from __future__ import annotations

from collections.abc import Iterable

from ballpass.derive.drive import Drive
from ballpass.derive.mechanism.balance import AppliedLoad
from ballpass.derive.mechanism.linear_forms import Effort, Inertia, inertias_of
from ballpass.derive.mechanism.linkage import Linkage
from ballpass.derive.mechanism.vectors import ZERO
from ballpass.derive.terms import components, symbol_of


def work_of(loads: Iterable[AppliedLoad], linkage: Linkage) -> tuple[Effort, ...]:
    """Forces and torques on bodies, with the rates along which they work."""
    efforts: list[Effort] = []
    for load in loads:
        pose = linkage.poses[load.body]
        if any(load.force):
            velocity = pose.motion(load.point).velocity
            efforts += [Effort(amount=f, rate=v) for f, v in zip(load.force, velocity, strict=True)]
        efforts.append(Effort(amount=load.torque, rate=pose.rate))
    return tuple(effort for effort in efforts if effort.amount != 0 and effort.rate != 0)


def work_of_drive(drive: Drive) -> tuple[Effort, ...]:
    """Work of a drive's torque; none where its motion is given."""
    return () if drive.torque is None else (Effort(amount=drive.torque, rate=drive.speed),)


def loads_of_drive(linkage: Linkage) -> tuple[AppliedLoad, ...]:
    """Torque of a flywheel on the driven body, besides the torque of the drive."""
    drive = linkage.drive
    return (AppliedLoad(body=linkage.driven, torque=-drive.flywheel * drive.driven[2]),) if drive.flywheel != 0 else ()


def inertia_of(linkage: Linkage) -> tuple[Inertia, ...]:
    """Inertia of the bodies and of a drive's flywheel."""
    inertias, drive = list[Inertia](), linkage.drive
    for body in linkage.mechanism.bodies:
        pose = linkage.poses[body.name]
        inertias += inertias_of(symbol_of(body.mass), pose.center_of_mass)
        if body.inertia is not None and pose.rate != 0:
            inertias.append(Inertia(amount=symbol_of(body.inertia), rate=pose.rate, acceleration=pose.acceleration))
    if drive.flywheel != 0:
        _, rate, acceleration = drive.driven
        inertias.append(Inertia(amount=drive.flywheel, rate=rate, acceleration=acceleration))
    return tuple(inertias)


def weights_of(linkage: Linkage) -> tuple[Effort, ...]:
    """Work of the weight of the bodies."""
    mechanism = linkage.mechanism
    gravity = ZERO if mechanism.gravity is None else components(mechanism.gravity, axis=(0, -1))
    return tuple(
        Effort(amount=symbol_of(body.mass) * g, rate=v, place=r)
        for body in mechanism.bodies
        for center in [linkage.poses[body.name].center_of_mass]
        for r, v, g in zip(center.position, center.velocity, gravity, strict=True)
        if g != 0
    )
