"""A cage whose slip changes over time: its lag behind a cage that has the slip of the last row.

In: a bearing.  Out: its slip beyond that of the last row, and its lag: known before a run where the rings turn with a
known driver, else a coordinate.
"""

from __future__ import annotations

import sympy as sp

from ballpass.derive.scene.bearing_records import Bearing
from ballpass.derive.terms import Definition, Names, symbol_of
from ballpass.derive.variables import Coordinate, Input
from ballpass.runtime.contract.manifest import CAGE_EXCESS_SLIP


def lag_names(bearing: Bearing, names: Names) -> tuple[sp.Symbol, ...]:
    """Constants that hold the lag at each row; none where the slip does not change."""
    rows = () if bearing.cage is None else bearing.cage.time
    return tuple(names.constant(f"cage.lag.{k}") for k in range(1, len(rows) + 1))


def excess_slip(bearing: Bearing, names: Names) -> Input | None:
    """Slip beyond that of the last row; None where it does not change."""
    if bearing.cage is None or not bearing.cage.time:
        return None
    of = f" of {bearing.name}" if bearing.name else ""
    return Input(
        name=f"{bearing.prefix}{CAGE_EXCESS_SLIP}",
        kind="table_rate",
        unit="1",
        description=f"Slip of the cage{of} beyond that of the last row",
        latex=names.latex(r"\Delta s_c"),
        times=tuple(q.path for q in bearing.cage.time),
        values=tuple(symbol.name for symbol in lag_names(bearing, names)),
    )


def lag_coordinate(bearing: Bearing, names: Names) -> Coordinate:
    """The lag as the velocity of a coordinate."""
    integral = names.variable("cage.lag_integral")
    return Coordinate(
        name=integral.name,
        kind="lag",
        unit="rad*s",
        position=integral,
        velocity=names.variable("cage.lag"),
        latex=names.latex(r"\Lambda"),
        description=f"angle by which the cage{f' of {bearing.name}' if bearing.name else ''} lags",
        group=f"{names.path}.cage",
    )


def lag_at_rows(bearing: Bearing, names: Names) -> tuple[Definition, ...]:
    """Lag at each row of a cage without slip at one turn of it a time, beside the lag at the start."""
    assert bearing.cage is not None  # its slip changes
    cage, symbols = bearing.cage, lag_names(bearing, names)
    constants, before = list[Definition](), sp.S.Zero
    for k, symbol in enumerate(symbols):
        if k:
            span = symbol_of(cage.time[k]) - symbol_of(cage.time[k - 1])
            before = symbols[k - 1] + (symbol_of(cage.slips[k - 1]) - symbol_of(cage.slips[-1])) * span
        words = f"Lag of the cage over its speed without slip, in row {k + 1}"
        constants.append(names.define(symbol, before, "s", words, rf"\lambda_{{{k + 1}}}"))
    return tuple(constants)
