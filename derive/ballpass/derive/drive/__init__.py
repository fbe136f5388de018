"""What turns the driver's joint: a constant speed, a table of speeds over time, or a torque by a law in `laws`."""

from ballpass.derive.drive.by_torque import by_torque
from ballpass.derive.drive.drive import Drive, OverAngle
from ballpass.derive.drive.known import KnownDrive, known_drive, shaft_drive
from ballpass.derive.drive.laws import LAWS
from ballpass.derive.scene.records import Driver

__all__ = ["LAWS", "Drive", "KnownDrive", "OverAngle", "drive_of", "shaft_drive"]


def drive_of(driver: Driver, *, alone: bool) -> Drive:
    """The drive that a scene asks for; `alone` as for `known_drive`."""
    return known_drive(driver, alone=alone) if driver.torque is None else by_torque(driver)
