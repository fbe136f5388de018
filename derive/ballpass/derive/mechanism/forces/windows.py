"""Law: the force or torque of the pathway acts within windows of the driver's angle."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import sympy as sp

from ballpass.derive.mechanism.forces.force import Action, Law, Setting
from ballpass.derive.scene.checker import Checker
from ballpass.derive.scene.keys import Fill
from ballpass.derive.scene.quantity import SceneNumber, UsualRange
from ballpass.derive.scene.read_keys import quantity, read_record
from ballpass.derive.scene.records import Driver, Force
from ballpass.derive.scene.table import Table
from ballpass.runtime.contract.manifest import UsualInfo

#: An angle of the driver.  Both edges of a window between zero and 2 pi degrees are probably meant in radians.
_ANGLE = UsualRange(least=-4.0 * math.pi, most=4.0 * math.pi, hint="Check whether degrees were given as radians.")
_RADIANS = math.radians(2.0 * math.pi)


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """Driver angles [rad] between which a load acts: from `start` on, up to and without `end`, modulo a turn."""

    start: SceneNumber = quantity(
        "rad", "Driver angle at the start of PLACE", r"\theta_{\mathrm{start},INDEX}", "237 deg", usual=_ANGLE
    )
    end: SceneNumber = quantity(
        "rad", "Driver angle at the end of PLACE", r"\theta_{\mathrm{end},INDEX}", "267 deg", usual=_ANGLE
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Windows(Law):
    """1 while the driver's angle lies in any of the windows, else 0: a gate that the integrator switches."""

    key: ClassVar[str] = "window"
    factor: ClassVar[bool] = True

    windows: tuple[Window, ...]

    @classmethod
    def inner(cls) -> type[Any]:
        """A window."""
        return Window

    @classmethod
    def read(cls, data: Table, fill: Fill) -> Self:
        """A table with start and end, or a list of them."""
        given = data.data["window"]
        if not isinstance(given, list):
            with data.table("window", "start and end") as table:
                return cls(windows=(read_record(Window, table, fill),))
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
        windows = []
        for number in numbered.data:
            with numbered.table(number, "start and end") as table:
                place = {"PLACE": f"the window {number} of {fill['NAME']}", "INDEX": f"{fill['INDEX']},{number}"}
                windows.append(read_record(Window, table, place))
        return cls(windows=tuple(windows))

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

    def usual(self, driver: Driver) -> Iterable[UsualInfo]:
        """Not both edges of a window between zero and 2 pi degrees."""
        hint = "Check whether radians were given as degrees."
        for window in self.windows:
            yield UsualInfo(names=(window.start.path, window.end.path), least=_RADIANS, each=True, hint=hint)
