"""The drive at constant speed: the angle is that at the reference time and speed times what has passed since."""

from __future__ import annotations

import sympy as sp

from ballpass.derive.drive.drive import Drive
from ballpass.derive.scene.records import Driver
from ballpass.derive.terms import TIME, Definition, symbol_of
from ballpass.derive.variables import DRIVER_ANGLE, phase


def constant_speed(driver: Driver) -> Drive:
    """Drive of a driver with speed and start angle."""
    speed = symbol_of(driver.speed)
    words = "Angle of the driven body at the reference time"
    start = phase("driver", words, r"\theta_{1,0}", offset=driver.start_angle.path, rate=driver.speed.path)
    angle = Definition(
        symbol=DRIVER_ANGLE,
        expression=start.symbol + speed * TIME,
        unit="rad",
        description="Angle of the driven body",
        latex=r"\theta_1",
    )
    return Drive(
        angle=DRIVER_ANGLE,
        speed=speed,
        acceleration=sp.S.Zero,
        description="the driver's speed is constant",
        definitions=(angle,),
        phase=start,
        advance=speed * TIME,
    )
