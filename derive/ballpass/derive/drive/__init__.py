"""What turns the driver's joint: each kind of drive is one file here."""

from ballpass.derive.drive.constant_speed import constant_speed
from ballpass.derive.drive.drive import Drive

__all__ = ["Drive", "constant_speed"]
