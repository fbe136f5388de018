"""The drive by a torque: the driver's angle follows from the equations of motion."""

from __future__ import annotations

import sympy as sp

from ballpass.derive.drive.angle_state import AngleState, driver_coordinate
from ballpass.derive.scene.mechanism_records import Driver
from ballpass.derive.terms import Smoothness, defined, refuse_kinks, symbol_of


def by_torque(driver: Driver) -> AngleState:
    """Drive of a driver with a law of its torque; speed and angle are the initial ones."""
    angle = driver_coordinate()
    words = "Torque of the drive on the driven body, counter-clockwise"
    torque = defined("driver.torque", sp.sympify(driver.torque.torque(angle.velocity)), "N*m", words, "M_d")
    refuse_kinks(
        f"The law of the driver, {driver.torque.words()},",
        torque.expression,
        "a smooth function; Max, Min and Abs with `smoothness = Smoothness.KINKED` in its class. Write one.",
        kinked=driver.torque.smoothness is Smoothness.KINKED,
    )
    return AngleState(
        speed=angle.velocity,
        acceleration=angle.acceleration,
        first_angle=symbol_of(driver.start_angle),
        first_speed=symbol_of(driver.speed),
        description="from the equations of motion",
        definitions=(torque,),
        coordinate=angle,
        whole=angle.position,
        torque=torque.symbol,
        smoothness=driver.torque.smoothness,
        flywheel=sp.S.Zero if driver.flywheel is None else symbol_of(driver.flywheel),
    )
