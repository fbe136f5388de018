"""The tables [load] and [loads.<name>] of a scene file to their records.

In: a table.  Out: a `Load`, or None, with a fault, where its type is unknown.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ballpass.derive.scene.quantity import Quantity
from ballpass.derive.scene.records import (
    ConstantLoad,
    HarmonicLoad,
    Load,
    LoadLaw,
    LoadWindow,
    TableLoad,
    UnbalanceLoad,
)
from ballpass.derive.scene.schema import Table, words_of_force


def read_load(table: Table, name: str = "") -> Load | None:
    """A load on the inner rings; `name` of ``[loads.<name>]``."""
    with table:
        kind = table.choice("type", tuple(_LAWS))
        if kind is None:
            table.know(*table.data)
            return None
        angle_window = _read_window(table, "window", "rad", "Angle of the shaft", (r"\theta", "30 deg"))
        time_window = _read_window(table, "time_window", "s", "Time", ("t", "0.1 s"))
        return Load(name=name, law=_LAWS[kind](table), angle_window=angle_window, time_window=time_window)


def _constant(table: Table) -> ConstantLoad:
    return ConstantLoad(force=table.vector("force", "N", words_of_force("the load on the inner ring", "F")))


def _harmonic(table: Table) -> HarmonicLoad:
    return HarmonicLoad(
        mean=table.vector("mean", "N", words_of_force("the mean load on the inner ring", r"\bar F")),
        amplitude=table.vector(
            "amplitude", "N", words_of_force("the amplitude of the load on the inner ring", r"\hat F")
        ),
        frequency=table.quantity("frequency", "Hz", "Frequency of the load", "f", example="50 Hz"),
        phase=_read_phase(table),
    )


def _read_phase(table: Table) -> Quantity | tuple[Quantity, Quantity]:
    """One phase, or a list of one for x and one for y."""
    words, given = "hase of the load at the start", table.data.get("phase")
    if not isinstance(given, list) or len(given) != 2:
        return table.quantity("phase", "rad", f"P{words}", r"\varphi", example="0 deg")
    table.know("phase")

    def of(axis: str, value: Any) -> Quantity:
        path = (*table.path, "phase", axis)
        return table.collector.quantity(path, value, "rad", f"{axis} component: p{words}", rf"\varphi_{axis}")

    return of("x", given[0]), of("y", given[1])


def _table(table: Table) -> TableLoad:
    if table.has("angle") and not table.has("time"):
        rows = table.column("angle", "rad", "Angle of the shaft in row ROW of the load's table", r"\theta_{ROW}")
    else:
        rows = table.column("time", "s", "Time of row ROW of the load's table", "t_{ROW}")
        table.know("angle")
        if table.has("angle"):
            table.fault(
                "angle",
                "the rows of the table are given twice",
                given="time and angle",
                allowed="time, or angle for a table over a turn of the shaft",
                remedy="delete one of the two",
            )
    return TableLoad(
        over="angle" if table.has("angle") and not table.has("time") else "time",
        rows=rows,
        x=table.column("x", "N", "x component of the load in row ROW of its table", "F_{x,ROW}"),
        y=table.column("y", "N", "y component of the load in row ROW of its table", "F_{y,ROW}"),
    )


def _unbalance(table: Table) -> UnbalanceLoad:
    return UnbalanceLoad(
        mass=table.quantity("mass", "kg", "Unbalanced mass", "m_u", example="5 g"),
        eccentricity=table.quantity(
            "eccentricity", "m", "Distance of the unbalanced mass from the axis", "e_u", example="20 mm"
        ),
        angle=table.quantity(
            "angle", "rad", "Angle of the unbalance at t = 0", r"\alpha_u", example="0 deg", default="0 deg"
        ),
    )


def _read_window(table: Table, key: str, unit: str, words: str, latex: tuple[str, str]) -> LoadWindow | None:
    """From start to end; without an end, which times may lack, for ever."""
    if not table.has(key):
        return None
    symbol, example = latex
    with table.table(key, "start and end") as window:
        start = window.quantity(
            "start", unit, f"{words} at which the load begins", rf"{symbol}_{{on}}", example=example
        )
        words = f"{words} at which the load ends"
        if unit == "s":
            return LoadWindow(start=start, end=window.optional_quantity("end", unit, words, rf"{symbol}_{{off}}"))
        return LoadWindow(start=start, end=window.quantity("end", unit, words, rf"{symbol}_{{off}}", example="60 deg"))


_LAWS: dict[str, Callable[[Table], LoadLaw]] = {
    "constant": _constant,
    "harmonic": _harmonic,
    "table": _table,
    "unbalance": _unbalance,
}
