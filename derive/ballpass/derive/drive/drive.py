"""What the rest of the derivation knows of a drive: the driver's angle, speed and acceleration, and its own symbols.

Nobody else multiplies a speed by time.  A drive whose angle is a coordinate gives that coordinate as `angle` and names
for it no input; what switches with the angle then has to be an event of the state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

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
