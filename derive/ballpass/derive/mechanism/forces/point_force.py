"""Pathway: a force on a point of a body, with components in the frame's axes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from ballpass.derive.mechanism.balance import AppliedLoad
from ballpass.derive.mechanism.forces.force import Action, Law, Pathway, Setting
from ballpass.derive.mechanism.kinematics import body_point
from ballpass.derive.mechanism.vectors import Pair, scale, unit
from ballpass.derive.scene.body_keys import BODY
from ballpass.derive.scene.keys import TextKey
from ballpass.derive.scene.mechanism_records import Force
from ballpass.derive.scene.quantity import AMOUNT, SceneNumber, Vector
from ballpass.derive.scene.read_keys import force_key, quantity
from ballpass.derive.terms import components, symbol_of


@dataclass(frozen=True, slots=True, kw_only=True)
class PointForce(Pathway):
    """`force` [N] on a named point; where the law gives the amount, its `direction` [rad] alone."""

    body: str = BODY.declared()
    point: str = TextKey(words="The point of it where the force acts", example="C").declared()
    force: Vector = force_key(
        "the force NAME on the BODY", "F", "INDEX", when="required without `table` and `bore`", length_limits=AMOUNT
    ).declared()
    direction: SceneNumber | None = quantity(
        "rad",
        "Direction of the force NAME on the BODY",
        r"\alpha_{INDEX}",
        "180 deg",
        when="required with `table` or `bore`, else refused",
    )

    @classmethod
    def left_out(cls, law: type[Law]) -> dict[str, Any]:
        """The direction, or the force where the law gives the amount."""
        return {"direction": None} if law.factor else {"force": Vector(kind="zero")}

    def act(self, force: Force, setting: Setting) -> Action:
        """The vector times an amount or a factor."""
        point, vector = body_point(setting.linkage.mechanism, self.body, self.point), self.vector(force, setting)
        here = AppliedLoad(body=self.body, at=self.point, point=point)
        return Action(loads=lambda amount: (replace(here, force=scale(amount, vector)),))

    def vector(self, force: Force, setting: Setting) -> Pair:
        """The force, or the direction alone."""
        return components(self.force) if self.direction is None else unit(symbol_of(self.direction))

    def words(self) -> str:
        """Force and point."""
        return f"force on {self.body}.{self.point}"
