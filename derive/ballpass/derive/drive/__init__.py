"""What turns the driver's joint or a shaft: a constant speed, a table of speeds over time, a torque by a law."""

from ballpass.derive.drive.by_torque import by_torque
from ballpass.derive.drive.drive import Drive, OverAngle
from ballpass.derive.drive.known import KnownDrive, known_drive, shaft_drive
from ballpass.derive.drive.laws import LAWS
from ballpass.derive.scene.records import Scene

__all__ = ["LAWS", "Drive", "KnownDrive", "OverAngle", "drive_of", "known_drive"]


def drive_of(scene: Scene) -> Drive:
    """What turns the driver of a scene's mechanism, or its shaft."""
    if scene.mechanism is None:
        assert scene.shaft is not None  # one of the two turns the bearings
        return shaft_drive(scene.shaft, angle_used=any(load.turns for load in scene.loads))
    driver = scene.mechanism.driver
    return known_drive(driver, alone=not scene.bearings) if driver.torque is None else by_torque(driver)
