"""What a model's numbers and signals are: parameters, inputs, states, outputs, each with its symbol, unit and words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import sympy as sp

#: Angle of the body that the drive turns [rad].
DRIVER_ANGLE = sp.Symbol("driver.angle", real=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """A run-time number: its scene path, SI unit, description, default [unit] and symbol."""

    name: str
    symbol: sp.Symbol
    unit: str
    description: str
    latex: str
    default: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Input:
    """Held constant between breakpoints by whoever integrates; `kind` and fields as in `manifest.InputInfo`."""

    name: str
    symbol: sp.Symbol
    kind: Literal["phase", "gate", "table", "table_rate"]
    unit: str
    description: str
    latex: str
    offset: str = ""
    rate: str = ""
    windows: tuple[tuple[str, str], ...] = ()
    times: tuple[str, ...] = ()
    values: tuple[str, ...] = ()


def phase(name: str, description: str, latex: str, *, offset: str, rate: str) -> Input:
    """An angle that turns at a constant rate: `offset` names it at t = 0 [rad], `rate` its speed [rad/s]."""
    return Input(
        name=f"phase.{name}",
        symbol=sp.Symbol(f"phase.{name}", real=True),
        kind="phase",
        unit="rad",
        description=description,
        latex=latex,
        offset=offset,
        rate=rate,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """A state variable: a position [m] or a velocity [m/s]."""

    name: str
    symbol: sp.Symbol
    unit: str
    description: str
    latex: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """Something a run can report; `per_ball` outputs have one value per ball and use the generic ball's symbols."""

    name: str
    expression: sp.Expr
    unit: str
    description: str
    per_ball: bool = False
