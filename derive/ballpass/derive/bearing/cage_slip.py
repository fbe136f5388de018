"""A cage whose slip changes over time: its lag behind a cage that has the slip of the last row.

In: a bearing.  Out: the share of the rolling speed that the cage keeps in the end, and its `Lag` before, an angle that
is linear between the rows.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import sympy as sp

from ballpass.derive.scene.bearing_records import Bearing
from ballpass.derive.terms import TIME, Definition, Names, symbol_of
from ballpass.derive.variables import Input


@dataclass(frozen=True, slots=True, kw_only=True)
class Lag:
    """An angle by which the cage lags [rad], its rate [rad/s], and the inputs and constants in them."""

    angle: sp.Expr
    rate: sp.Symbol
    inputs: tuple[Input, ...]
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
    cage, symbols = bearing.cage, lag_names(bearing, names)
    if cage is None or not symbols:
        return None
    last, constants, before = symbol_of(cage.slips[-1]), list[Definition](), sp.S.Zero
    for k, symbol in enumerate(symbols):
        if k:
            span = symbol_of(cage.time[k]) - symbol_of(cage.time[k - 1])
            before = symbols[k - 1] + rolling * (symbol_of(cage.slips[k - 1]) - last) * span
        words = f"Angle by which the cage lags in row {k + 1}"
        constants.append(names.define(symbol, before, "rad", words, rf"\lambda_{{{k + 1}}}"))
    of = f" of {bearing.name}" if bearing.name else ""

    def table(kind: Literal["table", "table_rate"], unit: str, words: str, latex: str) -> Input:
        name = f"{bearing.prefix}cage.{'lag' if kind == 'table' else 'lag_rate'}"
        return Input(
            name=name,
            symbol=sp.Symbol(f"input.{name}", real=True),
            kind=kind,
            unit=unit,
            description=words,
            latex=names.latex(latex),
            times=tuple(q.path for q in cage.time),
            values=tuple(symbol.name for symbol in symbols),
        )

    inputs = (
        table("table", "rad", f"Angle by which the cage{of} lags at the reference time", r"\lambda"),
        table("table_rate", "rad/s", f"Rate at which the cage{of} lags", r"\dot\lambda"),
    )
    value, rate = (one.symbol for one in inputs)
    return Lag(angle=value + rate * TIME, rate=rate, inputs=inputs, constants=tuple(constants))
