"""Law: friction against a rate, in proportion to it (viscous), of a given amount (Coulomb), or both."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import sympy as sp

from ballpass.derive.mechanism.forces.force import Action, Law, Pathway, Setting
from ballpass.derive.mechanism.kinematics import subscript
from ballpass.derive.scene.checker import Checker
from ballpass.derive.scene.quantity import Quantity
from ballpass.derive.scene.records import Force
from ballpass.derive.scene.schema import Table, upright
from ballpass.derive.scene.units import show
from ballpass.derive.terms import symbol_of
from ballpass.derive.variables import Output


@dataclass(frozen=True, slots=True, kw_only=True)
class Friction(Law):
    """``viscous * rate + coulomb * tanh(rate / smoothing)``; what the scene does not name has no term.

    At a revolute joint in [N*m*s/rad], [N*m] and [rad/s], at a guide in [N*s/m], [N] and [m/s].
    """

    viscous: Quantity | None
    coulomb: Quantity | None
    smoothing: Quantity | None

    @classmethod
    def read(cls, data: Table, name: str, pathway: type[Pathway]) -> Self:
        """Viscous, or torque (force) with smoothing, or both."""
        measure, index = pathway.measure, upright(name)
        assert measure is not None  # the tables where this law may stand have pathways with a rate
        amount, unit, size_unit = measure.amount, measure.amount_unit, measure.size_unit
        _refuse_coefficient(data, amount)
        viscous = data.optional_quantity(
            "viscous", f"{unit}*s/{size_unit}", f"Viscous friction of {name}", f"c_{{{index}}}"
        )
        coulomb = data.optional_quantity(amount, unit, f"Coulomb friction of {name}", f"F_{{c,{index}}}")
        smoothing = None
        if coulomb is not None:
            words, example = f"Rate over which the Coulomb friction of {name} turns round", measure.example
            smoothing = data.quantity("smoothing", f"{size_unit}/s", words, rf"\epsilon_{{{index}}}", example=example)
        if viscous is None and coulomb is None:
            data.fault(
                "",
                f"neither viscous friction nor a {amount}",
                allowed=f"viscous, {amount} with smoothing, or both",
                remedy=f"add viscous, or {amount} and smoothing",
            )
        return cls(viscous=viscous, coulomb=coulomb, smoothing=smoothing)

    def amount(self, force: Force, action: Action, setting: Setting) -> sp.Expr:
        """The friction under a name of its own."""
        measure = force.pathway.measure
        assert action.rate is not None
        label, mark, ledger = force.label, subscript(force.name), setting.ledger
        where, unit = f"of {force.name}", measure.amount_unit
        rate = ledger.define(
            f"{label}.rate", action.rate, f"{measure.size_unit}/s", f"rate {where}", rf"\dot s_{{{mark}}}"
        )
        terms: list[sp.Expr] = [] if self.viscous is None else [symbol_of(self.viscous) * rate]
        if self.coulomb is not None and self.smoothing is not None:
            terms.append(symbol_of(self.coulomb) * sp.tanh(rate / symbol_of(self.smoothing)))
        words = f"friction {measure.amount} {where}, against the rate"
        amount = ledger.define(f"{label}.{measure.amount}", sp.Add(*terms), unit, words, f"F_{{{mark}}}")
        setting.outputs.append(Output(name=amount.name, expression=amount, unit=unit, description=words.capitalize()))
        return amount

    def words(self) -> str:
        """Viscous, Coulomb or both."""
        parts = [word for word, given in (("viscous", self.viscous), ("Coulomb", self.coulomb)) if given is not None]
        return f", {' and '.join(parts)}"

    def check(self, checker: Checker) -> None:
        """No friction drives; a width of zero is a jump."""
        checker.not_negative(self.viscous)
        checker.not_negative(self.coulomb)
        checker.positive(self.smoothing, "give a small rate: within it friction grows, beyond it the friction is whole")


def _refuse_coefficient(data: Table, amount: str) -> None:
    """Friction in proportion to a reaction: the reaction depends on that friction."""
    for key in ("coefficient", "pin_radius"):
        if key in data.data:
            data.fault(
                key,
                "friction does not follow the reaction of its joint: that reaction depends on the friction itself",
                given=show(data.data[key]),
                allowed=f"viscous, {amount} with smoothing, or both",
                remedy=f"give the {amount} that the mean reaction makes, coefficient x reaction"
                + (" x pin radius" if amount == "torque" else ""),
            )
            data.know(key)
