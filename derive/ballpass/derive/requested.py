"""Outputs on request: computed, differentiated and generated only where a scene names them.

In: the derived parts of a model.  Out: `Output` after `Output`, each an expression in the model's symbols.

Powers are positive where they add to the machine's kinetic energy; losses are what dampers take, never negative.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase

import sympy as sp

from ballpass.derive.bearing.elements import ELEMENTS
from ballpass.derive.bearing.equations import BearingModel
from ballpass.derive.mechanism.balance import AppliedLoad
from ballpass.derive.mechanism.linear_forms import Effort, Inertia
from ballpass.derive.mechanism.linkage import Linkage
from ballpass.derive.mechanism.power import work_of
from ballpass.derive.mechanism.reactions import Reactions
from ballpass.derive.mechanism.vectors import Pair, cross, dot, quarter_turn, scale, subtract
from ballpass.derive.outputs import made, named_rings
from ballpass.derive.scene.bearing_records import Bearing
from ballpass.derive.scene.mechanism_records import CENTER_OF_MASS
from ballpass.derive.terms import Definition, Names, symbol_of
from ballpass.derive.variables import Output, Words

APPLIED = "Power of the drive, forces and torques, and of loads on rings loaded one-way"


def power_of(efforts: Iterable[Effort]) -> sp.Expr:
    """Power of forces and torques along their rates [W]."""
    return sp.Add(*(effort.amount * effort.rate for effort in efforts))


def motion_outputs(linkage: Linkage, reactions: Reactions) -> list[Output]:
    """Motion of every point and body, and magnitudes of the reactions."""
    out: list[Words] = []
    for body in linkage.mechanism.bodies:
        pose = linkage.poses[body.name]
        points = {p.name: linkage.motion(body.name, p.name) for p in body.points}
        for point, motion in (points | {CENTER_OF_MASS: pose.center_of_mass}).items():
            rows = (("", motion.position, "m"), ("v", motion.velocity, "m/s"), ("a", motion.acceleration, "m/s^2"))
            words = f"of {point} of the {body.name}"
            for (mark, pair, unit), what in zip(rows, ("Position", "Velocity", "Acceleration"), strict=True):
                for axis, value in zip("xy", pair, strict=True):
                    name = f"point.{body.name}.{point}.{mark}{axis}"
                    out.append((name, value, unit, f"{what} {words} along {axis}"))
        turning = f"of the {body.name}, counter-clockwise"
        out.append((f"body.{body.name}.speed", pose.rate, "rad/s", f"Angular velocity {turning}"))
        out.append((f"body.{body.name}.acceleration", pose.acceleration, "rad/s^2", f"Angular acceleration {turning}"))
    for joint in linkage.mechanism.joints:
        force = reactions.joint_force[joint.name]
        words = f"Magnitude of the force of the {joint.bodies[1]} on the {joint.bodies[0]} at {joint.name}"
        out.append((f"reaction.{joint.name}.magnitude", sp.sqrt(dot(force, force)), "N", words))
    return made(out)


def power_outputs(
    linkage: Linkage,
    reactions: Reactions,
    *,
    loads: Mapping[str, Sequence[AppliedLoad]],
    inertias: Sequence[Inertia],
    weights: Sequence[Effort],
) -> list[Output]:
    """Power of everything that acts on a linkage, and its kinetic energy.

    Parameters
    ----------
    loads : of each force, by its label
    inertias : of all moving parts
    weights : work of gravity
    """
    out: list[Words] = [
        (f"{label}.power", power_of(work_of(those, linkage)), "W", f"Power of {label.rpartition('.')[2]} on the bodies")
        for label, those in loads.items()
    ]
    if weights:
        out.append(("weight.power", power_of(weights), "W", "Power of all weights"))
        height = sp.Add(*(-weight.amount * weight.place for weight in weights))
        out.append(("weight.energy", height, "J", "Potential energy of all weights, 0 at the frame's origin"))
    if linkage.drive.whole is None:  # else it is listed
        power = reactions.drive_torque * linkage.drive.speed
        out.append(("drive_power", power, "W", "Power of the drive"))
    energy = sp.Add(*(inertia.amount * inertia.rate**2 for inertia in inertias)) / 2
    out.append(("kinetic_energy", energy, "J", "Kinetic energy of all moving parts, without rings loaded one-way"))
    return made(out)


def balance_outputs(outputs: Sequence[Output]) -> list[Output]:
    """Sums of what is named one by one: energy of all kinds, the power that changes it, and what dampers take.

    Parameters
    ----------
    outputs : all of a scene
    """

    def named(*patterns: str, sign: int = 1) -> list[Output]:
        return [
            o if sign > 0 else replace(o, expression=-o.expression)
            for o in outputs
            if not o.per_ball and any(fnmatchcase(o.name, pattern) for pattern in patterns)
        ]

    lost = [*named("*.loss"), *named("friction.*.power", "guide_friction.*.power", sign=-1)]
    rows = [
        ("applied_power", named("drive_power", "force.*.power", "torque.*.power", "*load.power"), "W", APPLIED),
        ("dissipated_power", lost, "W", "Power that all dampers and frictions take"),
    ]
    energies = named("*.energy", "*kinetic_energy")
    # a smoothed onset has no potential energy by name; balls of rings loaded one-way take work from no body
    without = {o.balls_of for o in outputs if o.per_ball} - {o.balls_of for o in energies}
    if not without and not named("*load.power"):
        rows.append(("total_energy", energies, "J", "Kinetic and potential energy of all parts"))
    return [
        Output(name=name, expression=sp.S.Zero, unit=unit, description=words, parts=tuple(parts))
        for name, parts, unit, words in rows
        if parts
    ]


def ring_outputs(model: BearingModel) -> list[Output]:
    """Accelerations of the rings' centres."""
    rings = named_rings(model, "a")
    return made((name, c.acceleration, f"{c.unit}/s^2", f"Acceleration {c.description}") for name, c in rings)


