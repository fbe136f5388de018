"""Law: a linear spring, a viscous damper, or both, along a pathway that has a size."""

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
from ballpass.derive.terms import symbol_of
from ballpass.derive.variables import Output


@dataclass(frozen=True, slots=True, kw_only=True)
class SpringDamper(Law):
    """``preload + stiffness * (size - free size) + damping * rate``; what the scene does not name has no term.

    Along a line in [N], [N/m], [N*s/m] and [m]; between two bodies in [N*m], [N*m/rad], [N*m*s/rad] and [rad].
    """

    stiffness: Quantity | None
    free: Quantity | None
    damping: Quantity | None
    preload: Quantity | None

    @classmethod
    def read(cls, data: Table, name: str, pathway: type[Pathway]) -> Self:
        """Stiffness with free length or angle, damping, or both; optionally a preload."""
        measure, index = pathway.measure, upright(name)
        assert measure is not None  # the tables where this law may stand have pathways with a size
        unit, size_unit, free = measure.amount_unit, measure.size_unit, f"free_{measure.size}"
        stiffness = data.optional_quantity("stiffness", f"{unit}/{size_unit}", f"Stiffness of {name}", f"k_{{{index}}}")
        free_size = None
        if stiffness is not None:
            words, example = f"{measure.size.capitalize()} of {name} without force", measure.example
            free_size = data.quantity(free, size_unit, words, f"L_{{0,{index}}}", example=example)
        damping = data.optional_quantity("damping", f"{unit}*s/{size_unit}", f"Damping of {name}", f"c_{{{index}}}")
        if stiffness is None and damping is None:
            data.fault(
                "",
                "neither stiffness nor damping",
                allowed=f"stiffness with {free}, damping, or both",
                remedy=f"add stiffness and {free}, or damping",
            )
        words = f"{measure.amount.capitalize()} of {name} at its free {measure.size}"
        preload = data.optional_quantity("preload", unit, words, f"F_{{0,{index}}}")
        return cls(stiffness=stiffness, free=free_size, damping=damping, preload=preload)

    def amount(self, force: Force, action: Action, setting: Setting) -> sp.Expr:
        """The tension or torque under a name of its own."""
        measure = force.pathway.measure
        assert action.excess is not None
        assert action.rate is not None
        label, mark, size, ledger = force.label, subscript(force.name), measure.size, setting.ledger
        terms: list[sp.Expr] = [] if self.preload is None else [symbol_of(self.preload)]
        if self.stiffness is not None and self.free is not None:
            excess = ledger.define(
                f"{label}.excess",
                action.excess(symbol_of(self.free)),
                measure.size_unit,
                f"{size} of {force.name} beyond its free {size}",
                rf"\Delta_{{{mark}}}",
            )
            terms.append(symbol_of(self.stiffness) * excess)
        if self.damping is not None:
            rate = ledger.define(
                f"{label}.rate",
                action.rate,
                f"{measure.size_unit}/s",
                f"rate of the {size} of {force.name}",
                rf"\dot\Delta_{{{mark}}}",
            )
            terms.append(symbol_of(self.damping) * rate)
            taken, words = symbol_of(self.damping) * rate**2, f"What the damper of {force.name} takes"
            setting.requested.append(Output(name=f"{label}.loss", expression=taken, unit="W", description=words))
        words = f"{measure.amount} of {force.name}, spring and damper"
        amount = ledger.define(f"{label}.{measure.amount}", sp.Add(*terms), measure.amount_unit, words, f"F_{{{mark}}}")
        output = Output(name=amount.name, expression=amount, unit=measure.amount_unit, description=words.capitalize())
        setting.outputs.append(output)
        return amount

    def words(self) -> str:
        """Spring, damper or both."""
        parts = [word for word, given in (("spring", self.stiffness), ("damper", self.damping)) if given is not None]
        return f", {' and '.join(parts)}"

    def check(self, checker: Checker) -> None:
        """Stiffness and damping are not negative."""
        checker.not_negative(self.stiffness)
        checker.not_negative(self.damping)
