"""Columns of numbers that a scene takes from a CSV file: measured forces and loads.

In: the parsed TOML of a scene file and its folder.  Out: the same with ``{ file = "punch.csv", column = "force",
unit = "N" }`` in the form of a written column, ``{ values = [...], unit = "N" }``.

The first line of a CSV file names its columns; lines that begin with ``#`` are left out.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ballpass.derive.scene.errors import Fault

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


def _column(data: dict[str, Any], folder: Path | None, faults: list[Fault], path: str) -> dict[str, Any]:
    rest = {key: value for key, value in data.items() if key not in ("file", "column")}

    def fault(problem: str, given: object, allowed: str, remedy: str) -> dict[str, Any]:
        faults.append(Fault(key=path, problem=problem, given=repr(given), allowed=allowed, remedy=remedy))
        return {**rest, "values": [0.0, 0.0]}

    name, wanted = data["file"], data["column"]
    if folder is None:
        text = "a path counts from the folder of the scene file, and this scene has none"
        return fault(text, name, "columns written as lists", "read the scene from a file, or write the numbers down")
    try:
        text = (folder / name).read_text(encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or "it is no text in UTF-8"
        return fault(
            f"the file cannot be read: {why}", name, "a CSV file", "give its path from the scene file's folder"
        )
    lines = [
        (k, line) for k, line in enumerate(text.splitlines(), start=1) if line.strip() and not line.startswith("#")
    ]
    rows = list(csv.reader((line for _, line in lines), skipinitialspace=True))
    heads = [head.strip() for head in rows[0]] if rows else []
    if wanted not in heads:
        return fault(f"{name} has no such column", wanted, ", ".join(heads) or "none: it is empty", "name one of them")
    if len(rows) - 1 > MOST_ROWS:
        return fault(
            f"{name} has too many rows", len(rows) - 1, f"at most {MOST_ROWS}", "thin it out: a table is linear between"
        )
    place, values = heads.index(wanted), []
    for (line, _), row in zip(lines[1:], rows[1:], strict=True):
        try:
            values.append(float(row[place]))
        except (ValueError, IndexError):
            given = row[place] if place < len(row) else "nothing"
            return fault(
                f"line {line} of {name} has no number there", given, "numbers without a unit", "correct the line"
            )
    return {**rest, "values": values}
