"""Law: Kloss's curve of an asynchronous motor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import sympy as sp

from ballpass.derive.drive.laws.law import TorqueLaw, not_zero, same_sign
from ballpass.derive.scene.checker import Checker
from ballpass.derive.scene.quantity import SceneNumber
from ballpass.derive.scene.read_keys import positive, quantity
from ballpass.derive.terms import symbol_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Asynchronous(TorqueLaw):
    """``2 T_b/(s/s_b + s_b/s)``, s = 1 - omega/omega_s: breakdown torque, breakdown slip, synchronous speed.

    References
    ----------
    M. Kloss, Drehmoment und Schlüpfung des Drehstrommotors, Archiv für Elektrotechnik 5 (1916) 59–87.
    """

    name: ClassVar[str] = "asynchronous"

    breakdown_torque: SceneNumber = quantity("N*m", "Breakdown torque of the motor", "M_b", "20 N*m")
    breakdown_slip: SceneNumber = positive("1", "Slip at the breakdown torque", "s_b", 0.2)
    synchronous_speed: SceneNumber = quantity("rad/s", "Synchronous speed of the motor", r"\omega_s", "1500 rpm")

    def torque(self, speed: sp.Expr) -> sp.Expr:
        slip, most = 1 - speed / symbol_of(self.synchronous_speed), symbol_of(self.breakdown_slip)
        # no quotient of the slip, which passes zero
        return 2 * symbol_of(self.breakdown_torque) * most * slip / (slip**2 + most**2)

    def words(self) -> str:
        return "an asynchronous motor by Kloss's curve"

    def check(self, checker: Checker) -> None:
        """Torque and speed in one direction."""
        not_zero(checker, self.synchronous_speed, "synchronous speed")
        same_sign(checker, self.breakdown_torque, self.synchronous_speed, "breakdown torque and synchronous speed")
