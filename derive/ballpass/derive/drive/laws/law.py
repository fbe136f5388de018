"""The interface of a law of a drive's torque: its name, its keys in the scene file, its torque over the speed."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

import sympy as sp

from ballpass.derive.scene.checker import Checker
from ballpass.derive.scene.quantity import SceneNumber
from ballpass.derive.terms import Smoothness


class TorqueLaw(ABC):
    """Torque of a drive; a frozen record of ``[mechanism.driver.torque]``.

    Attributes
    ----------
    name : as in the scene file
    smoothness : of the torque over the speed
    """

    __slots__ = ()
    name: ClassVar[str]
    smoothness: ClassVar[Smoothness] = Smoothness.TWICE_SMOOTH

    @abstractmethod
    def torque(self, speed: sp.Expr) -> sp.Expr:
        """Torque on the driven body, counter-clockwise [N*m]; `speed` is that of the driver [rad/s]."""

    @abstractmethod
    def words(self) -> str:
        """Name of the drive in texts: "a constant torque"."""

    def check(self, checker: Checker) -> None:  # noqa: B027  not every law has a number that could be wrong
        """Note faults of its numbers."""


def not_zero(checker: Checker, speed: SceneNumber, word: str) -> None:
    """Note a fault where a speed is zero."""
    if speed.value == 0.0:
        checker.fault(
            speed.path,
            f"the {word} is zero",
            checker.show(speed),
            "a speed other than zero, negative for a motor that turns clockwise",
            "give the speed of the motor, reduced to the driver's joint",
        )


def same_sign(checker: Checker, torque: SceneNumber, speed: SceneNumber, words: str) -> None:
    """Note a fault where speed and torque of a motor have opposite signs."""
    if torque.value * speed.value < 0.0:
        checker.fault(
            torque.path,
            f"the signs of {words} differ: the motor would accelerate beyond that speed",
            f"{checker.show(torque)}, {checker.show(speed)}",
            "both positive, or both negative for a motor that turns clockwise",
            "change the sign of one of the two",
        )
