"""Files of columns: the one reader of CSV and NetCDF files for scenes, fits, spectra and sensors.

In: a path.  Out: a `ColumnFile`.

Of a CSV file the layout is found: separator (comma, semicolon, tab, blanks), decimal point or comma, lines before the
line of names, a second line with units, a byte order mark.  Without a line of names columns are called 1, 2, 3.  Lines
that begin with ``#`` are comments; ``# PATH = VALUE`` among them is an assignment.  Variables of a NetCDF-4 file follow
the CF conventions: ``units``, ``scale_factor``, ``add_offset``, ``_FillValue``, ``missing_value``, ``valid_range``.
"""

from __future__ import annotations

import csv
import io
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ballpass.runtime.contract.columns import NUMBER, Column, ColumnError, ColumnFile, headed, is_known_unit, unit_of
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.folders import read_file, refuse_other
from ballpass.runtime.contract.units import show

#: Largest CSV file, and largest variable of a NetCDF file [bytes].
LARGEST = 200_000_000

#: Rows by which the layout of a CSV file is found.
SAMPLE = 1000

#: Separators that are tried; of equally good ones the first is taken.
SEPARATORS = {"\t": "tabs", ";": "semicolons", ",": "commas", " ": "blanks"}

#: Attributes that say what the numbers of a variable mean, and whether it is one.
ATTRIBUTES = (
    *("NAME", "units", "unit", "scale_factor", "add_offset", "_FillValue", "missing_value", "_Unsigned"),
    *("valid_range", "valid_min", "valid_max"),
)

#: Value that NetCDF writes where nothing was written.
UNWRITTEN = 9.969209968386869e36


def read_columns(path: Path, name: str = "") -> ColumnFile:
    """Read the columns of a file: NetCDF-4 where its name ends in ``.nc``, else CSV.

    Parameters
    ----------
    name : of the file in messages; its own if there is none

    Raises
    ------
    ColumnError
        The file cannot be read.

    Examples
    --------
    >>> _ = Path("probe.csv").write_text("Zeit [ms];Weg (um)\\n0;1,5\\n0,5;2,5\\n", encoding="utf-8")
    >>> found = read_columns(Path("probe.csv"))
    >>> found.layout, found.time(), found.si(found.column("Weg"), "m")
    ('separated by semicolons, decimal commas', array([0.    , 0.0005]), array([1.5e-06, 2.5e-06]))
    """
    name = name or path.name
    return _netcdf(path, name) if path.suffix == ".nc" else _csv(path, name)


def assigned(line: str) -> tuple[str, str]:
    """Name and value of a comment such as ``# shaft.speed = 2400 rpm``."""
    name, _, value = line.lstrip("# ").partition("=")
    return name.strip(), value.strip()


def text_lines(path: Path, name: str) -> list[str]:
    """Lines of a text file; blank ones and comments stay, so that lines can be counted.

    Raises
    ------
    ColumnError
        The file cannot be read, or is not text.
    """
    try:
        text = read_file(path, LARGEST).decode("utf-8-sig")
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or "it is not text in UTF-8"
        raise ColumnError(
            f"the file cannot be read, {why}", name, "a CSV file in UTF-8, or NetCDF-4 (.nc)", "check path and format"
        ) from None
    return list(io.StringIO(text, newline=None))


def rows_of(lines: Sequence[str], separator: str, name: str) -> list[tuple[int, list[str]]]:
    """Line and cells of each row that is neither blank nor a comment.

    Raises
    ------
    ColumnError
        A cell is not closed, or is too long.
    """
    blanks = separator == " "
    plain = (
        "\n" if line.startswith("#") else re.sub(r" +(?=[\[(])", "", line.strip()) if blanks else line for line in lines
    )
    reader = csv.reader(plain, delimiter=separator, skipinitialspace=True)
    try:
        return [(reader.line_num, cells) for row in reader if any(cells := [cell.strip() for cell in row])]
    except csv.Error as error:
        raise ColumnError(
            f"{name} is no table, from line {reader.line_num} on",
            str(error),
            "a row a line",
            "check quotes and separators",
        ) from None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Block:
    """Rows of numbers at the end of a file: cells in a row, the first row, columns of numbers, empty last ones."""

    separator: str
    width: int
    first: int
    numeric: tuple[int, ...]
    spare: int
    score: tuple[float, ...]


