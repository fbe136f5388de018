"""What turns the driver's joint: a constant speed, a table of speeds over time, or a torque by a law in `laws`."""

from ballpass.derive.drive.by_torque import by_torque
from ballpass.derive.drive.constant_speed import constant_speed
from ballpass.derive.drive.drive import Drive, OverAngle
from ballpass.derive.drive.laws import LAWS
from ballpass.derive.drive.over_time import over_time
from ballpass.derive.scene.records import Driver

__all__ = ["LAWS", "Drive", "OverAngle", "drive_of"]


def drive_of(driver: Driver) -> Drive:
    """The drive that a scene asks for."""
    if driver.torque is not None:
        return by_torque(driver)
    return constant_speed(driver) if driver.table is None else over_time(driver)
