"""What turns the driver's joint: a constant speed, or a torque by one of the laws in `laws`."""

from ballpass.derive.drive.by_torque import by_torque
from ballpass.derive.drive.constant_speed import constant_speed
from ballpass.derive.drive.drive import Drive, OverAngle
from ballpass.derive.drive.laws import LAWS
from ballpass.derive.scene.records import Driver

__all__ = ["LAWS", "Drive", "OverAngle", "constant_speed", "drive_of"]


def drive_of(driver: Driver) -> Drive:
    """The drive that a scene asks for."""
    return constant_speed(driver) if driver.torque is None else by_torque(driver)
