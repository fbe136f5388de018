"""Measured signals of a trial, from a CSV or NetCDF file or from arrays.

In: a path or a mapping, a manifest, names of columns by output.  Out: a `Trial`, SI.

A CSV file's first line names its columns, with a unit in brackets where it is not SI: ``time [ms],outer.y [um]``.  The
first column is the time.  Where it is ``frequency [Hz]`` the others are amplitudes of outputs.  Where it is
``quantity``, rows name quantities: ``quantity,value,deviation`` with units in the cells.  A line ``# PATH = VALUE``
says a number of the scene in this trial alone; other lines that begin with ``#`` are left out.  A NetCDF file has a
variable ``time`` or ``frequency``, units in attributes, and numbers of the trial in attributes of its own.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.folders import read_file, refuse_other
from ballpass.runtime.contract.manifest import Manifest, VariableInfo
from ballpass.runtime.contract.parameters import said_unit, unknown_name, wrong_unit
from ballpass.runtime.contract.units import QuantityError, parse_quantity
from ballpass.runtime.quantity.grammar import parse_quantity as parse_quantity_name

#: Largest CSV file [bytes].
LARGEST = 500_000_000

#: Fewest samples of a signal; most lines of a spectrum.
FEWEST, MOST_LINES = 8, 2000

#: Measured signals as callers give them.
Source = str | Path | Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trial:
    """Signals of one measurement.

    Attributes
    ----------
    name : of the file, or the number of the trial
    t : times of the samples as they were recorded, shape (samples,) [s]
    signals : by output, NaN for what is missing, each of shape (samples,) [output's unit]
    parameters : numbers of the scene in this trial alone, SI
    quantities : what was measured instead of signals
    """

    name: str
    t: np.ndarray
    signals: Mapping[str, np.ndarray]
    parameters: Mapping[str, float]
    quantities: tuple[MeasuredQuantities, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MeasuredQuantities:
    """Quantities of one run: amplitudes of a spectrum, or any others.

    Attributes
    ----------
    name : for people
    names : of the quantities
    unit : of a spectrum; empty where each has its own
    frequencies : of a spectrum, shape (quantities,), empty for others [Hz]
    values : SI, of the same shape
    sizes : in which noise is counted, of the same shape: 1 in a spectrum, else deviations as given, or the values
    """

    name: str
    names: tuple[str, ...]
    unit: str
    frequencies: np.ndarray
    values: np.ndarray
    sizes: np.ndarray


def read_trial(manifest: Manifest, source: Source, columns: Mapping[str, str], number: int) -> Trial:
    """Read the signals of a trial.

    Parameters
    ----------
    source : path of a file, or a mapping with ``time``, columns by name, and numbers of the scene by name, all SI
    columns : column by output; where there is none, all columns that are named as outputs are taken
    number : of the trial, from 1 on, as the name of a mapping

    Raises
    ------
    RequestError
        No such file or column, another format, times that do not increase, or too few samples.
    """
    infos = {info.name: info for info in manifest.parameters}
    if isinstance(source, str | Path):
        name = Path(source).name
        table, said = _netcdf(source) if name.endswith(".nc") else _csv(source)
        numbers = {
            key: _quantity(f"{name}, {key}", text, infos[key].unit) for key, text in said.items() if key in infos
        }
    elif not hasattr(source, "keys"):
        raise RequestError(
            f"data: a file (CSV, NetCDF) or a mapping with time and columns is expected, not {source!r:.60} "
            f"({type(source).__name__})."
        )
    else:
        name = f"trial {number}"
        numbers = {key: float(_floats(name, key, source[key], ())) for key in source if key in infos}
        for key, info in infos.items():
            if key in source and (wrong := wrong_unit(source[key], info.unit)):
                raise RequestError(f"{name}, {key}: {wrong}")
        table = {str(key): (source[key], said_unit(source[key])) for key in source if key not in infos}
        if "time" not in table and table and all(np.size(value) <= 2 for value, _ in table.values()):
            pairs = {key: np.atleast_1d(_floats(name, key, value)) for key, (value, _) in table.items()}
            units = {key: unit.removeprefix("1") for key, (_, unit) in table.items()}
            rows = [
                (key, *(f"{number!r} {units[key]}".rstrip() for number in pair.tolist())) for key, pair in pairs.items()
            ]
            table = {"quantity": (rows, "")}
    if "quantity" in table:
        given = (_quantities(manifest, name, table["quantity"][0]),)
        return Trial(name=name, t=np.zeros(0), signals={}, parameters=numbers, quantities=given)
    arrays = {key: (_floats(name, key, values), unit) for key, (values, unit) in table.items()}
    return _trial(manifest, name, arrays, columns, numbers)


def _floats(name: str, key: str, value: Any, shape: tuple[int, ...] | None = None) -> np.ndarray:
    """The value as numbers; `shape`: the only one that is allowed."""
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        array = None
    if array is None or shape not in (None, array.shape):
        what = "one number in SI is" if shape == () else "numbers in SI are"
        raise RequestError(f"{name}, {key}: {what} expected, not {value!r:.60} ({type(value).__name__}).")
    return array


def _quantities(manifest: Manifest, name: str, rows: Sequence[Sequence[str]]) -> MeasuredQuantities:
    """Quantities from rows of name, value and deviation; numbers without a unit are SI."""
    names, values, sizes = [], [], []
    for cells in rows:
        if not 2 <= len(cells) <= 3:
            raise RequestError(f"{name}: {','.join(cells)!r:.80} is no row of it. Allowed: quantity,value[,deviation].")
        unit = parse_quantity_name(manifest, cells[0].strip()).unit
        value, size = (_with_unit(f"{name}, {cells[0]}", cell, unit) for cell in (cells[1], cells[-1]))
        if not (np.isfinite(value) and np.isfinite(size) and size != 0.0):
            raise RequestError(f"{name}, {cells[0]}: a value above zero is expected, or a deviation beside it.")
        names.append(cells[0].strip())
        values.append(value)
        sizes.append(abs(size))
    if len(set(names)) < len(names):
        raise RequestError(f"{name}: a quantity is there twice. Give each once, with the mean of its values.")
    return MeasuredQuantities(
        name=f"quantities of {name}",
        names=tuple(names),
        unit="",
        frequencies=np.zeros(0),
        values=np.array(values),
        sizes=np.array(sizes),
    )


def _with_unit(what: str, text: str, unit: str) -> float:
    try:
        return float(text)
    except ValueError:
        return _quantity(what, text, unit)


def measurable(manifest: Manifest, wanted: Iterable[str]) -> dict[str, VariableInfo]:
    """States and outputs with one value; `RequestError` for what is wanted and none of them."""
    infos = {info.name: info for info in (*manifest.states, *manifest.outputs) if getattr(info, "size", 1) == 1}
    faults = [unknown_name("output or state with one value", key, infos) for key in wanted if key not in infos]
    if faults:
        raise RequestError("\n".join(faults))
    return infos


def _trial(
    manifest: Manifest,
    name: str,
    table: Mapping[str, tuple[np.ndarray, str]],
    columns: Mapping[str, str],
    numbers: Mapping[str, float],
) -> Trial:
    infos = measurable(manifest, columns)
    chosen = dict(columns) or {key: key for key in table if key in infos}
    faults = [unknown_name(f"column of {name}", column, table) for column in chosen.values() if column not in table]
    axis, unit = ("frequency", "Hz") if "frequency" in table else ("time", "s")
    if axis not in table:
        faults.append(f"{name} has no time. Allowed: a variable `time` or `frequency`; the first column of a CSV file.")
    if not chosen:
        faults.append(
            f"{name}: none of its columns ({', '.join(table) or 'none'}) is an output of the scene. Name them so, or "
            'say which is which: "outer.y=COLUMN" (--signal).'
        )
    if faults:
        raise RequestError("\n".join(faults))
    t = _in_si(f"{name}, {axis}", *table[axis], unit)
    found = {key: _in_si(f"{name}, {column}", *table[column], infos[key].unit) for key, column in chosen.items()}
    if t.ndim != 1 or not np.all(np.isfinite(t)) or not np.all(np.diff(t) > 0.0):
        raise RequestError(
            f"{name}: values of {axis} do not increase throughout. Allowed: increasing finite numbers. Sort them."
        )
    for key, values in found.items():
        if values.shape != t.shape:
            raise RequestError(
                f"{name}, {key}: {values.shape} values for {len(t)} numbers of {axis}. Give one for each."
            )
        if np.count_nonzero(np.isfinite(values)) < FEWEST or np.nanstd(values) == 0.0:
            raise RequestError(f"{name}, {key}: allowed are signals of {FEWEST} samples or more that are not constant.")
    if axis == "time":
        return Trial(name=name, t=t, signals=found, parameters=dict(numbers))
    if not t[0] > 0.0 or len(t) > MOST_LINES:
        raise RequestError(
            f"{name}: {len(t)} lines from {t[0]:g} Hz on. Allowed: {MOST_LINES} above 0 Hz. Leave others out."
        )
    spectra = []
    for key, values in found.items():
        kept = np.isfinite(values)
        spectra.append(
            MeasuredQuantities(
                name=f"spectrum of {key} of {name}",
                names=tuple(f"amplitude:{key}@{frequency!r}Hz" for frequency in t[kept].tolist()),
                unit=infos[key].unit,
                frequencies=t[kept],
                values=values[kept],
                sizes=np.ones(np.count_nonzero(kept)),
            )
        )
    return Trial(name=name, t=np.zeros(0), signals={}, parameters=dict(numbers), quantities=tuple(spectra))


def _in_si(what: str, values: np.ndarray, unit: str, wanted: str) -> np.ndarray:
    """Values in the output's unit; without a unit they are."""
    return values if unit in ("", wanted) else values * _quantity(what, f"1 {unit}", wanted)


def _quantity(what: str, text: str, unit: str) -> float:
    try:
        return parse_quantity(text, unit)
    except QuantityError as error:
        raise RequestError(f"{what}: {error}") from None


def quantities_in(source: Source) -> list[str]:
    """Names of quantities in the rows of a CSV file; none of other files, and of mappings."""
    if not isinstance(source, str | Path) or Path(source).suffix == ".nc":
        return []
    heads, rows, _ = _lines(source)
    return [cells[0].strip() for cells in csv.reader(rows[1:])] if _are_quantities(heads) else []


def _are_quantities(heads: Sequence[tuple[str, str]]) -> bool:
    return bool(heads) and heads[0][0] == "quantity"


def _lines(path: str | Path) -> tuple[list[tuple[str, str]], list[str], dict[str, str]]:
    """Names and units of the columns of a CSV file, its lines from the first one on, and assignments in comments."""
    try:
        text = read_file(path, LARGEST).decode("utf-8-sig")
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or "it is not text in UTF-8"
        raise RequestError(f"{path}: cannot be read: {why}. Allowed: a CSV file, or NetCDF (.nc).") from None
    lines = [line for line in text.splitlines() if line.strip()]
    said = dict(_assigned(line) for line in lines if line.startswith("#") and "=" in line)
    rows = [line for line in lines if not line.startswith("#")]
    return [_head(cell) for cell in next(csv.reader(rows[:1]), [])], rows, said


def _csv(path: str | Path) -> tuple[dict[str, tuple[Any, str]], dict[str, str]]:
    """Columns with their units, or rows of quantities, and assignments in comments."""
    heads, rows, said = _lines(path)
    if _are_quantities(heads):
        return {"quantity": (list(csv.reader(rows[1:])), "")}, said
    try:
        values = np.loadtxt(rows[1:], delimiter=",", ndmin=2, converters=lambda cell: float(cell.strip() or "nan"))
    except ValueError as error:
        raise RequestError(f"{path}: {error}. Allowed: numbers with commas between, below a line of names.") from None
    if not heads or values.shape[1:] != (len(heads),):
        raise RequestError(f"{path}: {len(heads)} names for {values.shape[-1]} columns. Name each in the first line.")
    table = {name: (column, unit) for (name, unit), column in zip(heads, values.T, strict=True)}
    axis = "frequency" if heads[0][0] == "frequency" else "time"
    return {axis: (values[:, 0], heads[0][1])} | table, said


def _assigned(line: str) -> tuple[str, str]:
    name, _, value = line.lstrip("# ").partition("=")
    return name.strip(), value.strip()


def _head(cell: str) -> tuple[str, str]:
    """Name of a column, and its unit from brackets behind it."""
    name, _, unit = cell.strip().rstrip("]").partition("[")
    return name.strip(), unit.strip()


def _netcdf(path: str | Path) -> tuple[dict[str, tuple[Any, str]], dict[str, str]]:
    """Variables of one dimension with their units, and attributes that are texts."""
    import h5netcdf

    try:
        refuse_other(Path(path))
        stored = h5netcdf.File(path, "r")
    except (OSError, ValueError) as error:
        why = "there is no such file" if isinstance(error, FileNotFoundError) else "it is not a NetCDF-4 file"
        raise RequestError(f"{path}: cannot be read: {why}. Allowed: NetCDF-4, or a CSV file.") from None
    with stored:
        table = {
            name: (np.asarray(item[...], dtype=float), str(item.attrs.get("units", "")))
            for name, item in stored.variables.items()
            if item.ndim == 1 and item.dtype.kind in "fiu"
        }
        said = {name: value for name, value in stored.attrs.items() if isinstance(value, str)}
    return table, said


def read_columns(signals: str | Sequence[str] | None) -> dict[str, str]:
    """Columns by output from texts such as ``outer.y=outer_y_m``.

    Raises
    ------
    RequestError
        Another form.
    """
    found = {}
    for text in [signals] if isinstance(signals, str) else list(signals or []):
        output, equals, column = (part.strip() for part in text.partition("="))
        if not equals or not output or not column:
            raise RequestError(f'signal: {text!r:.80} has another form. Allowed: "OUTPUT=COLUMN", as outer.y=accel_3.')
        found[output] = column
    return found
