"""Law: the straight characteristic of a direct-current motor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import sympy as sp

from ballpass.derive.drive.laws.law import TorqueLaw, not_zero, same_sign
from ballpass.derive.scene.checker import Checker
from ballpass.derive.scene.quantity import Quantity
from ballpass.derive.scene.schema import Table, listing
from ballpass.derive.terms import symbol_of


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearCharacteristic(TorqueLaw):
    """``T (omega_0 - omega)/(omega_0 - omega_T)``: `amount` T [N*m] at the speed `at` [rad/s], or at rest (None)."""

    name: ClassVar[str] = "linear"

    no_load_speed: Quantity
    amount: Quantity
    at: Quantity | None

    @classmethod
    def read(cls, data: Table) -> Self:
        data.know("stall_torque", "nominal_torque", "nominal_speed")
        nominal = "nominal_torque" in data.data or "nominal_speed" in data.data
        if nominal == ("stall_torque" in data.data):
            data.fault(
                "",
                "the torque is given twice" if nominal else "the torque is missing",
                given=listing([k for k in ("stall_torque", "nominal_torque", "nominal_speed") if k in data.data]),
                allowed="no_load_speed with either stall_torque, or nominal_torque and nominal_speed",
                remedy="delete stall_torque, or the nominal point" if nominal else 'add stall_torque = "20 N*m"',
            )
            data.missing = True  # which keys are missing depends on what stays
        no_load = data.quantity("no_load_speed", "rad/s", "No-load speed of the motor", r"\omega_0", example="1500 rpm")
        if not nominal:
            words = "Torque of the motor at rest"
            return cls(
                no_load_speed=no_load,
                amount=data.quantity("stall_torque", "N*m", words, "M_0", example="20 N*m"),
                at=None,
            )
        return cls(
            no_load_speed=no_load,
            amount=data.quantity("nominal_torque", "N*m", "Nominal torque of the motor", "M_N", example="5 N*m"),
            at=data.quantity("nominal_speed", "rad/s", "Nominal speed of the motor", r"\omega_N", example="1400 rpm"),
        )

    def torque(self, speed: sp.Expr) -> sp.Expr:
        no_load = symbol_of(self.no_load_speed)
        span = no_load if self.at is None else no_load - symbol_of(self.at)
        return symbol_of(self.amount) / span * (no_load - speed)

    def words(self) -> str:
        return "a motor with a linear characteristic"

    def check(self, checker: Checker) -> None:
        """The torque falls with the speed, and vanishes at the no-load speed."""
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
