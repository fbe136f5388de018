"""Law: what the pathway names acts within windows of the driver's angle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Self

import sympy as sp

from ballpass.derive.mechanism.forces.force import Action, Law, Pathway, Setting
from ballpass.derive.scene.checker import Checker
from ballpass.derive.scene.quantity import Quantity
from ballpass.derive.scene.records import Force
from ballpass.derive.scene.schema import Table, upright


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """Driver angles [rad] between which a load acts: from `start` on, up to and without `end`, modulo a turn."""

    start: Quantity
    end: Quantity


@dataclass(frozen=True, slots=True, kw_only=True)
class Windows(Law):
    """1 while the driver's angle lies in any of the windows, else 0: a gate that the integrator switches."""

    key: ClassVar[str] = "window"
    factor: ClassVar[bool] = True

    windows: tuple[Window, ...]

    @classmethod
    def read(cls, data: Table, name: str, pathway: type[Pathway]) -> Self:
        """A table with start and end, or a list of them."""
        given: Any = data.data["window"]
        if not isinstance(given, list):
            return cls(windows=(_read_window(data.table("window", "start and end"), name, ""),))
        if not given:
            data.fault(
                "window",
                "there is no window in this list",
                given="[]",
                allowed='{ start = "237 deg", end = "267 deg" }, or a list of such tables',
                remedy="add a window, or delete the key for a load that always acts",
            )
        numbered = Table(
            data.collector, (*data.path, "window"), {str(number): item for number, item in enumerate(given, start=1)}
        )
        tables = ((number, numbered.table(number, "start and end")) for number in numbered.data)
        return cls(windows=tuple(_read_window(table, name, f",{number}") for number, table in tables))

    def amount(self, force: Force, action: Action, setting: Setting) -> sp.Expr:
        """The gate."""
        return setting.over_angle(setting.drive.gate(force.name, [(w.start.path, w.end.path) for w in self.windows]))

    def words(self) -> str:
        """Number of windows."""
        count = len(self.windows)
        return f", within {count} window{'s' if count > 1 else ''} of the driver's angle"

    def check(self, checker: Checker) -> None:
        """Start and end differ, by less than a turn."""
        for window in self.windows:
            checker.window(window.start, window.end)


def _read_window(table: Table, name: str, number: str) -> Window:
    place = f"the window {number[1:]} of {name}" if number else f"the window of {name}"
    index = f"{upright(name)}{number}"
    with table as window:
        start, end = (
            window.quantity(
                edge,
                "rad",
                f"Driver angle at the {edge} of {place}",
                rf"\theta_{{\mathrm{{{edge}}},{index}}}",
                example=example,
            )
            for edge, example in (("start", "237 deg"), ("end", "267 deg"))
        )
        return Window(start=start, end=end)
