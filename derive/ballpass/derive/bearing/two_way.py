"""A bearing in a joint of a linkage, coupled both ways: its play moves the bodies, its forces act on both.

In: a bearing's contact and the linkage that its play moves.  Out: what it adds to the equations of motion, and the
loads it puts on the bodies.

The inner ring moves with the body that carries it, the outer ring with the other one or, on an elastic housing, as a
point mass of its own.  Bodies' masses contain their rings.  The balls are massless: besides the force through the
ring's centre they turn both carriers by the cage moments, each with its share of the ball's angle, and by the slopes of
what effects take from their deflections: a ball that rolls up a wave turns one ring back and the other on.
"""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from ballpass.derive.bearing.equations import BearingModel
from ballpass.derive.mechanism.balance import AppliedLoad
from ballpass.derive.mechanism.kinematics import AT_REST, Motion, body_point, displaced
from ballpass.derive.mechanism.linear_forms import Effort, Inertia, inertias_of
from ballpass.derive.mechanism.linkage import Linkage
from ballpass.derive.mechanism.vectors import ZERO, Pair, cross, quarter_turn, scale, subtract
from ballpass.derive.scene.bearing_records import Bearing
from ballpass.derive.scene.mechanism_records import Joint
from ballpass.derive.scene.table import FRAME
from ballpass.derive.terms import components, symbol_of
from ballpass.derive.variables import Coordinate


@dataclass(frozen=True, slots=True, kw_only=True)
class Coupled:
    """What a bearing adds.

    Attributes
    ----------
    inertias, efforts : to the equations of motion
    weights : those of the efforts that are weight
    loads : on the bodies, besides the joint's reaction, which is the force of the housing
    """

    inertias: tuple[Inertia, ...] = ()
    efforts: tuple[Effort, ...] = ()
    weights: tuple[Effort, ...] = ()
    loads: tuple[AppliedLoad, ...] = ()


def ring(coordinates: tuple[Coordinate, ...], first: int) -> Motion:
    """Motion of a ring against where it is unloaded, from the place of its x coordinate."""
    x, y = coordinates[first : first + 2]
    return Motion(
        position=(x.position, y.position),
        velocity=(x.velocity, y.velocity),
        acceleration=(x.acceleration, y.acceleration),
    )


def play_of(bearing: Bearing, joint: Joint, inner: Motion) -> Motion:
    """Motion of the second body's point of a joint relative to the first body's, by that of the inner ring's body."""
    return displaced(AT_REST, inner, 1 if joint.bodies[1] == bearing.inner_body else -1)


def carriers_of(bearing: Bearing, linkage: Linkage) -> tuple[str, str]:
    """The bodies that carry inner and outer ring: one-way the moving body and the frame."""
    if bearing.coupling == "one-way":
        return linkage.mechanism.joint(bearing.joint or "").other(FRAME), FRAME
    return bearing.inner_body, linkage.mechanism.joint(bearing.joint or "").other(bearing.inner_body)


def on_tilting_shaft(bearing: Bearing, model: BearingModel) -> Coupled:
    """Forces of the balls and of dampers on a shaft that is loaded one-way and tilts, and the outer ring."""
    assert bearing.inner is not None  # loaded one-way
    efforts, inertias = _against(model.ball.ring_force, model.parting), list[Inertia]()
    if bearing.inner.damping is not None:
        velocity = ring(model.coordinates, 0).velocity
        efforts += _against(scale(symbol_of(bearing.inner.damping), velocity), velocity)
    if bearing.outer is not None:
        outer, support = ring(model.coordinates, 2), bearing.outer
        efforts += _against(scale(symbol_of(support.stiffness), outer.position), outer.velocity)
        efforts += _against(scale(symbol_of(support.damping), outer.velocity), outer.velocity)
        inertias = inertias_of(symbol_of(support.mass), outer)
    return Coupled(inertias=tuple(inertias), efforts=tuple(efforts))


def _against(force: Pair, velocity: Pair) -> list[Effort]:
    return [Effort(amount=-f, rate=v) for f, v in zip(force, velocity, strict=True)]


def couple(bearing: Bearing, model: BearingModel, linkage: Linkage) -> Coupled:
    """Forces of the balls on both bodies, and the outer ring where it moves on its own."""
    mechanism, ball, bodies = linkage.mechanism, model.ball, carriers_of(bearing, linkage)
    joint = mechanism.joint(bearing.joint or "")
    count = sp.S.One if bearing.count is None else symbol_of(bearing.count)
    outer = AT_REST if bearing.outer is None else ring(model.coordinates, 2)
    force = scale(count, ball.ring_force)  # of the inner ring on the balls
    moment = cross(model.apart, force)
    efforts = _against(force, model.parting)
    efforts.append(Effort(amount=moment, rate=ball.cage.rate))
    share = ball.cage.share
    points = [body_point(mechanism, body, joint.point(body)) for body in bodies]
    torques = [share * moment, (1 - share) * moment]
    for torque in (count * total.symbol for total in ball.sums[2:]):  # of the slopes of effects, between both rings
        assert ball.cage.ring_rate is not None
        efforts.append(Effort(amount=torque, rate=ball.cage.ring_rate))
        torques = [torques[0] + torque, torques[1] - torque]
    carried, inertias, weights = ZERO, list[Inertia](), list[Effort]()
    if bearing.outer is not None:
        housing, turning = linkage.motion(bodies[1], joint.point(bodies[1])), linkage.pose(bodies[1]).rate
        mass, stiffness, damping = (
            count * symbol_of(q) for q in (bearing.outer.mass, bearing.outer.stiffness, bearing.outer.damping)
        )
        # the damper turns with the housing
        seen = subtract(outer.velocity, scale(turning, quarter_turn(outer.position)))
        efforts += _against(scale(stiffness, outer.position), outer.velocity)
        efforts += _against(scale(damping, seen), seen)
        torques[1] += damping * cross(outer.position, seen)
        centre = displaced(housing, outer, 1)
        inertias = inertias_of(mass, centre)
        weight = ZERO if mechanism.gravity is None else scale(mass, components(mechanism.gravity, axis=(0, -1)))
        rows = zip(weight, centre.velocity, centre.position, strict=True)
        weights = [Effort(amount=f, rate=v, place=r) for f, v, r in rows if f != 0]
        efforts += weights
        # the reaction is that of the housing: the inner ring's body feels it less what moves the outer ring
        carried = subtract(weight, scale(mass, centre.acceleration))
    forces = (carried, ZERO)
    return Coupled(
        inertias=tuple(inertias),
        efforts=tuple(efforts),
        weights=tuple(weights),
        loads=tuple(
            AppliedLoad(body=body, point=point, force=push, torque=torque)
            for body, point, push, torque in zip(bodies, points, forces, torques, strict=True)
            if body != FRAME
        ),
    )
