"""Pathway: a force on a point of a body, with components in the frame's axes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import sympy as sp

from ballpass.derive.mechanism.balance import Load
from ballpass.derive.mechanism.forces.force import Action, Law, Pathway, Points, Setting
from ballpass.derive.mechanism.kinematics import body_point, scale
from ballpass.derive.scene.body_keys import read_moving_body, refuse_unknown_point
from ballpass.derive.scene.checker import Checker
from ballpass.derive.scene.quantity import Quantity, Vector
from ballpass.derive.scene.records import Force
from ballpass.derive.scene.schema import Table, upright, words_of_force
from ballpass.derive.terms import components, symbol_of


@dataclass(frozen=True, slots=True, kw_only=True)
class PointForce(Pathway):
    """`force` [N] on a named point; where the law gives the amount, its `direction` [rad] alone."""

    body: str
    point: str
    force: Vector
    direction: Quantity | None = None

    @classmethod
    def read(cls, data: Table, name: str, points: Points, law: type[Law]) -> Self:
        """Keys body, point and force; instead of the force its direction where the law gives the amount."""
        body = read_moving_body(data, points)
        point = data.text("point", "C") or ""
        if body and point:
            refuse_unknown_point(data, "point", body, point, points)
        what = f"the force {name} on the {body.replace('_', ' ')}"
        if not law.factor:
            words, latex = f"Direction of {what}", rf"\alpha_{{{upright(name)}}}"
            direction = data.quantity("direction", "rad", words, latex, example="180 deg")
            return cls(body=body, point=point, force=Vector(kind="zero"), direction=direction)
        return cls(body=body, point=point, force=data.vector("force", "N", words_of_force(what, "F", upright(name))))

    def act(self, force: Force, setting: Setting) -> Action:
        """The force times the law's factor."""
        point = body_point(setting.mechanism, self.body, self.point)
        vector = components(self.force)
        if self.direction is not None:
            angle = symbol_of(self.direction)
            vector = sp.cos(angle), sp.sin(angle)
        return Action(loads=lambda amount: (Load(body=self.body, point=point, force=scale(amount, vector)),))

    def words(self) -> str:
        """Force and point."""
        return f"force on {self.body}.{self.point}"

    def check(self, checker: Checker) -> None:
        """A magnitude is not negative."""
        checker.polar(self.force)