def contact_outputs(bearing: Bearing, model: BearingModel) -> list[Output]:
    """Contact of every ball with both raceways, under its elastic force, and its stiffness."""
    ball, names = model.ball, model.names
    of = f" of {bearing.name}" if bearing.name else ""
    force = ball.elastic_force
    elastic = next(d.expression for d in ball.definitions if d.symbol == force)
    slope, count = sp.diff(elastic, ball.deflection), _count(bearing)
    deflection = next(d.expression for d in ball.definitions if d.symbol == ball.deflection)
    x, y = (c.position for c in model.coordinates[:2])
    axes_of = {"xx": (x, x), "xy": (x, y), "yy": (y, y)}
    out = []
    for axes, (one, other) in axes_of.items():
        steep = slope * sp.diff(deflection, one) * sp.diff(deflection, other)
        entry = count * (steep + force * sp.diff(deflection, one, other))
        words = names.words(f"Entry {axes} of the stiffness matrix of all balls") + of
        out.append(_of_balls(names, f"contact.stiffness.{axes}", entry, "N/m", words, over_balls=True))
    words = names.words("Slope of the elastic force of each ball") + f"{of} by its deflection"
    out.append(_of_balls(names, "ball.stiffness", slope, "N/m", words))
    element = ELEMENTS[bearing.element]
    if bearing.contact.smoothing is None:  # k delta^n from 0 on
        energy = count * force * ball.deflection / (element.power_law(bearing, names)[1] + 1)
        words = f"Potential energy of the elastic forces of all {element.noun}s{of}"
        out.append(_of_balls(names, "contact.energy", energy, "J", words, over_balls=True))
    contact = f"each {element.noun}'s contact{of}"
    for ring, (constants, quantities) in element.contact_quantities(bearing, names, force).items():
        for name, expression, unit, words in quantities:
            value = sp.Piecewise((expression, force > 0), (0, True))
            described = words.format(contact)
            out.append(_of_balls(names, f"ball.{ring}_{name}", value, unit, described, constants=constants))
    return out


