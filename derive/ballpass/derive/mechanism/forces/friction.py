"""Law: friction against a rate, in proportion to it (viscous), of a given amount (Coulomb), or both."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar, Self

import sympy as sp

from ballpass.derive.mechanism.forces.force import Action, Law, Setting
from ballpass.derive.scene.keys import Fill, Needs
from ballpass.derive.scene.mechanism_records import Driver, Force
from ballpass.derive.scene.quantity import SceneNumber
from ballpass.derive.scene.read_keys import Either, keys_of, not_negative, positive, read_record
from ballpass.derive.scene.table import Table
from ballpass.derive.terms import subscript, symbol_of
from ballpass.derive.variables import Output
from ballpass.runtime.contract.manifest import UsualInfo


@dataclass(frozen=True, slots=True, kw_only=True)
class Friction(Law):
    """``viscous * rate + coulomb * tanh(rate / smoothing)``; terms that the scene does not name are zero.

    At a revolute joint in [N*m*s/rad], [N*m] and [rad/s], at a guide in [N*s/m], [N] and [m/s].
    """

    one_of: ClassVar[tuple[Either, ...]] = (Either(groups=(("viscous",), ("AMOUNT",)), several=True),)

    viscous: SceneNumber | None = not_negative(
        "AMOUNT_UNIT*s/SIZE_UNIT", "Viscous friction of NAME", "c_{INDEX}", "0.1 AMOUNT_UNIT*s/SIZE_UNIT"
    )
    coulomb: SceneNumber | None = not_negative(
        "AMOUNT_UNIT", "Coulomb friction of NAME", "F_{c,INDEX}", "2 AMOUNT_UNIT", name="AMOUNT"
    )
    smoothing: SceneNumber | None = positive(
        "SIZE_UNIT/s",
        "Rate over which the Coulomb friction of NAME turns round",
        r"\epsilon_{INDEX}",
        "EXAMPLE",
        needs=(Needs(key="AMOUNT", why="only Coulomb friction turns round"),),
        remedy="give a small rate: below it friction grows, above it friction is full",
    )

    @classmethod
    def read(cls, data: Table, fill: Fill) -> Self:
        """Viscous, or torque (force) with smoothing, or both."""
        data.correct(keys_of(cls, fill))
        data.missing = data.missing or _refuse_coefficient(data, fill["AMOUNT"])
        return read_record(cls, data, fill)

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

    def usual(self, driver: Driver) -> Iterable[UsualInfo]:
        """The smoothing rate is far below a constant speed of the drive; above that friction is mostly viscous."""
        if self.smoothing is not None and driver.torque is None and self.smoothing.unit == driver.speed.unit:
            hint = "Coulomb friction is full only at rates well above it: give a smaller one."
            yield UsualInfo(names=(self.smoothing.path,), least=None, most=0.1, of=driver.speed.path, hint=hint)


def _refuse_coefficient(data: Table, amount: str) -> bool:
    """Friction in proportion to a reaction: the reaction depends on that friction; whether it is refused."""
    given = [key for key in ("coefficient", "pin_radius") if key in data.data]
    data.refuse(
        given,
        "friction does not follow the reaction of its joint: that reaction depends on the friction itself",
        allowed=f"viscous, {amount} with smoothing, or both",
        remedy=f"give the {amount} that the mean reaction makes, coefficient x reaction"
        + (" x pin radius" if amount == "torque" else ""),
    )
    return bool(given)
