"""Law: a stop, a spring that pushes where a pathway's size is below a free one, and never pulls.

Its loss is that of Hunt and Crossley (J. Appl. Mech. 42 (1975) 440, doi:10.1115/1.3423596), in proportion to the force:
a viscous damper would jump at contact, and pull at its end.
"""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from ballpass.derive.mechanism.forces.force import Action, Law, Setting
from ballpass.derive.scene.mechanism_records import Force
from ballpass.derive.scene.quantity import SceneNumber
from ballpass.derive.scene.read_keys import not_negative, quantity
from ballpass.derive.terms import Smoothness, subscript, symbol_of
from ballpass.derive.variables import Input, Output, StateSwitch


@dataclass(frozen=True, slots=True, kw_only=True)
class Stop(Law):
    """``stiffness * compression * max(1 + hysteresis * rate, 0)`` where the compression is positive, else nothing.

    In [N/m], [m] and [s/m], between two bodies in [N*m/rad], [rad] and [s/rad].
    """

    stiffness: SceneNumber = not_negative(
        "AMOUNT_UNIT/SIZE_UNIT", "Stiffness of the stop NAME", "k_{INDEX}", "1e6 AMOUNT_UNIT/SIZE_UNIT"
    )
    free: SceneNumber = quantity(
        "SIZE_UNIT", "THE_SIZE of the stop NAME below which it pushes", "L_{0,INDEX}", "EXAMPLE", name="free_SIZE"
    )
    hysteresis: SceneNumber | None = not_negative(
        "s/SIZE_UNIT",
        "Hysteresis damping factor of the stop NAME",
        r"\alpha_{INDEX}",
        "0.1 s/SIZE_UNIT",
        optional=True,
        note="loss of an impact",
    )

    def amount(self, force: Force, action: Action, setting: Setting) -> sp.Expr:
        """Force of the stop as a tension: negative."""
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
        stored = sp.Piecewise((symbol_of(self.stiffness) * compression**2 / 2, compression > border.symbol), (0, True))
        words = f"Potential energy of the stop {name}"
        setting.requested.append(Output(name=f"{label}.energy", expression=stored, unit="J", description=words))
        if self.hysteresis is not None:
            elastic = sp.Piecewise((symbol_of(self.stiffness) * compression, compression > border.symbol), (0, True))
            taken, words = (amount - elastic) * rate, f"Power loss by the hysteresis of the stop {name}"
            setting.requested.append(Output(name=f"{label}.loss", expression=taken, unit="W", description=words))
        return -amount

    def words(self) -> str:
        """A stop."""
        return ", stop" if self.hysteresis is None else ", stop with hysteresis"
