"""Measured signals of a trial, from a CSV or NetCDF file or from arrays.

In: a path or a mapping, a manifest, names of columns by output.  Out: a `Trial`, SI.

`ballpass.runtime.contract.column_files` reads the files.  A column ``frequency`` in place of a time makes the others
amplitudes of outputs.  Where the first column is ``quantity``, rows name quantities: ``quantity,value,deviation`` with
units in the cells.  A line ``# PATH = VALUE``, in NetCDF an attribute, says a number of the scene in this trial alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ballpass.runtime.contract.column_files import SAMPLE, SEPARATORS, assigned, read_columns, rows_of, text_lines
from ballpass.runtime.contract.columns import Column, ColumnFile
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import Manifest, VariableInfo
from ballpass.runtime.contract.parameters import said_unit, unknown_name, wrong_unit
from ballpass.runtime.contract.units import QuantityError, parse_quantity, show
from ballpass.runtime.quantity.grammar import parse_quantity as parse_quantity_name

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
    notes : how the file was read, in words
    """

    name: str
    t: np.ndarray
    signals: Mapping[str, np.ndarray]
    parameters: Mapping[str, float]
    quantities: tuple[MeasuredQuantities, ...] = ()
    notes: tuple[str, ...] = ()


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


def read_trial(
    manifest: Manifest,
    source: Source,
    columns: Mapping[str, str],
    number: int,
    time: str | None = None,
    rate: float | None = None,
) -> Trial:
    """Read the signals of a trial.

    Parameters
    ----------
    source : path of a file, or a mapping with ``time``, columns by name, and numbers of the scene by name, all SI
    columns : column by output; where there is none, all columns that are named as outputs are taken
    number : of the trial, from 1 on, as the name of a mapping
    time, rate : see `ColumnFile.time`

    Raises
    ------
    RequestError
        No such file or column, another format, times that do not increase, or too few samples.
    """
    infos = {info.name: info for info in manifest.parameters}
    rows: Sequence[Sequence[str]] = ()
    if isinstance(source, str | Path):
        path = Path(source)
        name = path.name
        rows, said = _rows_of_quantities(path)
        file = ColumnFile(name=name, columns=(), said=said) if rows else read_columns(path)
        numbers, notes = said_numbers(manifest, name, file.said)
        notes = [f"{name}: {file.layout}", *notes] if file.layout else notes
    elif not hasattr(source, "keys"):
        raise RequestError(
            f"data: a file (CSV, NetCDF) or a mapping with time and columns is expected, not {source!r:.60} "
            f"({type(source).__name__})."
        )
    else:
        name, notes = f"trial {number}", []
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
        else:
            made = [
                Column(head=key, name=key, unit=unit, stated=True, cells=_floats(name, key, values))
                for key, (values, unit) in table.items()
            ]
            file = ColumnFile(name=name, columns=tuple(made))
    if rows:
        given = (_quantities(manifest, name, rows),)
        return Trial(name=name, t=np.zeros(0), signals={}, parameters=numbers, quantities=given, notes=tuple(notes))
    return replace(_trial(manifest, file, columns, numbers, time, rate), notes=tuple(notes))


def said_numbers(manifest: Manifest, name: str, said: Mapping[str, str]) -> tuple[dict[str, float], list[str]]:
    """Numbers of the scene that a file says [SI], and words on what it says of others.

    Parameters
    ----------
    name : of the file
    said : values by path, as texts

    Raises
    ------
    RequestError
        A value of another unit, or a path of the scene that is misspelt.
    """
    units = {info.name: info.unit for info in manifest.parameters}
    tables, notes = {path.partition(".")[0] for path in units}, []
    for path in said:
        if path not in units and "." in path and path.partition(".")[0] in tables:
            raise RequestError(f"{name}: {unknown_name('parameter', path, units)} Correct it, or leave the line out.")
        if path not in units:
            notes.append(f"{name}: the comment {show(path, 40)} is no number of the scene and was left out")
    return {path: _quantity(f"{name}, {path}", said[path], units[path]) for path in said if path in units}, notes


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
    file: ColumnFile,
    columns: Mapping[str, str],
    numbers: Mapping[str, float],
    time: str | None,
    rate: float | None,
) -> Trial:
    infos, name = measurable(manifest, columns), file.name
    chosen = dict(columns) or {one.name: one.head for one in file.columns if one.name in infos}
    if not chosen:
        listed = ", ".join(show(one.head) for one in file.columns) or "none"
        raise RequestError(
            f"{name}: none of its columns ({listed}) is an output of the scene. Name them so, or "
            'say which is which: "outer.y=COLUMN" (--signal).'
        )
    found = {key: file.si(file.column(column), infos[key].unit) for key, column in chosen.items()}
    frequency = [one for one in file.columns if one.name.casefold() == "frequency"]
    axis = "frequency" if frequency and time is None and rate is None else "time"
    t = file.si(frequency[0], "Hz") if axis == "frequency" else file.time(time, rate)
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


def _quantity(what: str, text: str, unit: str) -> float:
    try:
        return parse_quantity(text, unit)
    except QuantityError as error:
        raise RequestError(f"{what}: {error}") from None


def quantities_in(source: Source) -> list[str]:
    """Names of quantities in the rows of a CSV file; none of other files, and of mappings."""
    return [cells[0] for cells in _rows_of_quantities(Path(source))[0]] if isinstance(source, str | Path) else []


def _rows_of_quantities(path: Path) -> tuple[list[list[str]], dict[str, str]]:
    """Rows below a line that begins with ``quantity``, and assignments in comments; none of other files."""
    if path.suffix == ".nc":
        return [], {}
    lines = text_lines(path, path.name)
    for separator in SEPARATORS:
        first = rows_of(lines[:SAMPLE], separator, path.name)[:1]
        if first and first[0][1][0] == "quantity" and len(first[0][1]) > 1:
            said = dict(assigned(line) for line in lines if line.startswith("#") and "=" in line)
            return [cells for _, cells in rows_of(lines, separator, path.name)[1:]], said
    return [], {}


def columns_by_output(signals: str | Sequence[str] | None) -> dict[str, str]:
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
