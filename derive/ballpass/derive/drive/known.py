"""The drive by a given speed, constant or a table over time: the angle is known before a run.

Angle = angle at the reference time + speed there times the time since then + half the slope of the speed times its
square; segments of a run end on the rows of a table.  Loads that change with the angle are inputs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import sympy as sp

from ballpass.derive.drive.angle_state import driver_coordinate
from ballpass.derive.drive.drive import Drive, OverAngle
from ballpass.derive.scene.mechanism_records import Driver
from ballpass.derive.scene.quantity import SceneNumber
from ballpass.derive.scene.shaft_records import Shaft
from ballpass.derive.terms import TIME, Definition, defined, symbol_of
from ballpass.derive.variables import DRIVER_ANGLE, Input, gate_of, turned
from ballpass.runtime.contract.manifest import DRIVER_ACCELERATION, TurningInfo


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownDrive(Drive):
    """A drive whose angle is known.

    Attributes
    ----------
    turning : its angle over time
    passed : what it turned since the reference time [rad]
    """

    turning: TurningInfo
    passed: sp.Expr

    @property
    def even(self) -> bool:
        """Whether the speed is constant."""
        return not self.turning.times

    def gate(self, name: str, windows: Sequence[tuple[str, str]]) -> OverAngle:
        """An input."""
        words, latex = f"1 while {name} acts, else 0", rf"g_{{\mathrm{{{name}}}}}"
        gate = gate_of(f"gate.{name}", words, latex, self.turning, tuple(windows))
        return OverAngle(value=gate.symbol, inputs=(gate,))

    def table(self, name: str, unit: str, angles: Sequence[str], values: Sequence[str], turns: int = 1) -> OverAngle:
        """Value at the reference time, plus slope over the angle times the angle turned since then."""

        def entry(kind: Literal["table", "table_rate"], ending: str, unit: str, words: str, latex: str) -> Input:
            return Input(
                name=f"{name}{ending}",
                kind=kind,
                unit=unit,
                description=f"{words} of the table of {name} at the reference time",
                latex=rf"{latex}_{{0,\mathrm{{{name}}}}}",
                turning=self.turning,
                turns=turns,
                times=tuple(angles),
                values=tuple(values),
            )

        value = entry("table", "", unit, "Value", "T")
        slope = entry("table_rate", "_slope", f"{unit}/rad", "Slope over the driver's angle", "T'")
        return OverAngle(value=value.symbol + slope.symbol * self.passed, inputs=(value, slope))


def known_drive(driver: Driver, *, alone: bool = False) -> KnownDrive:
    """Drive of a driver with a speed or a table of it, and a start angle.

    Parameters
    ----------
    alone : whether nothing else has states; the driver's angle by a table is then integrated along, for runs need one
    """
    if driver.swing is not None:
        return _swinging(driver, driver.swing)
    body, first_angle = "the driven body", symbol_of(driver.start_angle)
    turning = _even_turning("driver", driver.start_angle.path, driver.speed.path)
    if driver.table is None:
        return _at_constant_speed(turning, body, DRIVER_ANGLE, (r"\theta_1", r"\theta_{1,0}"), first_angle)
    speeds = (driver.speed, *driver.table.later_speed)
    turning = replace(turning, times=tuple(q.path for q in driver.table.time), speeds=tuple(q.path for q in speeds))
    start = turned(turning, f"Angle of {body} at the reference time", r"\theta_{1,0}")
    rate = turned(turning, f"Speed of {body} at the reference time", r"\omega_{1,0}", "rate")
    slope = Input(
        name=DRIVER_ACCELERATION,
        kind="slope",
        unit="rad/s^2",
        description="Slope of the table of the driver's speed over time",
        latex=r"\alpha_1",
        turning=turning,
    )
    speed = defined("driver.rate", rate.symbol + slope.symbol * TIME, "rad/s", f"Speed of {body}", r"\omega_1")
    passed = (rate.symbol + slope.symbol * TIME / 2) * TIME
    whole = turned(turning, f"Angle of {body}, whole turns counted", r"\theta_{1,0}", "angle")
    passive = replace(driver_coordinate(), position=sp.Symbol("state.driver.angle", real=True)) if alone else None
    return KnownDrive(
        speed=speed.symbol,
        acceleration=slope.symbol,
        first_angle=first_angle,
        first_speed=symbol_of(driver.speed),
        description="slope of the table of the driver's speed",
        definitions=(_angle(body, DRIVER_ANGLE, start, passed, r"\theta_1"), speed),
        inputs=(start, rate, slope, *(() if alone else (whole,))),
        flywheel=sp.S.Zero if driver.flywheel is None else symbol_of(driver.flywheel),
        turning=turning,
        passed=passed,
        passive=passive,
        whole=whole.symbol + passed if passive is None else passive.position,
    )


def _even_turning(name: str, offset: str, rate: str) -> TurningInfo:
    """Driver or shaft at one speed; `offset` and `rate` name its angle at the start and its speed."""
    return TurningInfo(name=name, kind="driver", words=f"the {name}", offset=offset, rate=rate, speeds=(rate,))


def _swinging(driver: Driver, amplitude: SceneNumber) -> KnownDrive:
    """Drive of a driver that swings: its phase turns evenly, and what turns with a driver follows the phase."""
    words, body = "the phase of the driver's swing", "the driven body"
    rate = defined("driver.swing.rate", 2 * sp.pi * symbol_of(driver.speed), "rad/s", f"Rate of {words}", r"\omega_1")
    zero = defined("driver.swing.start", sp.S.Zero, "rad", "Phase of the driver's swing at t = 0", r"\theta_{1,0}")
    turning = _even_turning("driver", zero.symbol.name, rate.symbol.name)
    drive = _at_constant_speed(turning, words, DRIVER_ANGLE, (r"\varphi_1", r"\varphi_{1,0}"), zero.symbol)
    most, cos, sin = symbol_of(amplitude), sp.cos(DRIVER_ANGLE), sp.sin(DRIVER_ANGLE)
    turned_to = symbol_of(driver.start_angle) + most * sin
    second = -most * sin * drive.speed**2
    words = f"Angular acceleration of {body}"
    swings = (
        defined("driver.swing.angle", turned_to, "rad", f"Angle of {body}", r"\theta_1"),
        defined("driver.rate", most * cos * drive.speed, "rad/s", f"Speed of {body}", r"\dot\theta_1"),
        defined("driver.swing.acceleration", second, "rad/s^2", words, r"\ddot\theta_1"),
    )
    angle, speed, acceleration = (one.symbol for one in swings)
    return replace(
        drive,
        description="the driver swings",
        constants=(rate, zero),
        definitions=(*drive.definitions, *swings),
        flywheel=sp.S.Zero if driver.flywheel is None else symbol_of(driver.flywheel),
        whole=angle,
        swings=(angle, speed, acceleration),
    )


def shaft_drive(shaft: Shaft, *, angle_used: bool) -> KnownDrive:
    """The shaft's angle, zero at t = 0.

    Parameters
    ----------
    angle_used : whether a load follows it; balls know their own
    """
    zero = defined("shaft.start_angle", sp.S.Zero, "rad", "Angle of the shaft at t = 0", r"\theta_s")
    turning = _even_turning("shaft", zero.symbol.name, shaft.speed.path)
    angle = sp.Symbol("shaft.angle", real=True)
    drive = _at_constant_speed(turning, "the shaft", angle, (r"\theta", r"\theta_0"), zero.symbol)
    if not angle_used:
        return replace(drive, definitions=(), inputs=())
    return replace(drive, constants=(zero,))


def _at_constant_speed(
    turning: TurningInfo, body: str, angle: sp.Symbol, latex: tuple[str, str], first_angle: sp.Expr
) -> KnownDrive:
    """Drive of driver or shaft.

    Parameters
    ----------
    latex : of the angle, and of that at the reference time
    """
    speed = sp.Symbol(turning.rate, real=True)
    start = turned(turning, f"Angle of {body} at the reference time", latex[1])
    return KnownDrive(
        angle=angle,
        speed=speed,
        acceleration=sp.S.Zero,
        first_angle=first_angle,
        first_speed=speed,
        description=f"{turning.words}'s speed is constant",
        definitions=(_angle(body, angle, start, speed * TIME, latex[0]),),
        inputs=(start,),
        turning=turning,
        passed=speed * TIME,
    )


def _angle(body: str, angle: sp.Symbol, start: Input, passed: sp.Expr, latex: str) -> Definition:
    return defined(angle.name, start.symbol + passed, "rad", f"Angle of {body}", latex)
