"""Inertia of a linkage's bodies and the work of its loads, for its equations of motion.

In: the poses of the bodies, and loads on them.  Out: `Inertia` and `Effort`, each with the velocity that belongs to it.
"""

from __future__ import annotations

from collections.abc import Iterable

from ballpass.derive.mechanism.balance import AppliedLoad
from ballpass.derive.mechanism.kinematics import ZERO
from ballpass.derive.mechanism.linear_forms import Effort, Inertia
from ballpass.derive.mechanism.linkage import Linkage
from ballpass.derive.scene.records import Mechanism
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


def work_of_drive(linkage: Linkage) -> tuple[tuple[Effort, ...], tuple[Inertia, ...]]:
    """Work of a drive's torque, and its flywheel; nothing where the speed is constant, no work where it is given."""
    drive = linkage.drive
    wheel = Inertia(amount=drive.flywheel, rate=drive.speed, acceleration=drive.acceleration)
    if drive.torque is None:
        return (), (wheel,) if drive.flywheel != 0 else ()
    return (Effort(amount=drive.torque, rate=drive.speed),), (wheel,)


def loads_of_drive(linkage: Linkage) -> tuple[AppliedLoad, ...]:
    """Torque of a flywheel on the driven body, besides the torque of the drive."""
    drive = linkage.drive
    return (
        (AppliedLoad(body=linkage.driven, torque=-drive.flywheel * drive.acceleration),) if drive.flywheel != 0 else ()
    )


def inertia_of(mechanism: Mechanism, linkage: Linkage) -> tuple[tuple[Inertia, ...], tuple[Effort, ...]]:
    """Inertia of the bodies, and the work of their weight."""
    gravity = ZERO if mechanism.gravity is None else components(mechanism.gravity, axis=(0, -1))
    inertias, efforts = [], []
    for body in mechanism.bodies:
        pose, mass = linkage.poses[body.name], symbol_of(body.mass)
        center = pose.center_of_mass
        for r, v, a, g in zip(center.position, center.velocity, center.acceleration, gravity, strict=True):
            inertias.append(Inertia(amount=mass, rate=v, acceleration=a))
            efforts.append(Effort(amount=mass * g, rate=v, place=r))
        if body.inertia is not None and pose.rate != 0:
            inertias.append(Inertia(amount=symbol_of(body.inertia), rate=pose.rate, acceleration=pose.acceleration))
    return tuple(inertias), tuple(effort for effort in efforts if effort.amount != 0)
