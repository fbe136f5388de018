"""The drive by a table of its speed over time: the angle is a state whose acceleration is known.

The speed is linear between rows and constant outside them.  The acceleration is constant between rows, where segments
of a run end, so that every method integrates speed and angle, of first and second order in time, without error.
"""

from __future__ import annotations

import sympy as sp

from ballpass.derive.drive.angle_state import AngleState, driver_coordinate
from ballpass.derive.scene.records import Driver
from ballpass.derive.terms import symbol_of
from ballpass.derive.variables import Input
from ballpass.runtime.contract.manifest import DRIVER_ACCELERATION


def over_time(driver: Driver) -> AngleState:
    """Drive of a driver with a table of its speed."""
    assert driver.table is not None
    angle = driver_coordinate()
    slope = Input(
        name=DRIVER_ACCELERATION,
        symbol=sp.Symbol("input.driver.acceleration", real=True),
        kind="table_rate",
        unit="rad/s^2",
        description="Slope of the table of the driver's speed over time",
        latex=r"\alpha_1",
        times=tuple(q.path for q in driver.table.time),
        values=tuple(q.path for q in (driver.speed, *driver.table.later_speed)),
    )
    return AngleState(
        speed=angle.velocity,
        acceleration=slope.symbol,
        description="slope of the table of the driver's speed",
        inputs=(slope,),
        coordinate=angle,
        flywheel=sp.S.Zero if driver.flywheel is None else symbol_of(driver.flywheel),
    )
