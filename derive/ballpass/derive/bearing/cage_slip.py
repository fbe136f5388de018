"""A cage whose slip changes over time: its lag behind a cage that has the slip of the last row.

In: a bearing.  Out: the share of the rolling speed that the cage keeps in the end, and its lag: where rings turn evenly
a `Lag`, an angle that is linear between the rows, else a `LagState`, which the equations of motion integrate.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import sympy as sp

from ballpass.derive.scene.bearing_records import Bearing
from ballpass.derive.terms import TIME, Definition, Names, symbol_of
from ballpass.derive.variables import Coordinate, Input
from ballpass.runtime.contract.manifest import CAGE_EXCESS_SLIP, CAGE_LAG_RATE


@dataclass(frozen=True, slots=True, kw_only=True)
class Lag:
    """An angle by which the cage lags [rad], its rate [rad/s], and the inputs and constants in them."""

    angle: sp.Expr
    rate: sp.Symbol
    inputs: tuple[Input, ...]
    constants: tuple[Definition, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class LagState:
    """An angle by which the cage lags as a state, and what its rate is made of.

    Attributes
    ----------
    coordinate : its velocity is the lag
    excess : slip beyond that of the last row [1]
    constants : of this
    """

    coordinate: Coordinate
    excess: Input
    constants: tuple[Definition, ...]


def kept_share(bearing: Bearing) -> sp.Expr:
    """Part of the rolling speed with which the cage turns, in the end."""
    if bearing.cage is None or not bearing.cage.slipping:
        return sp.S.One
    return 1 - symbol_of(bearing.cage.slip or bearing.cage.slips[-1])


def lag_names(bearing: Bearing, names: Names) -> tuple[sp.Symbol, ...]:
    """Constants that hold the lag at each row; none where the slip does not change."""
    rows = () if bearing.cage is None else bearing.cage.time
    return tuple(names.constant(f"cage.lag.{k}") for k in range(1, len(rows) + 1))


def lag_of(bearing: Bearing, names: Names, rolling: sp.Expr) -> Lag | None:
    """How far the cage lags; None where its slip does not change.

    Parameters
    ----------
    rolling : speed of a cage that does not slip [rad/s]
    """
    if bearing.cage is None or bearing.cage.lag is None:
        return None
    constants = _at_rows(bearing, names, symbol_of(bearing.cage.lag), rolling, "rad")
    of = f" of {bearing.name}" if bearing.name else ""
    words = f"Angle by which the cage{of} lags at the reference time"
    faster = f"Rate at which the cage{of} lags"
    inputs = (
        _table(bearing, names, "table", "cage.lag", "rad", words, r"\lambda"),
        _table(bearing, names, "table_rate", CAGE_LAG_RATE, "rad/s", faster, r"\dot\lambda"),
    )
    value, rate = (one.symbol for one in inputs)
    return Lag(angle=value + rate * TIME, rate=rate, inputs=inputs, constants=constants)


def lag_state(bearing: Bearing, names: Names) -> LagState | None:
    """The lag as a state; None where the slip does not change."""
    if bearing.cage is None or not bearing.cage.time:
        return None
    of = f" of {bearing.name}" if bearing.name else ""
    words = f"Slip of the cage{of} beyond that of the last row"
    integral = names.variable("cage.lag_integral")
    return LagState(
        coordinate=Coordinate(
            name=integral.name,
            kind="lag",
            unit="rad*s",
            position=integral,
            velocity=names.variable("cage.lag"),
            latex=names.latex(r"\Lambda"),
            description=f"angle by which the cage{of} lags",
            group=f"{names.path}.cage",
        ),
        excess=_table(bearing, names, "table_rate", CAGE_EXCESS_SLIP, "1", words, r"\Delta s_c"),
        constants=_at_rows(bearing, names, sp.S.Zero, sp.S.One, "s"),
    )


def _at_rows(
    bearing: Bearing, names: Names, start: sp.Expr, rolling: sp.Expr, unit: Literal["rad", "s"]
) -> tuple[Definition, ...]:
    """Lag at each row, of a cage that would roll at a speed [rad/s]; over that speed where it is one."""
    assert bearing.cage is not None  # `lag_of`, `lag_state`
    cage, symbols = bearing.cage, lag_names(bearing, names)
    constants, before = list[Definition](), start
    what = "Angle by which the cage lags" if unit == "rad" else "Lag of the cage over its speed without slip,"
    for k, symbol in enumerate(symbols):
        if k:
            span = symbol_of(cage.time[k]) - symbol_of(cage.time[k - 1])
            before = symbols[k - 1] + rolling * (symbol_of(cage.slips[k - 1]) - symbol_of(cage.slips[-1])) * span
        constants.append(names.define(symbol, before, unit, f"{what} in row {k + 1}", rf"\lambda_{{{k + 1}}}"))
    return tuple(constants)


def _table(
    bearing: Bearing,
    names: Names,
    kind: Literal["table", "table_rate"],
    name: str,
    unit: str,
    words: str,
    latex: str,
) -> Input:
    """What follows from the lag at the rows: itself, or its rate."""
    assert bearing.cage is not None  # `lag_of`, `lag_state`
    return Input(
        name=f"{bearing.prefix}{name}",
        symbol=sp.Symbol(f"input.{bearing.prefix}{name}", real=True),
        kind=kind,
        unit=unit,
        description=words,
        latex=names.latex(latex),
        times=tuple(q.path for q in bearing.cage.time),
        values=tuple(symbol.name for symbol in lag_names(bearing, names)),
    )
