"""What the rest of the derivation knows of a drive: the driver's angle, speed and acceleration, and its own symbols.

Nobody else multiplies a speed by time.  A drive whose angle is a coordinate gives that coordinate as `angle` and names
for it no input; what switches with the angle then has to be an event of the state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import sympy as sp

from ballpass.derive.terms import Definition
from ballpass.derive.variables import Input


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """The driver's motion, as the equations show it.

    Attributes
    ----------
    angle : of the driven body's x axis from +x [rad]
    speed, acceleration : of the same [rad/s], [rad/s^2]
    description : of the acceleration, for people
    definitions : of the symbols in these, ordered
    phase : the input that holds the angle at the reference time [rad]
    advance : of the angle since the reference time [rad]
    """

    angle: sp.Expr
    speed: sp.Expr
    acceleration: sp.Expr
    description: str
    definitions: tuple[Definition, ...]
    phase: Input
    advance: sp.Expr

    def table(self, name: str, unit: str, angles: Sequence[str], values: Sequence[str]) -> tuple[Input, Input]:
        """Value at the reference time, and slope over the angle [unit/rad], of a table over a turn of the angle.

        The table is linear between its knots and periodic.

        Parameters
        ----------
        angles, values : names of parameters, in [rad] and `unit`
        """

        def entry(kind: Literal["table", "table_rate"], ending: str, unit: str, words: str, latex: str) -> Input:
            return Input(
                name=f"{name}{ending}",
                symbol=sp.Symbol(f"input.{name}{ending}", real=True),
                kind=kind,
                unit=unit,
                description=f"{words} of the table of {name} at the reference time",
                latex=rf"{latex}_{{0,\mathrm{{{name}}}}}",
                offset=self.phase.offset,
                rate=self.phase.rate,
                times=tuple(angles),
                values=tuple(values),
            )

        value = entry("table", "", unit, "Value", "T")
        return value, entry("table_rate", "_slope", f"{unit}/rad", "Slope over the driver's angle", "T'")

    def gate(self, name: str, windows: Sequence[tuple[str, str]]) -> Input:
        """Input that is 1 while the angle lies in one of some windows, pairs of parameter names [rad], else 0."""
        return Input(
            name=f"gate.{name}",
            symbol=sp.Symbol(f"gate.{name}", real=True),
            kind="gate",
            unit="1",
            description=f"1 while {name} acts, else 0",
            latex=rf"g_{{\mathrm{{{name}}}}}",
            offset=self.phase.offset,
            rate=self.phase.rate,
            windows=tuple(windows),
        )
