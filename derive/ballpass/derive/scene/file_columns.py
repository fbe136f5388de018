"""Columns of numbers that a scene takes from a CSV or NetCDF file: measured forces and loads.

In: the parsed TOML of a scene file and its folder.  Out: the same with ``{ file = "punch.csv", column = "force",
unit = "N" }`` in the form of a written column, ``{ values = [...], unit = "N" }``.

The first line of a CSV file names its columns; lines that begin with ``#`` are left out.  A column of a NetCDF file,
whose name ends in ``.nc``, is a variable of one dimension; its attribute ``units`` is taken where the scene gives no
unit.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NoReturn

from ballpass.derive.scene.errors import Fault
from ballpass.runtime.contract.folders import read_file, refuse_other

#: Bytes of a file of columns at most.
LARGEST = 100_000_000

#: Most rows: each is a parameter of the model, with a derivative of its own.
MOST_ROWS = 1000


def named_files(data: object) -> Iterator[str]:
    """Names of the files that columns of a scene come from."""
    if isinstance(data, dict):
        if isinstance(data.get("file"), str) and "column" in data:
            yield data["file"]
        for value in data.values():
            yield from named_files(value)


def with_columns(data: dict[str, Any], folder: Path | None, faults: list[Fault], path: str = "") -> dict[str, Any]:
    """The scene's tables with the columns of files in place of their names; faults are noted.

    Parameters
    ----------
    folder : of the scene file; None for a scene that is only text
    path : dotted place of `data`
    """
    if isinstance(data.get("file"), str) and isinstance(data.get("column"), str):
        return _column(data, folder, faults, path)
    return {
        key: with_columns(value, folder, faults, f"{path}.{key}" if path else key) if isinstance(value, dict) else value
        for key, value in data.items()
    }


class _Unfit(Exception):
    """A fault of a column, as the parts of a `Fault`."""


def _refuse(problem: str, given: object, allowed: str, remedy: str) -> NoReturn:
    raise _Unfit(problem, repr(given), allowed, remedy)


def _column(data: dict[str, Any], folder: Path | None, faults: list[Fault], path: str) -> dict[str, Any]:
    rest = {key: value for key, value in data.items() if key not in ("file", "column")}
    name, wanted = data["file"], data["column"]
    try:
        if folder is None:
            text = "a path counts from the folder of the scene file, and this scene has none"
            _refuse(text, name, "columns written as lists", "read the scene from a file, or write the numbers down")
        if not name.endswith(".nc"):
            return {**rest, "values": _of_csv(folder / name, name, wanted)}
        values, unit = _of_netcdf(folder / name, name, wanted)
        return {"unit": unit, **rest, "values": values} if unit else {**rest, "values": values}
    except _Unfit as unfit:
        problem, given, allowed, remedy = unfit.args
        faults.append(Fault(key=path, problem=problem, given=given, allowed=allowed, remedy=remedy))
        return {**rest, "values": [0.0, 0.0]}


def _few(name: str, rows: int) -> None:
    if rows > MOST_ROWS:
        remedy = "thin it out: a table is linear between"
        _refuse(f"{name} has too many rows", rows, f"at most {MOST_ROWS}", remedy)


def _named(name: str, wanted: str, known: Sequence[str]) -> None:
    if wanted not in known:
        _refuse(f"{name} has no such column", wanted, ", ".join(known) or "none: it is empty", "name one of them")


def _of_csv(file: Path, name: str, wanted: str) -> list[float]:
    try:
        text = read_file(file, LARGEST).decode("utf-8-sig")
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or "it is not text in UTF-8"
        _refuse(f"the file cannot be read: {why}", name, "a CSV file", "give its path from the scene file's folder")
    lines = [
        (k, line) for k, line in enumerate(text.splitlines(), start=1) if line.strip() and not line.startswith("#")
    ]
    rows = list(csv.reader((line for _, line in lines), skipinitialspace=True))
    heads = [head.strip() for head in rows[0]] if rows else []
    _named(name, wanted, heads)
    _few(name, len(rows) - 1)
    place, values = heads.index(wanted), []
    for (line, _), row in zip(lines[1:], rows[1:], strict=True):
        try:
            values.append(float(row[place]))
        except (ValueError, IndexError):
            given = row[place] if place < len(row) else "nothing"
            _refuse(f"line {line} of {name} has no number there", given, "numbers without a unit", "correct the line")
    return values


def _of_netcdf(file: Path, name: str, wanted: str) -> tuple[list[float], str]:
    """Numbers, and their unit; "" where the file has none."""
    import h5netcdf  # importing it takes longer than reading most scenes

    try:
        refuse_other(file)
        stored = h5netcdf.File(file, "r")
    except (OSError, ValueError) as error:
        why = "there is no such file" if isinstance(error, FileNotFoundError) else "it is not a NetCDF-4 file"
        _refuse(
            f"the file cannot be read: {why}", name, "a NetCDF-4 file", "give its path from the scene file's folder"
        )
    with stored:
        _named(name, wanted, list(stored.variables))
        variable = stored.variables[wanted]
        if variable.ndim != 1 or variable.dtype.kind not in "fiu":
            given = f"{variable.ndim} dimensions of {variable.dtype}"
            _refuse(f"{wanted} of {name} is no column", given, "numbers along one dimension", "name another variable")
        _few(name, variable.shape[0])
        unit = variable.attrs.get("units", "")
        return [float(value) for value in variable[...]], unit if isinstance(unit, str) else ""
