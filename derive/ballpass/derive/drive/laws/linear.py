"""Law: the straight characteristic of a direct-current motor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import sympy as sp

from ballpass.derive.drive.laws.law import TorqueLaw, not_zero, same_sign
from ballpass.derive.scene.checker import Checker
from ballpass.derive.scene.quantity import SceneNumber
from ballpass.derive.scene.read_keys import Either, quantity
from ballpass.derive.terms import symbol_of


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearCharacteristic(TorqueLaw):
    """``T (omega_0 - omega)/(omega_0 - omega_T)``: `amount` T [N*m] at the speed `at` [rad/s], or at rest (None)."""

    name: ClassVar[str] = "linear"

    one_of: ClassVar[tuple[Either, ...]] = (
        Either(what="the torque", groups=(("stall_torque",), ("nominal_torque", "nominal_speed"))),
    )

    no_load_speed: SceneNumber = quantity("rad/s", "No-load speed of the motor", r"\omega_0", "1500 rpm")
    stall_torque: SceneNumber | None = quantity("N*m", "Torque of the motor at rest", "M_0", "20 N*m")
    nominal_torque: SceneNumber | None = quantity("N*m", "Nominal torque of the motor", "M_N", "5 N*m")
    at: SceneNumber | None = quantity(
        "rad/s", "Nominal speed of the motor", r"\omega_N", "1400 rpm", name="nominal_speed"
    )

    @property
    def amount(self) -> SceneNumber:
        """The torque at rest, or the nominal one."""
        amount = self.stall_torque or self.nominal_torque
        assert amount is not None  # `one_of`
        return amount

    def torque(self, speed: sp.Expr) -> sp.Expr:
        no_load = symbol_of(self.no_load_speed)
        span = no_load if self.at is None else no_load - symbol_of(self.at)
        return symbol_of(self.amount) / span * (no_load - speed)

    def words(self) -> str:
        return "a motor with a linear characteristic"

    def check(self, checker: Checker) -> None:
        """The torque falls with the speed, and vanishes at the no-load speed."""
        if self.stall_torque is None and self.nominal_torque is None:  # reported
            return
        not_zero(checker, self.no_load_speed, "no-load speed")
        same_sign(checker, self.amount, self.no_load_speed, "torque and no-load speed")
        if self.at is not None and not 0.0 <= self.at.value / (self.no_load_speed.value or 1.0) < 1.0:
            checker.fault(
                self.at.path,
                "the nominal speed does not lie between rest and the no-load speed",
                f"nominal speed {checker.show(self.at)}, no-load speed {checker.show(self.no_load_speed)}",
                "a nominal speed below the no-load speed, in its direction",
                "check both on the motor's data sheet",
            )
