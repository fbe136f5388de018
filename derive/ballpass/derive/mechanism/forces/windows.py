"""Law: the force or torque of the pathway acts within windows of the driver's angle."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import sympy as sp

from ballpass.derive.drive import OverAngle
from ballpass.derive.mechanism.forces.force import Action, Law, Setting
from ballpass.derive.scene.checker import Checker
from ballpass.derive.scene.keys import Fill
from ballpass.derive.scene.mechanism_records import Driver, Force
from ballpass.derive.scene.quantity import SceneNumber, UsualRange
from ballpass.derive.scene.read_keys import positive, quantity, read_inner
from ballpass.derive.scene.table import Table, upright
from ballpass.derive.terms import defined
from ballpass.runtime.contract.manifest import UsualInfo

#: An angle of the driver.  Both edges of a window between zero and 2 pi degrees are probably meant in radians.
_ANGLE = UsualRange(least=-4.0 * math.pi, most=4.0 * math.pi, hint="Check whether degrees were given as radians.")
_RADIANS = math.radians(2.0 * math.pi)


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """Driver angles [rad] between which a load acts: from `start` on, up to and without `end`, modulo a turn.

    With a `rise` the load grows evenly over that angle behind the start, and falls over the same before the end.
    """

    start: SceneNumber = quantity(
        "rad", "Driver angle at the start of PLACE", r"\theta_{\mathrm{start},INDEX}", "237 deg", usual=_ANGLE
    )
    end: SceneNumber = quantity(
        "rad", "Driver angle at the end of PLACE", r"\theta_{\mathrm{end},INDEX}", "267 deg", usual=_ANGLE
    )
    rise: SceneNumber | None = positive(
        "rad",
        "Driver angle over which the load rises behind the start of PLACE, and falls before its end",
        r"\theta_{\mathrm{rise},INDEX}",
        "5 deg",
        optional=True,
        note="without it the load begins and ends at once; for a single window",
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
            return cls(windows=(read_inner(Window, data, "window", "start and end", fill),))
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
            place = {"PLACE": f"the window {number} of {fill['NAME']}", "INDEX": f"{fill['INDEX']},{number}"}
            windows.append(read_inner(Window, numbered, number, "start and end", place))
        return cls(windows=tuple(windows))

    def amount(self, force: Force, action: Action, setting: Setting) -> sp.Expr:
        """The gate; of a window with a rise a table over the angle, from 0 to 1 and back."""
        if self.windows[0].rise is not None:
            return setting.over_angle(self._flanks(force, setting))
        windows = [(window.start.path, window.end.path) for window in self.windows]
        return setting.over_angle(setting.linkage.drive.gate(force.name, windows))

    def _flanks(self, force: Force, setting: Setting) -> OverAngle:
        """0, 1, 1 and 0 at four angles of the driver."""
        window = self.windows[0]
        assert window.rise is not None  # there is a table
        start, end, rise = (sp.Symbol(q.path, real=True) for q in (window.start, window.end, window.rise))
        turn, path = 2 * sp.pi, window.start.path.rpartition(".")[0]
        width = end - start - turn * sp.floor((end - start) / turn, evaluate=False)
        name, letter = f"gate.{force.name}", upright(force.name)

        words = f"Driver angle at which {force.name}"
        knots = (
            defined(f"{path}.risen", start + rise, "rad", f"{words} has risen", rf"\theta_{{2,{letter}}}"),
            defined(f"{path}.falls", start + width - rise, "rad", f"{words} begins to fall", rf"\theta_{{3,{letter}}}"),
            defined(f"{path}.fallen", start + width, "rad", f"{words} has fallen", rf"\theta_{{4,{letter}}}"),
        )
        heights = (
            defined(f"{path}.none", sp.S.Zero, "1", f"Share of {force.name} outside its window", rf"g_{{0,{letter}}}"),
            defined(f"{path}.full", sp.S.One, "1", f"Share of {force.name} inside its window", rf"g_{{1,{letter}}}"),
        )
        none, full = (one.symbol.name for one in heights)
        angles = [window.start.path, *(one.symbol.name for one in knots)]
        found = setting.linkage.drive.table(name, "1", angles, [none, full, full, none])
        return replace(found, constants=(*knots, *heights, *found.constants))

    def words(self) -> str:
        """Number of windows."""
        count = len(self.windows)
        return f", within {count} window{'s' if count > 1 else ''} of the driver's angle"

    def check(self, checker: Checker) -> None:
        """Start and end differ, by less than a turn, and there is room for a rise and a fall."""
        for window in self.windows:
            checker.window(window.start, window.end)
            if window.rise is None:
                continue
            width = (window.end.value - window.start.value) % math.tau
            if len(self.windows) > 1:
                checker.fault(
                    window.rise.path,
                    "a rise of one window among several",
                    f"{len(self.windows)} windows",
                    "one window where the load rises",
                    "give each window a force of its own, or leave out the rise",
                )
            elif 2.0 * window.rise.value >= width * (1.0 - 1e-12):
                checker.fault(
                    window.rise.path,
                    "the load cannot rise and fall within its window",
                    f"a rise of {checker.show(window.rise)}, a window of {math.degrees(width):.6g} deg",
                    f"a rise below {math.degrees(0.5 * width):.6g} deg, half of the window",
                    "give a smaller rise, or a wider window",
                )

    def usual(self, driver: Driver) -> Iterable[UsualInfo]:
        """Not both edges of a window between zero and 2 pi degrees."""
        hint = "Check whether radians were given as degrees."
        for window in self.windows:
            yield UsualInfo(names=(window.start.path, window.end.path), least=_RADIANS, each=True, hint=hint)
