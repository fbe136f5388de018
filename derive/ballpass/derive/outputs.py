"""Outputs of a model: all that it can report, and those that its scene asks for.

In: the derived parts of a model.  Out: `Output` after `Output`, each an expression in the model's symbols.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from fnmatch import fnmatchcase

import sympy as sp

from ballpass.derive.bearing.equations import BearingModel
from ballpass.derive.mechanism.linkage import Linkage
from ballpass.derive.mechanism.reactions import Reactions
from ballpass.derive.mechanism.vectors import Pair
from ballpass.derive.scene.errors import Fault, SceneError
from ballpass.derive.terms import TIME
from ballpass.derive.variables import DRIVER_ANGLE, Coordinate, Output, Words

#: Key of the scene file under which its outputs stand.
OUTPUTS = "run.outputs"


def named_rings(bearing: BearingModel, rate: str = "") -> Iterator[tuple[str, Coordinate]]:
    """Coordinates of a bearing with the names of its outputs, "b.inner.x" where the coordinate is "a.inner.x" too."""
    for c in bearing.coordinates:
        *_, ring, axis = c.name.split(".")
        yield f"{bearing.names.prefix}{ring}.{rate}{axis}", c


def made(rows: Iterable[Words]) -> list[Output]:
    """Outputs of rows."""
    return [Output(name=n, expression=e, unit=u, description=d) for n, e, u, d in rows]


def bearing_outputs(bearing: BearingModel, load: Pair | None) -> list[Output]:
    """Outputs of a bearing, in the order of listing: rings, balls, sums over the balls, load on the inner ring."""
    prefix, noun, ball = bearing.names.prefix, bearing.noun, bearing.ball
    of = f" of {prefix[:-1]}" if prefix else ""
    rings: list[Words] = [(name, c.position, c.unit, c.words[0]) for name, c in named_rings(bearing)]
    rings += [(name, c.velocity, c.velocity_unit, c.words[1]) for name, c in named_rings(bearing, "v")]
    per_ball = [
        (ball.deflection, "m", f"Deflection of each {noun}, Eq. (6)"),
        (ball.elastic_force, "N", f"Elastic force of each {noun}, Eq. (4)"),
    ]
    if ball.damping_force is not None:
        per_ball.append((ball.damping_force, "N", f"Damping force of each {noun}, Eq. (10)"))
    per_ball.append((ball.force, "N", f"Elastic and damping force of each {noun}"))
    sums: list[Words] = []
    for ring, angle in (("outer", ball.cage.in_outer), ("inner", ball.cage.in_inner)):
        words = f"Angle of {noun} 1{of} as the {ring} ring sees it, from where that ring's x axis was at the start"
        # with time in it the angle grows on from one reference time to the next; else the driver's whole turns count
        seen = _within_turn(angle, -sp.pi) if angle.has(TIME) else angle
        sums.append((f"{prefix}cage.in_{ring}", seen, "rad", words))
    for axis, total in zip("xy", ball.ring_force, strict=True):
        words = f"Force of the inner ring on the {noun}s{of} along {axis}, Eqs. (8) and (9)"
        sums.append((f"{prefix}ring_force.{axis}", total, "N", words))
    for axis, force in zip("xy", load or (), strict=False):
        sums.append((f"{prefix}load.{axis}", force, "N", f"External load on the inner ring{of} along {axis}"))
    return [
        *made(rings),
        *(
            Output(name=s.name, expression=s, unit=u, description=d + of, balls_of=prefix, per_ball=True)
            for s, u, d in per_ball
        ),
        *made(sums),
    ]


def mechanism_outputs(linkage: Linkage, reactions: Reactions) -> list[Output]:
    """Outputs of a mechanism, in the order of listing: reactions, drive, angles of the bodies."""
    rows: list[Words] = []
    for joint in linkage.contacts:
        name, (first, second) = joint.name, joint.bodies
        for axis, force in zip("xy", reactions.joint_force[name], strict=True):
            words = f"Force of the {second} on the {first} at {name} along {axis}"
            rows.append((f"reaction.{name}.{axis}", force, "N", words))
        if name in reactions.joint_moment:
            words = f"Moment of the {second} on the {first} at {name}"
            rows.append((f"reaction.{name}.moment", reactions.joint_moment[name], "N*m", words))
    rows += [row for dyad in linkage.dyads for row in dyad.outputs]
    drive = linkage.drive
    torque = reactions.drive_torque if drive.torque is None else drive.torque
    rows.append(("drive_torque", torque, "N*m", "Torque of the drive on the driven body, counter-clockwise"))
    if drive.whole is not None:
        _, speed, acceleration = drive.driven
        rows += [
            ("drive_power", torque * speed, "W", "Power of the drive"),
            ("driver.angle", drive.whole, "rad", "Angle of the driven body from +x, whole turns counted"),
            ("driver.speed", speed, "rad/s", "Speed of the driven body"),
            ("driver.acceleration", acceleration, "rad/s^2", "Angular acceleration of the driven body"),
        ]
    if drive.coordinate is None:
        within = _within_turn(DRIVER_ANGLE, sp.S.Zero)
        words = "Angle of the driven body, within the turn"
        words = words if drive.swings is None else "Phase of the driver's swing, within its period"
        rows.append(("drive_angle", within, "rad", words))
    for body, pose in ((body.name, linkage.poses[body.name]) for body in linkage.mechanism.bodies):
        words = f"Angle of the x axis of the {body} from +x"
        rows.append((f"body.{body}.angle", sp.atan2(pose.sin, pose.cos), "rad", words))
    return made(rows)


def _within_turn(angle: sp.Expr, first: sp.Expr) -> sp.Expr:
    """The angle without whole turns, from `first` on [rad]."""
    turn = 2 * sp.pi
    return angle - turn * sp.floor((angle - first) / turn, evaluate=False)


def is_asked(patterns: tuple[str, ...], name: str) -> bool:
    """Whether one of a scene's patterns names the output."""
    return any(fnmatchcase(name, p) for p in patterns)


def select_outputs(
    available: Sequence[Output], requested: Sequence[Output], patterns: tuple[str, ...]
) -> tuple[Output, ...]:
    """Outputs that the patterns name, in the order of `available`, then of `requested`.

    A pattern selects the outputs of `available` that it matches; where there are none, those of `requested`.

    Raises
    ------
    SceneError
        A pattern names none of them.
    """
    names, further = [o.name for o in available], [o.name for o in requested]
    beyond = tuple(p for p in patterns if not any(fnmatchcase(name, p) for name in names))
    faults = [
        Fault(
            key=OUTPUTS,
            problem="no output of this scene matches",
            given=repr(pattern),
            allowed=", ".join(names) + f"; on request {_grouped(further)}" * bool(further),
            remedy="correct or remove the pattern",
        )
        for pattern in beyond
        if not any(fnmatchcase(name, pattern) for name in further)
    ]
    if faults:
        raise SceneError(faults)
    asked = (o for o in available if is_asked(patterns, o.name))
    return (*asked, *(o for o in requested if is_asked(beyond, o.name)))


def _grouped(names: Sequence[str]) -> str:
    """Names grouped by the part before the last dot: point.rod.B.{x,y,vx,vy}."""
    ends: dict[str, list[str]] = {}
    for name in names:
        stem, dot, end = name.rpartition(".")
        ends.setdefault(stem + dot if dot else name, []).append(end)
    return ", ".join(stem + f"{{{','.join(found)}}}" if stem.endswith(".") else stem for stem, found in ends.items())
