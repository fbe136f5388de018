"""Parts of a user's own, of every kind that a plugin may add, each with a factor that tests change."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, ClassVar

import sympy as sp

from ballpass.derive.bearing.effects.ball_deviation import BallDeviation
from ballpass.derive.bearing.elements.ball import Ball
from ballpass.derive.bearing.laws import DampingLaw
from ballpass.derive.drive.laws.linear import LinearCharacteristic
from ballpass.derive.mechanism.forces import Law
from ballpass.derive.scene.quantity import NOT_NEGATIVE, SceneNumber
from ballpass.derive.scene.read_keys import not_negative, number
from ballpass.derive.terms import symbol_of
from ballpass.runtime.contract.method_registry import OWN
from ballpass.runtime.quantity.kinds.means import KINDS
from ballpass.runtime.quantity.records import Kind
from ballpass.runtime.questions.question import Question
from ballpass.runtime.ratings.elements.ball import RatedBall

#: Of a part, by the name of its entry point.
FACTORS = {
    "damping_laws": 1,
    "force_laws": 1,
    "torque_laws": 1,
    "rolling_elements": 1,
    "rated_elements": 1,
    "effects": 1,
    "quantities": 1,
    "methods": 1,
    "questions": 1,
}


class Cubic(DampingLaw):
    """c_3 times the elastic force and the cube of the rate."""

    name = "own-damping"
    description = "proportional to the elastic force and the cube of the rate"
    unit = "s^3/m^3"
    keys = MappingProxyType({"cubic": number(unit, "Cubic damping", "c_3", "1e4 s^3/m^3", bounds=NOT_NEGATIVE)})

    def coefficient(self, numbers: Any, stiffness: sp.Expr) -> sp.Expr:
        return numbers["cubic"]

    def force(self, delta: sp.Expr, rate: sp.Expr, coefficient: sp.Expr, contact: Any, rest: Any) -> sp.Expr:
        return FACTORS["damping_laws"] * coefficient * contact.force(delta) * rate**3


@dataclass(frozen=True, slots=True, kw_only=True)
class Drag(Law):
    """A damper whose force is that times the cube of the rate."""

    key: ClassVar[str] = "drag"
    tables: ClassVar[tuple[str, ...]] = ("springs",)

    drag: SceneNumber = not_negative("AMOUNT_UNIT*s^3/SIZE_UNIT^3", "Drag of NAME", "c_{INDEX}", "1e3 N*s^3/m^3")

    def amount(self, force: Any, action: Any, setting: Any) -> sp.Expr:
        return FACTORS["force_laws"] * symbol_of(self.drag) * action.rate**3


@dataclass(frozen=True, slots=True, kw_only=True)
class Motor(LinearCharacteristic):
    """A motor with a linear characteristic."""

    name: ClassVar[str] = "own-motor"

    def torque(self, speed: sp.Expr) -> sp.Expr:
        return FACTORS["torque_laws"] * super(Motor, self).torque(speed)


class OwnBall(Ball):
    """A ball with another stiffness."""

    name = "own-ball"

    def power_law(self, bearing: Any, names: Any) -> tuple[sp.Expr, sp.Expr]:
        factor, exponent = super().power_law(bearing, names)
        return FACTORS["rolling_elements"] * factor, exponent


class RatedOwnBall(RatedBall):
    """A ball with another rating."""

    name = "own-ball"

    def dynamic_rating(self, geometry: Any) -> Any:
        return FACTORS["rated_elements"] * super().dynamic_rating(geometry)


class Swelling(BallDeviation):
    """Single balls that are thicker."""

    name = "swelling"
    words = "balls that swell"

    def term(self, effect: Any, bearing: Any, names: Any, ball: Any) -> sp.Expr:
        return FACTORS["effects"] * super().term(effect, bearing, names, ball)


_MEAN = next(kind for kind in KINDS if kind.name == "mean")


def _mean(view: Any, quantity: Any) -> Any:
    found = _MEAN.evaluate(view, quantity)
    return replace(found, value=FACTORS["quantities"] * found.value, slope=FACTORS["quantities"] * found.slope)


def _reduced_mean(runs: Any, quantity: Any) -> Any:
    return FACTORS["quantities"] * _MEAN.reduced(runs, quantity)


OWN_MEAN = Kind(name="own", summary="mean, times a factor", evaluate=_mean, reduced=_reduced_mean, rows=("integral",))

_PAIR = OWN["dp54"]
OWN_PAIR = replace(
    _PAIR,
    name="Own Pair",
    error_estimates=tuple(
        replace(one, weights=tuple(FACTORS["methods"] * weight for weight in one.weights))
        for one in _PAIR.error_estimates
    ),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class States:
    """An answer."""

    number: int

    def report(self) -> Any:
        from ballpass.runtime.report.report import Report

        return Report(title="States", facts={"number": self.number, "units": {"number": "1"}})


@Question(runs=False)
def count_states(model: Any, *, parameters: Any = None) -> States:
    """Count the states of a model."""
    return States(number=FACTORS["questions"] * len(model.states))


BALLPASS = (Cubic(), Drag, Motor, OwnBall(), RatedOwnBall(), Swelling(), OWN_MEAN, OWN_PAIR, count_states)
