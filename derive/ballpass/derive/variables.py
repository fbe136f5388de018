"""Records of parameters, inputs, states and outputs, each with its symbol, unit and description."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import sympy as sp

from ballpass.derive.terms import Definition, Smoothness
from ballpass.runtime.contract.manifest import TurningInfo

#: Angle of the body that the drive turns [rad].
DRIVER_ANGLE = sp.Symbol("driver.angle", real=True)

#: Name, expression, unit and description of an output.
Words = tuple[str, sp.Expr, str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Input:
    """Held constant between breakpoints by the integrator; `kind` and fields as in `manifest.InputInfo`."""

    name: str
    kind: Literal["phase", "angle", "rate", "slope", "gate", "table", "table_rate", "border"]
    unit: str
    description: str
    latex: str
    turning: TurningInfo | None = None
    turns: int = 1
    parts: int = 1
    windows: tuple[tuple[str, str], ...] = ()
    times: tuple[str, ...] = ()
    values: tuple[str, ...] = ()

    @property
    def symbol(self) -> sp.Symbol:
        """Symbol; that of a table is marked, since an output may have its name."""
        marked = self.kind in ("slope", "table", "table_rate")
        return sp.Symbol(f"input.{self.name}" if marked else self.name, real=True)


def turned(
    turning: TurningInfo, description: str, latex: str, kind: Literal["phase", "angle", "rate"] = "phase"
) -> Input:
    """A turning at the reference time: its angle within a turn or with whole ones [rad], or its rate [rad/s]."""
    name, unit = f"{kind}.{turning.name}", "rad/s" if kind == "rate" else "rad"
    return Input(name=name, kind=kind, unit=unit, description=description, latex=latex, turning=turning)


def gate_of(
    name: str, description: str, latex: str, turning: TurningInfo, windows: tuple[tuple[str, str], ...], parts: int = 1
) -> Input:
    """1 while a turning, modulo a turn over `parts`, lies in one of some windows, else 0."""
    return Input(
        name=name,
        kind="gate",
        unit="1",
        description=description,
        latex=latex,
        turning=turning,
        windows=windows,
        parts=parts,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class StateSwitch:
    """A place of the motion at which a load switches: the load acts where `function` is above `border`.

    `function` is zero there, and `rate` its time derivative; the input `border` is zero, or infinite while a step holds
    the side on which it started.  That of a window of an `angle` names the edges, [rad]; others are sizes, in
    [m] or [rad], without one.  `turning` is the rate of the angle [rad/s].
    """

    border: Input
    function: sp.Expr
    rate: sp.Expr
    changes: str
    angle: sp.Expr | None = None
    turning: sp.Expr = sp.S.Zero


@dataclass(frozen=True, slots=True, kw_only=True)
class Terms:
    """What something is made of.

    Attributes
    ----------
    constants, inputs, definitions : of its symbols; constants are derived from parameters
    smoothness : by name, of functions of the state that have jumps or kinks
    switches : places of the motion where they jump
    """

    constants: tuple[Definition, ...] = ()
    inputs: tuple[Input, ...] = ()
    definitions: tuple[Definition, ...] = ()
    smoothness: tuple[tuple[str, Smoothness], ...] = ()
    switches: tuple[StateSwitch, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Coordinate:
    """A generalized coordinate and its velocity.

    Attributes
    ----------
    name : of the position
    kind : what is measured; the lag of a cage is the velocity of its own integral over time, on which nothing depends
    unit : of the position
    position, velocity : symbols
    group : coordinates of one group share a magnitude, which tolerances are relative to
    partner : coordinate of the other end of the contact, "" where that end is fixed: the difference of both matters
    """

    name: str
    kind: Literal["displacement", "angle", "lag"]
    unit: str
    position: sp.Symbol
    velocity: sp.Symbol
    latex: str
    description: str
    group: str
    partner: str = ""

    @property
    def velocity_unit(self) -> str:
        """Unit of the velocity."""
        return "rad" if self.kind == "lag" else f"{self.unit}/s"

    @property
    def words(self) -> tuple[str, str]:
        """Of position and velocity, for people."""
        if self.kind == "lag":
            return f"Integral over time of the {self.description}", f"A{self.description[1:]}"
        return f"Position {self.description}", f"Velocity {self.description}"

    @property
    def acceleration(self) -> sp.Symbol:
        """Symbol of the second time derivative."""
        return sp.Symbol(f"acceleration.{self.name}", real=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable:
    """A number with a symbol; as a state, a position [m] or a velocity [m/s]."""

    name: str
    symbol: sp.Symbol
    unit: str
    description: str
    latex: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter(Variable):
    """A run-time number: its scene path, symbol, SI unit, description and default [unit]."""

    default: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """Something a run can report.

    `per_ball` outputs have one value for each ball of the bearing with the prefix `balls_of` and use the symbols of its
    generic ball; with `over_balls` the output is the sum of these.  `parts` are further outputs that are added to
    the expression.  `constants` are derived constants that only this output needs.
    """

    name: str
    expression: sp.Expr
    unit: str
    description: str
    per_ball: bool = False
    balls_of: str = ""
    over_balls: bool = False
    parts: tuple[Output, ...] = ()
    constants: tuple[Definition, ...] = ()
