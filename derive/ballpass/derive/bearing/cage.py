"""Angle of the balls: pure rolling between two rings that turn.

In: a bearing and how its rings turn.  Out: a `Cage`: angle and rate of ball 1, and what they are made of.
"""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from ballpass.derive.drive import Drive
from ballpass.derive.mechanism.kinematics import Ledger, Pose
from ballpass.derive.mechanism.swing import Swing
from ballpass.derive.scene.records import Bearing, Driver
from ballpass.derive.terms import TIME, Definition, Names, symbol_of
from ballpass.derive.variables import Input, phase


@dataclass(frozen=True, slots=True, kw_only=True)
class Cage:
    """How the balls turn.

    Attributes
    ----------
    angle, rate : of ball 1 [rad], [rad/s]
    inputs : the one that holds the part of the angle that grows evenly, at the reference time; none where the driver's
        angle is a coordinate
    constants, definitions : of the symbols in these
    """

    angle: sp.Expr
    rate: sp.Symbol
    inputs: tuple[Input, ...]
    constants: tuple[Definition, ...]
    definitions: tuple[Definition, ...] = ()


def cage_ratio(names: Names) -> sp.Symbol:
    """Share of the inner ring's speed in that of the cage; the rest is that of the outer ring's."""
    return names.constant("cage_ratio")


def cage_on_shaft(bearing: Bearing, shaft_speed: sp.Expr) -> Cage:
    """Inner ring at constant speed [rad/s], outer ring at rest, Eq. (7)."""
    names = Names(prefix=bearing.prefix, path=bearing.path)
    speed, even = names.constant("cage_speed"), _phase(bearing, names)
    constants = (
        _ratio(bearing, names),
        names.define(speed, cage_ratio(names) * shaft_speed, "rad/s", "Speed of the cage", r"\omega_c"),
    )
    return Cage(angle=even.symbol + speed * TIME, rate=speed, inputs=(even,), constants=constants)


def cage_between(
    bearing: Bearing, bodies: tuple[Pose, Pose], swings: tuple[Swing, Swing], driver: Driver, drive: Drive
) -> Cage:
    """Rings that turn with two bodies: ``theta_0`` plus both angles since the start, each with its weight.

    Parameters
    ----------
    bodies, swings : of the bodies that carry inner and outer ring
    driver, drive : the driver of the scene, and how it moves; where a torque drives, constant speeds are initial ones
    """
    names = Names(prefix=bearing.prefix, path=bearing.path)
    ledger = Ledger()
    driver_speed, start = symbol_of(driver.speed), symbol_of(driver.start_angle)
    speed, ratio = names.constant("cage_speed"), cage_ratio(names)
    weights = (ratio, 1 - ratio)
    swung = sum((w * (s.swing - s.at_start) for w, s in zip(weights, swings, strict=True)), start=sp.S.Zero)
    turns = sum((w * s.turns for w, s in zip(weights, swings, strict=True)), start=sp.S.Zero)
    rate = ledger.define(
        f"{bearing.prefix}cage.rate",
        sum((w * body.rate for w, body in zip(weights, bodies, strict=True)), start=sp.S.Zero),
        "rad/s",
        "speed of the balls about the bearing's axis",
        names.latex(r"\dot\psi"),
    )
    words = "Mean speed of the balls about the bearing's axis"
    between = (swings[0].turns - swings[1].turns) * driver_speed
    constants = (
        _ratio(bearing, names),
        names.define(
            names.constant("ring_speed"),
            between,
            "rad/s",
            "Mean speed of the inner ring relative to the outer one",
            r"\omega_{io}",
        ),
        names.define(speed, turns * driver_speed, "rad/s", words, r"\omega_c"),
    )
    even = _phase(bearing, names)
    free = drive.coordinate is not None
    angle = symbol_of(bearing.ball_angle) + turns * (drive.angle - start) if free else even.symbol + speed * TIME
    return Cage(
        angle=angle + swung,
        rate=rate,
        inputs=() if free else (even,),
        constants=constants,
        definitions=ledger.definitions,
    )


def _ratio(bearing: Bearing, names: Names) -> Definition:
    ball_diameter, pitch_diameter = symbol_of(bearing.ball_diameter), symbol_of(bearing.pitch_diameter)
    return names.define(
        cage_ratio(names),
        (1 - ball_diameter / pitch_diameter) / 2,
        "1",
        "Speed of the cage over speed of the inner ring, r_b/(R_b + r_b), Eq. (7)",
        r"\omega_c/\omega",
    )


def _phase(bearing: Bearing, names: Names) -> Input:
    return phase(
        f"{bearing.prefix}cage",
        f"Angle of ball 1{f' of {bearing.name}' if bearing.name else ''} at the reference time",
        names.latex(r"\psi_0"),
        offset=bearing.ball_angle.path,
        rate=f"{bearing.path}.cage_speed",
    )