def _count(bearing: Bearing) -> sp.Expr:
    """Bearings side by side."""
    return sp.S.One if bearing.count is None else symbol_of(bearing.count)


def bearing_power_outputs(bearing: Bearing, model: BearingModel, load: Pair | None, turning: sp.Expr) -> list[Output]:
    """Power of the balls and of the housing's spring and damper on the rings, and power loss of the dampers.

    Parameters
    ----------
    load : on the inner ring, where it is loaded one-way [N]
    turning : angular velocity of the housing [rad/s]
    """
    ball, names, c = model.ball, model.names, model.coordinates
    of = f" of {bearing.name}" if bearing.name else ""
    count = _count(bearing)
    speed = c[0].velocity, c[1].velocity
    one_way = bearing.coupling == "one-way"
    rows: list[Words] = []
    if bearing.outer is not None:
        stiffness, damping = symbol_of(bearing.outer.stiffness), symbol_of(bearing.outer.damping)
        out, moving = (c[2].position, c[3].position), (c[2].velocity, c[3].velocity)
        # in a linkage with play the damper turns with the housing
        seen = moving if one_way else subtract(moving, scale(turning, quarter_turn(out)))
        loss = count * damping * dot(seen, seen)
        spring, stored = -count * stiffness * dot(out, moving), count * stiffness * dot(out, out) / 2
        rows = [
            ("housing.power", spring - loss, "W", f"Power of the housing's spring and damper{of}"),
            ("housing.energy", stored, "J", f"Potential energy of the housing's spring{of}"),
            ("housing.loss", loss, "W", f"Power loss of the housing's damper{of}"),
        ]
    force = ball.ring_force  # of the inner ring on the balls
    # where rings are loaded one-way the cage's moments have no effect
    moment = cross(model.apart, force)
    power = count * ((sp.S.Zero if one_way else moment * ball.cage.rate) - dot(force, model.parting))
    if not one_way and ball.cage.ring_rate is not None:
        power += count * sum(total.symbol for total in ball.sums[2:]) * ball.cage.ring_rate
    rows.append(("cage.moment", count * moment, "N*m", f"Moment of the rings on the cage{of}, counter-clockwise"))
    rows.append(("contact.power", power, "W", names.words("Power of all ball forces") + of))
    if load is not None:
        rows.append(("load.power", dot(load, speed), "W", f"Power of the load on the inner ring{of}"))
    if one_way:
        masses = [(names.constant("m_ei"), speed)] if load is not None else []  # else of the shaft that tilts
        if bearing.outer is not None:
            masses.append((symbol_of(bearing.outer.mass), moving))
        energy = sp.Add(*(mass * dot(v, v) for mass, v in masses)) / 2
        rows.append(("rings.kinetic_energy", energy, "J", f"Kinetic energy of the rings{of}"))
        if bearing.inner is not None and bearing.inner.damping is not None:
            loss = symbol_of(bearing.inner.damping) * dot(speed, speed)
            rows.append(("inner.loss", loss, "W", f"Power loss of the damper of the inner ring{of}"))
    found = made((f"{names.prefix}{n}", e, u, d) for n, e, u, d in rows)
    if ball.damping_force is not None:
        taken = ball.damping_force * ball.deflection_rate
        words = names.words("Power loss by the damping force of each ball") + of
        found.append(_of_balls(names, "ball.loss", taken, "W", words))
        words = names.words("Power loss by the damping forces of all balls") + of
        found.append(_of_balls(names, "contact.loss", count * taken, "W", words, over_balls=True))
    return found


def _of_balls(
    names: Names,
    name: str,
    expression: sp.Expr,
    unit: str,
    description: str,
    *,
    over_balls: bool = False,
    constants: tuple[Definition, ...] = (),
) -> Output:
    """An output of each ball, or their sum."""
    return Output(
        name=f"{names.prefix}{name}",
        expression=expression,
        unit=unit,
        description=description,
        per_ball=not over_balls,
        balls_of=names.prefix,
        over_balls=over_balls,
        constants=constants,
    )
