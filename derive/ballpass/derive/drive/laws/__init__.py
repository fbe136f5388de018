"""Laws of a drive's torque: each is one file here."""

from ballpass.derive.drive.laws.asynchronous import Asynchronous
from ballpass.derive.drive.laws.constant import ConstantTorque
from ballpass.derive.drive.laws.law import TorqueLaw
from ballpass.derive.drive.laws.linear import LinearCharacteristic
from ballpass.derive.drive.laws.none import NoTorque
from ballpass.derive.drive.laws.speed_table import SpeedTable
from ballpass.runtime.contract.plugins import Registry

#: By the name that stands in the scene file.
LAWS: Registry[type[TorqueLaw]] = Registry(
    "torque_laws",
    "torque law",
    TorqueLaw,
    (ConstantTorque, LinearCharacteristic, SpeedTable, Asynchronous, NoTorque),
    classes=True,
)

__all__ = ["LAWS", "TorqueLaw"]
