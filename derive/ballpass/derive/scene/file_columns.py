"""Columns of numbers that a scene takes from a CSV or NetCDF file: measured forces and loads.

In: the parsed TOML of a scene file and its folder.  Out: the same with ``{ file = "punch.csv", column = "force",
unit = "N" }`` in the form of a written column, ``{ values = [...], unit = "N" }``.  The unit of the file is taken where
the scene gives none.  `ballpass.runtime.contract.column_files` reads the files.

Each row of a table is a parameter of the model, with a derivative of its own.  A table of more than `MOST_ROWS` rows is
thinned: the rows that are kept are those that the straight lines between the others miss most.
"""

from __future__ import annotations

import heapq
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ballpass.derive.scene.errors import Fault
from ballpass.runtime.contract.column_files import read_columns
from ballpass.runtime.contract.columns import ColumnError
from ballpass.runtime.contract.plausible_ranges import UnusualWarning

#: Most rows: each is a parameter of the model, with a derivative of its own.
MOST_ROWS = 1000


def named_files(data: object) -> Iterator[str]:
    """Names of the files that columns of a scene come from."""
    if isinstance(data, dict):
        if isinstance(data.get("file"), str) and "column" in data:
            yield data["file"]
        for value in data.values():
            yield from named_files(value)


def with_columns(
    data: dict[str, Any], folder: Path | None, faults: list[Fault], notes: list[str], path: str = ""
) -> dict[str, Any]:
    """The scene's tables with the columns of files in place of their names; faults and notes are added.

    A column that cannot be read has None in place of its values, and nothing more is reported of it.

    Parameters
    ----------
    folder : of the scene file; None for a scene that is only text
    path : dotted place of `data`
    """
    found, read = {}, {}
    for key, value in data.items():
        place = f"{path}.{key}" if path else key
        if isinstance(value, dict) and isinstance(value.get("file"), str) and isinstance(value.get("column"), str):
            found[key] = read[key] = _column(value, folder, faults, notes, place)
        else:
            found[key] = with_columns(value, folder, faults, notes, place) if isinstance(value, dict) else value
    _thin(path, read, notes)
    return found


def _column(
    data: dict[str, Any], folder: Path | None, faults: list[Fault], notes: list[str], path: str
) -> dict[str, Any]:
    rest = {key: value for key, value in data.items() if key not in ("file", "column")}
    name, wanted = data["file"], data["column"]
    try:
        if folder is None:
            raise ColumnError(
                "a path counts from the folder of the scene file, and this scene has none",
                repr(name),
                "columns written as lists",
                "read the scene from a file, or write the numbers down",
            )
        file = read_columns(folder / name, name)
        column = file.in_unit(file.column(wanted), str(rest.get("unit", "")))
        numbers = file.numbers(column)
        for missing in np.flatnonzero(~np.isfinite(numbers))[:1]:
            where = f"line {file.lines[missing]}" if file.lines else f"row {missing + 1}"
            raise ColumnError(
                f"{where} of {name} has no number there",
                repr(wanted),
                "a finite number in each row",
                "correct the file",
            )
    except ColumnError as fault:
        faults.append(
            Fault(key=path, problem=fault.problem, given=fault.given, allowed=fault.allowed, remedy=fault.remedy)
        )
        return {"unit": "1", **rest, "values": None}
    if file.layout and (note := f"{name}: {file.layout}") not in notes:
        notes.append(note)
    unit = {"unit": column.unit} if column.unit else {}
    return {**unit, **rest, "values": numbers.tolist()}


def _thin(path: str, columns: dict[str, dict[str, Any]], notes: list[str]) -> None:
    """Keep `MOST_ROWS` rows of a longer table: each next one is that which the lines between the others miss most."""
    over = next((key for key in columns if key in ("time", "angle")), "")
    lengths = {len(column["values"] or ()) for column in columns.values()}
    if not over or len(lengths) > 1 or max(lengths) <= MOST_ROWS:
        return
    x = np.array(columns[over]["values"])
    others = {key: np.array(column["values"]) for key, column in columns.items() if key != over}
    if np.any(np.diff(x) <= 0.0):  # reported when the table is read
        return
    scaled = np.array([values / (np.ptp(values) or 1.0) for values in others.values()]).reshape(len(others), len(x))
    kept, waiting = {0, len(x) - 1}, [_missed(x, scaled, 0, len(x) - 1)]
    while len(kept) < MOST_ROWS:
        _, row, first, last = heapq.heappop(waiting)
        kept.add(row)
        for ends in ((first, row), (row, last)):
            heapq.heappush(waiting, _missed(x, scaled, *ends))
    rows = sorted(kept)
    off = [
        f"{key} by {np.max(np.abs(np.interp(x, x[rows], values[rows]) - values)):.3g} {columns[key].get('unit', '')}"
        for key, values in others.items()
    ]
    for column in columns.values():
        column["values"] = [column["values"][row] for row in rows]
    held = f"{len(x)} rows of a file are held as {len(rows)}, linear between"
    note = f"{path}: {held}; this changes {', '.join(off)} at most"
    notes.append(note)
    warnings.warn(f"{note}.", UnusualWarning, stacklevel=2)


def _missed(x: np.ndarray, scaled: np.ndarray, first: int, last: int) -> tuple[float, int, int, int]:
    """The row between two that the line between them misses most; first how much, negative."""
    share = (x[first : last + 1] - x[first]) / (x[last] - x[first])
    line = scaled[:, [first]] + share * (scaled[:, [last]] - scaled[:, [first]])
    off = np.max(np.abs(scaled[:, first : last + 1] - line), axis=0, initial=0.0)
    row = int(np.argmax(off)) if last - first > 1 else 0
    return (-float(off[row]) if last - first > 1 else 1.0), first + row, first, last
