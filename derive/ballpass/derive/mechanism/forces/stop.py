"""Law: a stop, a spring that pushes where a pathway's size is below a free one, and never pulls.

Its loss is that of Hunt and Crossley (J. Appl. Mech. 42 (1975) 440, doi:10.1115/1.3423596), in proportion to the force:
a viscous damper would jump at contact, and pull at its end.
"""

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
from ballpass.derive.terms import Smoothness, symbol_of
from ballpass.derive.variables import Input, Output, StateSwitch


@dataclass(frozen=True, slots=True, kw_only=True)
class Stop(Law):
    """``stiffness * compression * max(1 + hysteresis * rate, 0)`` where the compression is positive, else nothing.

    In [N/m], [m] and [s/m], between two bodies in [N*m/rad], [rad] and [s/rad].
    """

    stiffness: Quantity
    free: Quantity
    hysteresis: Quantity | None

    @classmethod
    def read(cls, data: Table, name: str, pathway: type[Pathway]) -> Self:
        """Stiffness, free size, and optionally hysteresis."""
        measure, index = pathway.measure, upright(name)
        assert measure is not None  # the tables where this law may stand have pathways with a size
        unit, size, size_unit = measure.amount_unit, measure.size, measure.size_unit
        example = f"1e6 {unit}/{size_unit}"
        return cls(
            stiffness=data.quantity(
                "stiffness", f"{unit}/{size_unit}", f"Stiffness of the stop {name}", f"k_{{{index}}}", example=example
            ),
            free=data.quantity(
                f"free_{size}",
                size_unit,
                f"{size.capitalize()} of the stop {name} below which it pushes",
                f"L_{{0,{index}}}",
                example=measure.example,
            ),
            hysteresis=data.optional_quantity(
                "hysteresis", f"s/{size_unit}", f"Hysteresis damping factor of the stop {name}", rf"\alpha_{{{index}}}"
            ),
        )

    def amount(self, force: Force, action: Action, setting: Setting) -> sp.Expr:
        """What the stop pushes, as a tension: negative."""
        measure, label, mark = force.pathway.measure, force.label, subscript(force.name)
        assert action.excess is not None
        assert action.rate is not None
        ledger, unit, name = setting.ledger, measure.size_unit, force.name
        compression = ledger.define(
            f"{label}.compression",
            -action.excess(symbol_of(self.free)),
            unit,
            f"compression of the stop {name}, negative while it is clear",
            rf"\delta_{{{mark}}}",
        )
        rate = ledger.define(
            f"{label}.rate",
            -action.rate,
            f"{unit}/s",
            f"rate of the compression of the stop {name}",
            rf"\dot\delta_{{{mark}}}",
        )
        border = Input(
            name=f"border.{label}",
            symbol=sp.Symbol(f"border.{label}", real=True),
            kind="border",
            unit=unit,
            description=f"Border of the compression of the stop {name}",
            latex=f"b_{{{mark}}}",
        )
        push = symbol_of(self.stiffness) * compression
        if self.hysteresis is not None:
            push *= sp.Max(1 + symbol_of(self.hysteresis) * rate, 0, evaluate=False)
        kind = "torque" if measure.amount_unit == "N*m" else "force"
        amount = ledger.define(
            f"{label}.{kind}",
            sp.Piecewise((push, compression > border.symbol), (0, True)),
            measure.amount_unit,
            f"{kind} of the stop {name}",
            f"F_{{{mark}}}",
        )
        setting.inputs.append(border)
        setting.smoothness.append((amount.name, Smoothness.KINKED))
        setting.switches.append(
            StateSwitch(border=border, function=compression, rate=rate, changes=f"the slope of `{amount.name}`")
        )
        for symbol, size, words in (
            (compression, unit, f"Compression of the stop {name}, negative while it is clear"),
            (amount, measure.amount_unit, f"{kind.capitalize()} of the stop {name}, zero or above"),
        ):
            setting.outputs.append(Output(name=symbol.name, expression=symbol, unit=size, description=words))
        return -amount

    def words(self) -> str:
        """A stop."""
        return ", stop" if self.hysteresis is None else ", stop with hysteresis"

    def check(self, checker: Checker) -> None:
        """It pushes, and takes energy out."""
        checker.not_negative(self.stiffness)
        checker.not_negative(self.hysteresis)
