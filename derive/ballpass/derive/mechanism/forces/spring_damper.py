"""Law: a linear spring, a viscous damper, or both, along a pathway that has a size."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import sympy as sp

from ballpass.derive.mechanism.forces.force import Action, Law, Setting
from ballpass.derive.scene.keys import Needs
from ballpass.derive.scene.mechanism_records import Force
from ballpass.derive.scene.quantity import SceneNumber
from ballpass.derive.scene.read_keys import Either, not_negative, quantity
from ballpass.derive.terms import subscript, symbol_of
from ballpass.derive.variables import Output

_STIFF = (Needs(key="stiffness", why="it belongs to a stiffness"),)


@dataclass(frozen=True, slots=True, kw_only=True)
class SpringDamper(Law):
    """``preload + stiffness * x + cubic_stiffness * x**3 + damping * rate``, with x = size - free size.

    Terms that the scene does not name are zero.  Along a line in [N], [N/m], [N/m^3], [N*s/m] and [m]; between two
    bodies in [N*m], [N*m/rad], [N*m/rad^3], [N*m*s/rad] and [rad].
    """

    one_of: ClassVar[tuple[Either, ...]] = (Either(groups=(("stiffness",), ("damping",)), several=True),)

    stiffness: SceneNumber | None = not_negative(
        "AMOUNT_UNIT/SIZE_UNIT", "Stiffness of NAME", "k_{INDEX}", "1e4 AMOUNT_UNIT/SIZE_UNIT"
    )
    free: SceneNumber | None = quantity(
        "SIZE_UNIT", "THE_SIZE of NAME without force", "L_{0,INDEX}", "EXAMPLE", name="free_SIZE", needs=_STIFF
    )
    cubic_stiffness: SceneNumber | None = quantity(
        "AMOUNT_UNIT/SIZE_UNIT^3",
        "Cubic stiffness of NAME",
        "k_{3,INDEX}",
        "1e6 AMOUNT_UNIT/SIZE_UNIT^3",
        optional=True,
        needs=_STIFF,
        note="times the third power of what is beyond the free size; a negative one softens",
    )
    damping: SceneNumber | None = not_negative(
        "AMOUNT_UNIT*s/SIZE_UNIT", "Damping of NAME", "c_{INDEX}", "10 AMOUNT_UNIT*s/SIZE_UNIT"
    )
    preload: SceneNumber | None = quantity(
        "AMOUNT_UNIT", "THE_AMOUNT of NAME at its free SIZE", "F_{0,INDEX}", "5 AMOUNT_UNIT", optional=True
    )

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
            if self.cubic_stiffness is not None:
                terms.append(symbol_of(self.cubic_stiffness) * excess**3)
            words = f"Potential energy of {force.name}, 0 at its free {size}"
            stored = sp.integrate(sp.Add(*terms), excess)
            setting.requested.append(Output(name=f"{label}.energy", expression=stored, unit="J", description=words))
        if self.damping is not None:
            rate = ledger.define(
                f"{label}.rate",
                action.rate,
                f"{measure.size_unit}/s",
                f"rate of the {size} of {force.name}",
                rf"\dot\Delta_{{{mark}}}",
            )
            terms.append(symbol_of(self.damping) * rate)
            taken, words = symbol_of(self.damping) * rate**2, f"Power loss of the damper of {force.name}"
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
