"""Pathway: the pressure on a piston, times the area of its bore, along a direction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import sympy as sp

from ballpass.derive.mechanism.forces.force import Law, Setting
from ballpass.derive.mechanism.forces.point_force import PointForce
from ballpass.derive.mechanism.vectors import Pair
from ballpass.derive.scene.mechanism_records import Force
from ballpass.derive.scene.quantity import SceneNumber, Vector
from ballpass.derive.scene.read_keys import not_negative, positive, quantity
from ballpass.derive.scene.table import upright
from ballpass.derive.terms import defined, symbol_of


@dataclass(frozen=True, slots=True, kw_only=True)
class PistonPressure(PointForce):
    """Force ``(pressure - ambient) pi bore^2 / 4`` along `direction`; the pressure [Pa] is None where the law gives it.

    Forces are derived constants with the names that forces [N] of a scene have: ``force.x``, ``table.force.1``.
    """

    key: ClassVar[str] = "bore"
    column: ClassVar[str] = "pressure"
    column_unit: ClassVar[str] = "Pa"

    bore: SceneNumber = positive(
        "m", "Bore of the cylinder of NAME", "D_{INDEX}", "52 mm", when="required for a pressure on a piston"
    )
    pressure: SceneNumber | None = quantity(
        "Pa",
        "Pressure NAME on the BODY",
        "p_{INDEX}",
        "7 bar",
        when="required with `bore` and without `table`",
        note="absolute",
    )
    ambient: SceneNumber = not_negative(
        "Pa",
        "Pressure on the other side of the BODY of NAME",
        r"p_{0,INDEX}",
        "1 bar",
        default="101325 Pa",
        note='absolute; `"0 bar"` where pressures are given above that of the atmosphere',
    )

    @classmethod
    def left_out(cls, law: type[Law]) -> dict[str, Any]:
        """The force, and the pressure where the law gives it."""
        return {"force": Vector(kind="zero")} | ({} if law.factor else {"pressure": None})

    def vector(self, force: Force, setting: Setting) -> Pair:
        """The force by a pressure of its own, or the direction alone."""
        along = PointForce.vector(self, force, setting)
        if self.pressure is None:
            return along
        path, letter, size = self.bore.path.rpartition(".")[0], upright(force.name), self._force(self.pressure)
        x, y = (
            defined(
                f"{path}.force.{axis}",
                size * part,
                "N",
                f"Force of {force.name} along {axis}",
                f"F_{{{letter},{axis}}}",
            )
            for axis, part in zip("xy", along, strict=True)
        )
        setting.constants.extend((x, y))
        return x.symbol, y.symbol

    def amounts(self, values: Sequence[SceneNumber], force: Force, setting: Setting) -> list[str]:
        """Forces of the rows of a table of pressures."""
        found = [
            defined(
                value.path.replace(".table.pressure.", ".table.force."),
                self._force(value),
                "N",
                f"Force in row {row} of the table of {force.name}",
                f"F_{{{upright(force.name)},{row}}}",
            )
            for row, value in enumerate(values, start=1)
        ]
        setting.constants.extend(found)
        return [one.symbol.name for one in found]

    def _force(self, pressure: SceneNumber) -> sp.Expr:
        return (symbol_of(pressure) - symbol_of(self.ambient)) * sp.pi * symbol_of(self.bore) ** 2 / 4

    def words(self) -> str:
        """Pressure and point."""
        return f"pressure on {self.body}.{self.point}"
