"""Law: an amount from a table over the driver's angle, linear between knots and periodic over one turn or more."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Self

import sympy as sp

from ballpass.derive.mechanism.forces.force import Action, Law, Setting
from ballpass.derive.scene.checker import Checker
from ballpass.derive.scene.keys import Fill, WholeKey
from ballpass.derive.scene.mechanism_records import Force
from ballpass.derive.scene.quantity import SceneNumber
from ballpass.derive.scene.read_keys import column, read_inner
from ballpass.derive.scene.table import Table

#: A cycle of more turns is no machine's.
MOST_TURNS = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class AngleTable(Law):
    """Knots `angle` [rad], increasing within `turns`, and `amount` [N] or [N*m]; the last knot joins the first."""

    key: ClassVar[str] = "table"

    angle: tuple[SceneNumber, ...] = column(
        "rad", "Driver angle in row ROW of the table of NAME", r"\theta_{INDEX,ROW}"
    )
    values: tuple[SceneNumber, ...] = column(
        "COLUMN_UNIT", "THE_COLUMN in row ROW of the table of NAME", "T_{INDEX,ROW}", name="COLUMN"
    )
    turns: int = WholeKey(
        words="Turns of the driver after which the table of NAME repeats",
        lowest=1,
        highest=MOST_TURNS,
        default=1,
        example=2,
        note="2 for a four-stroke engine: angles up to 720 deg",
    ).declared()

    @classmethod
    def inner(cls) -> type[Any]:
        """Its columns."""
        return cls

    @classmethod
    def read(cls, data: Table, fill: Fill) -> Self:
        """Columns angle and force (or torque)."""
        return read_inner(cls, data, "table", f"angle and {fill['COLUMN']}", fill)

    def amount(self, force: Force, action: Action, setting: Setting) -> sp.Expr:
        """The table's value."""
        knots, values = [q.path for q in self.angle], force.pathway.amounts(self.values, force, setting)
        drive, unit = setting.linkage.drive, force.pathway.unit
        return setting.over_angle(drive.table(force.label, unit, knots, values, self.turns))

    def words(self) -> str:
        """Number of rows."""
        return f", by a table of {len(self.angle)} driver angles"

    def check(self, checker: Checker) -> None:
        """Columns of one length, of two rows or more; angles increase within a turn."""
        if self.angle:
            remedy = "give every row an angle and a value, or delete the table for a load that does not change"
            checker.rows(self.angle[0].path.rpartition(".")[0], {"angle": self.angle, "value": self.values}, remedy)
            checker.within_a_turn(self.angle, self.turns)
