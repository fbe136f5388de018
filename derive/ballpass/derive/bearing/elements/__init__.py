"""Rolling elements, one file each.  A new element is a file and a line here and in the runtime's `ratings.elements`."""

from ballpass.derive.bearing.elements.ball import Ball
from ballpass.derive.bearing.elements.cylindrical_roller import CylindricalRoller
from ballpass.derive.bearing.elements.element import RollingElement
from ballpass.derive.bearing.elements.power_law import PowerLaw
from ballpass.runtime.contract.plugins import Registry

#: Elements by their name in the scene file, the usual one first.
ELEMENTS: Registry[RollingElement] = Registry(
    "rolling_elements", "rolling element", RollingElement, (Ball(), CylindricalRoller(), PowerLaw())
)

__all__ = ["ELEMENTS", "RollingElement"]
