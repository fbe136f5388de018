"""Pathway: a torque on a body."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from ballpass.derive.mechanism.balance import AppliedLoad
from ballpass.derive.mechanism.forces.force import Action, Law, Pathway, Setting
from ballpass.derive.scene.body_keys import BODY
from ballpass.derive.scene.mechanism_records import Force
from ballpass.derive.scene.quantity import SceneNumber
from ballpass.derive.scene.read_keys import quantity
from ballpass.derive.terms import symbol_of


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyTorque(Pathway):
    """`torque` [N*m], counter-clockwise; None where the law gives it."""

    column: ClassVar[str] = "torque"
    unit: ClassVar[str] = "N*m"

    body: str = BODY.declared()
    torque: SceneNumber | None = quantity(
        "N*m", "Torque NAME on the BODY, counter-clockwise", "M_{INDEX}", "20 N*m", when="required without `table`"
    )

    @classmethod
    def left_out(cls, law: type[Law]) -> dict[str, Any]:
        """The torque where the law gives it."""
        return {} if law.factor else {"torque": None}

    def act(self, force: Force, setting: Setting) -> Action:
        """The torque times the law's factor, or the law's torque."""
        torque = 1 if self.torque is None else symbol_of(self.torque)
        return Action(loads=lambda amount: (AppliedLoad(body=self.body, torque=amount * torque),))

    def words(self) -> str:
        """Torque and body."""
        return f"torque on {self.body}"