def _block(rows: Sequence[list[str]], separator: str) -> _Block:
    later = rows[len(rows) // 2 :]
    width = Counter(map(len, later)).most_common(1)[0][0] if later else 0
    full = [row for row in later if len(row) == width]
    counts = [(sum(map(_is_number, column)), sum(map(bool, column))) for column in zip(*full, strict=True)]
    numeric = tuple(k for k, (number, filled) in enumerate(counts) if 2 * number > filled)

    def fits(row: list[str]) -> bool:
        return len(row) == width and all(not row[k] or _is_number(row[k]) for k in numeric)

    fitting = [fits(row) for row in rows]
    first = next((k for k, fit in enumerate(fitting) if fit and np.mean(fitting[k : k + 10]) > 0.5), len(rows))
    head = _unpadded(rows[first - 1]) if first > 0 else []
    filled = sum(number for _, number in counts)
    share = sum(number for number, _ in counts) / max(filled, 1) * len(full) / max(len(later), 1)
    cut = width == 1 and any(mark in head[0] for mark in SEPARATORS if mark != " ") if len(head) == 1 else False
    likely = 2 if head and len(head) == width and not cut else int(len(head) < 2)
    return _Block(
        separator=separator,
        width=width,
        first=first if numeric else len(rows),
        numeric=numeric,
        spare=width - max((k for k, (_, filled) in enumerate(counts, start=1) if filled), default=0),
        score=(bool(numeric), likely, round(share, 3), width),
    )


def _is_number(cell: str) -> bool:
    return NUMBER.fullmatch(cell) is not None


def _unpadded(row: Sequence[str]) -> list[str]:
    """Cells up to the last one that is not empty."""
    return list(row[: max((k for k, cell in enumerate(row, start=1) if cell), default=0)])


def _csv(path: Path, name: str) -> ColumnFile:
    lines = text_lines(path, name)
    block = max(
        (_block([cells for _, cells in rows_of(lines[:SAMPLE], sep, name)], sep) for sep in SEPARATORS),
        key=lambda one: one.score,
    )
    rows = rows_of(lines, block.separator, name)
    comments = [line for line in lines if line.startswith("#")]
    said = dict(assigned(line) for line in comments if "=" in line)
    above, body = rows[: block.first], rows[block.first :]
    if not block.numeric:
        raise ColumnError(
            f"{name} has no column of numbers", f"{len(rows)} lines", "a line of names, then numbers", "check the file"
        )
    heads, units, words = _heads(name, above, comments, block)
    whole = not any("." in cells[k] for _, cells in body[:SAMPLE] for k in block.numeric if k < len(cells))
    if block.separator == "," and block.width % 2 == 0 and whole and heads[0] == "1":
        raise ColumnError(
            f"{name} has no line of names, and commas that may separate numbers or be decimal commas",
            show(",".join(body[0][1])),
            "a line of names above the numbers, or semicolons between them",
            "add one",
        )
    for line, cells in body:
        if len(_unpadded(cells)) > block.width or len(cells) < block.width:
            raise ColumnError(
                f"line {line} of {name} has another number of cells than the rest",
                str(len(cells)),
                f"{block.width} separated by {SEPARATORS[block.separator]}",
                "correct the line",
            )
    comma = any("," in cells[k] and _is_number(cells[k]) for _, cells in body[:SAMPLE] for k in block.numeric)
    found = [f"separated by {SEPARATORS[block.separator]}"] if block.separator != "," and block.width > 1 else []
    found += ["decimal commas"] if comma else []
    texts = list(zip(*(cells[: block.width] for _, cells in body), strict=True))
    columns = [
        replace(headed(head, unit), cells=column) for head, unit, column in zip(heads, units, texts, strict=True)
    ]
    return ColumnFile(
        name=name,
        columns=tuple(one for one in columns if one.head or any(one.cells)),
        lines=tuple(line for line, _ in body),
        decimal_comma=comma,
        said=said,
        layout=", ".join([*found, *words]),
    )


def _heads(
    name: str, above: list[tuple[int, list[str]]], comments: Sequence[str], block: _Block
) -> tuple[list[str], list[str], list[str]]:
    """Names and units of the columns from the rows above the numbers, and in words where they were found."""
    none = [""] * block.width
    head = _unpadded(above[-1][1]) if above else []
    if not head:
        last = [rows_of([line.lstrip("# ")], block.separator, name) for line in comments if "=" not in line]
        found = last[-1][0][1] if last and last[-1] else []
        head = found if len(found) == block.width > 1 and not any(map(_is_number, found)) else []
    if len(head) <= 1 < block.width:  # a title, or nothing
        return [str(k + 1) for k in range(block.width)], none, ["no line of names"]
    if any(_is_number(head[k]) for k in block.numeric if k < len(head)):
        raise ColumnError(
            f"line {above[-1][0]} of {name} is neither names nor numbers",
            ", ".join(map(show, head[:5])),
            "numbers without a unit below a line of names",
            "correct the line; a unit stands in the line of names, in brackets",
        )
    head += [""] * min(block.width - len(head), block.spare)
    if len(head) != block.width:
        raise ColumnError(
            f"the line above the numbers of {name} does not name its columns",
            f"{len(head)} names for {block.width} columns: {', '.join(map(show, head[:5]))}",
            f"a name for each, separated by {SEPARATORS[block.separator]}",
            "correct the line; separate numbers with decimal commas by semicolons",
        )
    units = [cell.strip("[]() ") for cell in head]
    names = _unpadded(above[-2][1]) if len(above) > 1 else []
    if (
        1 < len(names) <= block.width
        and any(map(is_known_unit, units))
        and all(unit in ("", "-", "1") or is_known_unit(unit) for unit in units)
    ):
        skipped = [f"{len(above) - 2} lines before the names"] if len(above) > 2 else []
        names += [""] * (block.width - len(names))
        return names, ["" if unit in ("-", "1") else unit for unit in units], [*skipped, "units in a line of their own"]
    return head, none, [f"{len(above) - 1} lines before the names"] if len(above) > 1 else []


def _netcdf(path: Path, name: str) -> ColumnFile:
    """Variables of one dimension, decoded by the CF conventions, and attributes that are texts."""
    import h5py  # importing it takes longer than reading most scenes

    try:
        refuse_other(path)
        with h5py.File(path, "r") as stored:  # dimensions, which h5netcdf looks up, are not needed
            items = {key: item for key, item in stored.items() if isinstance(item, h5py.Dataset) and item.ndim == 1}
            columns = [_variable(name, key, item) for key, item in items.items() if item.dtype.kind in "fiu"]
            said = {
                key: str(value) for key, value in _attributes(stored, stored.attrs).items() if isinstance(value, str)
            }
    except RequestError:
        raise
    except Exception as error:  # h5py raises whatever a broken file leads it to
        why = "there is no such file" if isinstance(error, FileNotFoundError) else "it is not a NetCDF-4 file"
        raise ColumnError(
            f"the file cannot be read, {why}", name, "NetCDF-4 (.nc), or a CSV file", "check path and format"
        ) from error
    return ColumnFile(name=name, columns=tuple(one for one in columns if one is not None), said=said)


def _attributes(item: Any, names: Iterable[str]) -> dict[str, Any]:
    """Attributes that are there: those of one value as that value, texts as `str`."""
    found = {}
    for key in names:
        value = item.attrs.get(key)
        plain = value.item() if isinstance(value, np.ndarray | np.generic) and value.size == 1 else value
        if plain is not None:
            found[key] = plain.decode("utf-8", "replace") if isinstance(plain, bytes) else plain
    return found


def _variable(file: str, key: str, item: Any) -> Column | None:
    """A variable as it is meant, NaN for what is missing; None for a dimension without one.

    Source: CF conventions 1.11, sections 2.5.1, 3.1 and 8.1.
    """
    attributes = _attributes(item, ATTRIBUTES)
    if str(attributes.get("NAME", "")).startswith("This is a netCDF dimension but not"):
        return None
    if item.size * item.dtype.itemsize > LARGEST:
        raise ColumnError(f"{show(key)} of {file} is too large", f"{item.size} numbers", "200 MB", "cut the record")
    raw = np.asarray(item[...])
    if str(attributes.get("_Unsigned", "")).lower() == "true" and raw.dtype.kind == "i":
        raw = raw.view(raw.dtype.str.replace("i", "u"))
    missing = raw > UNWRITTEN * (1.0 - 1e-6) if raw.dtype.kind == "f" else np.zeros(raw.shape, dtype=bool)
    for name in ("_FillValue", "missing_value"):
        for value in np.ravel(attributes.get(name, ())):
            missing |= raw == np.asarray(value).astype(raw.dtype)
    low, high = attributes.get("valid_range", (attributes.get("valid_min"), attributes.get("valid_max")))
    missing |= False if low is None else raw < low
    missing |= False if high is None else raw > high
    numbers = raw.astype(float) * float(attributes.get("scale_factor", 1.0)) + float(attributes.get("add_offset", 0.0))
    unit = re.sub(r"\s+since\s.*", "", str(attributes.get("units", attributes.get("unit", ""))).strip())
    unit = re.sub(r"(?<=[A-Za-zµ])(?=-?\d)", "^", unit_of(unit))  # m s-2
    return Column(
        head=key, name=key, unit="" if unit == "1" else unit, stated=True, cells=np.where(missing, np.nan, numbers)
    )
