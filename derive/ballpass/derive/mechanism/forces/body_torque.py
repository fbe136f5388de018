"""Pathway: a torque on a body."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

from ballpass.derive.mechanism.balance import Load
from ballpass.derive.mechanism.forces.force import Action, Law, Pathway, Points, Setting
from ballpass.derive.scene.body_keys import read_moving_body
from ballpass.derive.scene.quantity import Quantity
from ballpass.derive.scene.records import Force
from ballpass.derive.scene.schema import Table, upright
from ballpass.derive.terms import symbol_of


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyTorque(Pathway):
    """`torque` [N*m], counter-clockwise; None where the law gives it."""

    column: ClassVar[str] = "torque"
    unit: ClassVar[str] = "N*m"

    body: str
    torque: Quantity | None

    @classmethod
    def read(cls, data: Table, name: str, points: Points, law: type[Law]) -> Self:
        """Keys body and torque."""
        body = read_moving_body(data, points)
        if not law.factor:
            return cls(body=body, torque=None)
        torque = data.quantity(
            "torque",
            "N*m",
            f"Torque {name} on the {body.replace('_', ' ')}, counter-clockwise",
            f"M_{{{upright(name)}}}",
            example="20 N*m",
        )
        return cls(body=body, torque=torque)

    def act(self, force: Force, setting: Setting) -> Action:
        """The torque times the law's factor, or the law's torque."""
        torque = 1 if self.torque is None else symbol_of(self.torque)
        return Action(loads=lambda amount: (Load(body=self.body, torque=amount * torque),))

    def words(self) -> str:
        """Torque and body."""
        return f"torque on {self.body}"
