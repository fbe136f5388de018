"""What a sweep gives: the grid as a dataset, the table, the report, figures, and tables for the terminal."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich import box
from rich.table import Table

from ballpass.runtime.app.commands.ranges import Range
from ballpass.runtime.contract.folders import replace_files

if TYPE_CHECKING:
    import xarray

    from ballpass.runtime.many.ensemble import EnsembleResult

#: Files of a sweep, beside a figure for each quantity.
TABLE, GRID, REPORT = "sweep.csv", "sweep.nc", "sweep.json"


def to_grid(result: EnsembleResult, ranges: Sequence[Range], fixed: Mapping[str, float]) -> xarray.Dataset:
    """The members of an ensemble over a grid, a dimension for each varied parameter; ``status`` is how each ended.

    Parameters
    ----------
    ranges : of the grid, the last one varying fastest
    fixed : values of other parameters that differ from the scene's, by path; they become coordinates without dimension
    """
    import xarray

    flat = result.to_xarray()
    paths = [one.path for one in ranges]
    shape = [len(one.values) for one in ranges]
    status = np.full(math.prod(shape), "DONE", dtype=object)
    for failure in result.failures:
        status[failure.member] = failure.status
    variables = {name: (paths, values.reshape(shape), flat[name].attrs) for name, values in result.observables.items()}
    variables["status"] = (paths, status.reshape(shape), {"long_name": "how the member's run ended"})
    coordinates: dict[str, Any] = {one.path: (one.path, one.values, flat[one.path].attrs) for one in ranges}
    coordinates |= {path: ((), value, flat[path].attrs) for path, value in fixed.items()}
    return xarray.Dataset(variables, coords=coordinates, attrs=flat.attrs)


def report(
    result: EnsembleResult, dataset: xarray.Dataset, ranges: Sequence[Range], fixed: Mapping[str, float]
) -> dict[str, Any]:
    """What ran and what it gave, in SI; members in the order of the table."""
    return {
        "scene": result.manifest.scene,
        "title": result.manifest.title,
        "members": len(result.parameters[ranges[0].path]),
        "varied": [
            {
                "path": one.path,
                "unit": one.unit,
                "spacing": "logarithmic" if one.logarithmic else "linear",
                "values": one.values.tolist(),
            }
            for one in ranges
        ],
        "set": dict(fixed),
        "quantities": {
            name: {
                "unit": dataset[name].attrs["units"],
                "values": [value if math.isfinite(value) else None for value in values.tolist()],
            }
            for name, values in result.observables.items()
        },
        "failures": [
            {
                **asdict(failure),
                "at": {one.path: value for one, value in zip(ranges, _point(ranges, failure.member), strict=True)},
            }
            for failure in result.failures
        ],
        "interrupted": result.interrupted,
        "statistics": asdict(result.statistics),
    }


def write(
    folder: Path,
    result: EnsembleResult,
    dataset: xarray.Dataset,
    told: Mapping[str, Any],
    ranges: Sequence[Range],
    *,
    figures: bool,
) -> list[str]:
    """Write all files, and take figures of an earlier sweep away.  Returns their names."""

    def write_all(made: Path) -> list[str]:
        (made / TABLE).write_text(_table(result, dataset, ranges), encoding="utf-8", newline="")
        (made / GRID).write_bytes(bytes(dataset.to_netcdf(engine="h5netcdf")))
        (made / REPORT).write_text(json.dumps(told, indent=2, allow_nan=False) + "\n", encoding="utf-8")
        if figures and len(ranges) <= 2:
            _draw(result, dataset, ranges, made)
        return sorted(path.name for path in made.iterdir())

    return replace_files(
        folder, write_all, last=REPORT, owned=lambda: [path.name for path in folder.glob("sweep_*.png")]
    )


def _table(result: EnsembleResult, dataset: xarray.Dataset, ranges: Sequence[Range]) -> str:
    """A line for each member, SI; no number where a member has no result."""
    text = io.StringIO()
    lines = csv.writer(text, lineterminator="\n")
    names = list(result.observables)
    quantities = [f"{name} [{dataset[name].attrs['units']}]" for name in names]
    lines.writerow(["member", *(f"{one.path} [{one.unit}]" for one in ranges), *quantities, "status", "message"])
    failures = {failure.member: failure for failure in result.failures}
    for member in range(len(result.parameters[ranges[0].path])):
        values = [float(result[name][member]) for name in names]
        failure = failures.get(member)
        told = ["DONE", ""] if failure is None else [failure.status, failure.message]
        cells = [repr(value) if math.isfinite(value) else "" for value in values]
        lines.writerow([member, *map(repr, _point(ranges, member)), *cells, *told])
    return text.getvalue()


def _draw(result: EnsembleResult, dataset: xarray.Dataset, ranges: Sequence[Range], folder: Path) -> None:
    from ballpass.runtime.app.figures.canvas import save
    from ballpass.runtime.app.figures.sweep import VariedAxis, draw_sweep
    from ballpass.runtime.app.summary import TABLE_UNITS

    axes = [
        VariedAxis(path=one.path, unit=one.shown_unit, values=one.shown, logarithmic=one.logarithmic) for one in ranges
    ]
    text = f"rtol {result.statistics.rtol:g}."
    for name in result.observables:
        values = dataset[name].to_numpy()
        if not np.any(np.isfinite(values)):
            continue
        factor, unit = TABLE_UNITS.get(dataset[name].attrs["units"], (1.0, dataset[name].attrs["units"]))
        figure = draw_sweep(result.manifest.title, axes, name, unit, factor * values, text)
        save(figure, folder / f"sweep_{re.sub(r'[^a-z0-9]+', '_', name)}.png")


def members(dataset: xarray.Dataset, ranges: Sequence[Range]) -> Table:
    """All members, each a row."""
    from ballpass.runtime.app.summary import TABLE_UNITS

    table = Table(title=dataset.attrs["title"], title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for one in ranges:
        table.add_column(_head(one.path, one.shown_unit), justify="right", vertical="bottom")
    names = [name for name in dataset.data_vars if name != "status"]
    columns = []
    for name in names:
        factor, unit = TABLE_UNITS.get(dataset[name].attrs["units"], (1.0, dataset[name].attrs["units"]))
        table.add_column(_head(str(name), unit), justify="right", vertical="bottom")
        columns.append(factor * dataset[name].to_numpy().ravel())
    for member in range(dataset["status"].size):
        cells = [f"{column[member]:.5g}" if math.isfinite(column[member]) else "-" for column in columns]
        table.add_row(*(f"{value:.5g}" for value in _shown(ranges, member)), *cells)
    return table


def extremes(dataset: xarray.Dataset, ranges: Sequence[Range]) -> Table:
    """Smallest and largest value of each quantity, and where."""
    from ballpass.runtime.app.summary import TABLE_UNITS

    table = Table(title=dataset.attrs["title"], title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for head in ("quantity", "", "value", "unit", "at"):
        table.add_column(head, justify="right" if head == "value" else "left")
    for name in dataset.data_vars:
        if name == "status":
            continue
        values = dataset[name].to_numpy().ravel()
        if not np.any(np.isfinite(values)):
            table.add_row(str(name), "", "-", "", "no member has a result")
            continue
        factor, unit = TABLE_UNITS.get(dataset[name].attrs["units"], (1.0, dataset[name].attrs["units"]))
        for which, member in (("min", int(np.nanargmin(values))), ("max", int(np.nanargmax(values)))):
            table.add_row(
                str(name) if which == "min" else "",
                which,
                f"{factor * values[member]:.5g}",
                unit,
                place(ranges, member),
            )
    return table


def _head(name: str, unit: str) -> str:
    """A column's head in a line for each part of the name: numbers are shorter than names."""
    return "\n".join([*re.findall(r"[^._]+[._]?", name), rf"\[{unit}]"])


def _point(ranges: Sequence[Range], member: int) -> list[float]:
    """SI values of a member's varied parameters."""
    places = np.unravel_index(member, [len(one.values) for one in ranges])
    return [float(one.values[k]) for one, k in zip(ranges, places, strict=True)]


def _shown(ranges: Sequence[Range], member: int) -> list[float]:
    """The same in the units of the request."""
    places = np.unravel_index(member, [len(one.values) for one in ranges])
    return [float(one.shown[k]) for one, k in zip(ranges, places, strict=True)]


def place(ranges: Sequence[Range], member: int) -> str:
    """Where a member lies, in words and the units of the request."""
    return ", ".join(
        f"{one.path} = {value:.6g} {one.shown_unit}".removesuffix(" 1")
        for one, value in zip(ranges, _shown(ranges, member), strict=True)
    )
