"""``ballpass sweep``: a quantity over a grid of parameters, all members of the grid in lanes and threads.

In: a scene, ranges of some of its numbers, names of observables.  Out: a table (CSV), the grid (NetCDF), figures, and
what ran (JSON).
"""

from __future__ import annotations

import csv
import io
import json
import math
import os
import re
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich import box
from rich.console import Console
from rich.table import Table

from ballpass.runtime.app.commands.options import (
    Cycles,
    Duration,
    Figures,
    Json,
    ResultsFolder,
    SceneFile,
    Settings,
    Tolerance,
    Transient,
)
from ballpass.runtime.app.commands.ranges import Range, grid, read_ranges
from ballpass.runtime.app.commands.shared import (
    Stages,
    check_folder,
    checked_kinks,
    complain,
    faults_of,
    faults_of_turns,
    load_model,
    note,
    read_duration,
    read_with_settings,
    reported,
    warn,
    warnings_shown,
)
from ballpass.runtime.app.entry import INTERRUPTED
from ballpass.runtime.contract.errors import RequestError

if TYPE_CHECKING:
    import xarray

    from ballpass.derive import Scene
    from ballpass.runtime.many.ensemble import EnsembleResult

#: Files of a sweep, beside a figure for each quantity.
TABLE, GRID, REPORT = "sweep.csv", "sweep.nc", "sweep.json"

#: Members that the terminal shows one by one; of more, the extremes.
ROWS = 24

#: Failures that the terminal names; all are in the files.
NAMED = 5


def sweep(
    scene: SceneFile,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PATH=A:B:N",
            help='N values of a number of the scene from A to B: --vary bearing.clearance="5 um:40 um:8". '
            "With :log behind N they are spaced by a factor. May be repeated: all combinations run.",
        ),
    ] = None,
    of: Annotated[
        list[str] | None,
        typer.Option(
            metavar="Q",
            help="Quantity: peak_ball_force (or max:ball.force), rms:inner.y, range:inner.x, mean:, min:, end: ... May "
            "be repeated. Peak ball force and motion of the inner ring if none is given.",
        ),
    ] = None,
    set_: Settings = None,
    cycles: Cycles = None,
    duration: Duration = None,
    transient: Transient = None,
    rtol: Tolerance = None,
    method: Annotated[
        str | None, typer.Option(metavar="NAME", help="auto, or a stepper's name as in ballpass run.")
    ] = None,
    kinks: Annotated[
        str | None,
        typer.Option(
            metavar="HOW",
            help="What steps do where a law has a kink or jump: stepped-over, in lanes, or located, one member at a "
            "time. If not given, as in ballpass run: located at tight tolerances.",
        ),
    ] = None,
    threads: Annotated[
        int | None, typer.Option(metavar="N", help="Threads; as many as processors if not given.")
    ] = None,
    out: ResultsFolder = None,
    json_: Json = False,
    figures: Figures = True,
) -> None:
    """Run a scene for all values of one or more of its numbers; write table, grid and figures.

    A member that fails is named and has no number in its place; the others are kept. Exit code 1 where all fail.
    """
    from ballpass.runtime.certify.prepared import default_observables

    with reported(), warnings_shown(), Stages() as stages:
        stages("read")
        seconds = read_duration(duration, cycles)
        _check_request(cycles, transient, rtol, threads)
        read, asked, overrides = read_with_settings(scene, set_ or [], seconds, transient)
        ranges = read_ranges(asked, vary or [], overrides)
        _check_scene(asked)
        at_kinks = checked_kinks(kinks, method or read.run.method)
        folder = out if out is not None else Path("results") / read.name
        check_folder(folder)
        with faults_of(scene):
            model = load_model(read, stages, method or read.run.method, at_kinks, rtol, overrides=overrides)
            _ = model.ensemble_driver  # compiled here, where it is announced

        varied = grid(ranges)
        count = math.prod(len(one.values) for one in ranges)
        fixed = {path: np.full(count, value) for path, value in overrides.items()}
        stages("simulate")
        result = model.simulate_many(
            {**varied, **fixed},
            of or default_observables(model),
            cycles=cycles,
            duration=seconds,
            transient=transient,
            rtol=rtol,
            method=method,
            kinks=at_kinks,
            threads=threads,
            progress=stages.fraction,
        )
        refused = [failure for failure in result.failures if failure.status == "REFUSED"]
        if len(refused) == count:
            raise RequestError(f"--vary: none of the {count} members can be simulated. The first: {refused[0].message}")
        stages("write")
        dataset = to_grid(result, ranges, overrides)
        report = _report(result, dataset, ranges, overrides)
        files = _write(folder, result, dataset, report, ranges, figures=figures)
    if figures and len(ranges) > 2:
        note(f"no figure: a figure shows one or two varied parameters, and {len(ranges)} vary. Numbers are in {TABLE}.")
    if json_:
        typer.echo(json.dumps(report, indent=2, allow_nan=False))
    else:
        console = Console(emoji=False)
        console.print(_members(dataset, ranges) if count <= ROWS else _extremes(dataset, ranges))
        told = f"{count} members, {len(result.failures)} without results. In {folder}: {_listed(files)}"
        console.print(told, highlight=False, soft_wrap=True, markup=False)
    for failure in result.failures[:NAMED]:
        warn(f"{_place(ranges, failure.member)}: {failure.status}: {failure.message}")
    if len(result.failures) > NAMED:
        warn(f"and {len(result.failures) - NAMED} more members without results; {TABLE} names all.")
    if result.interrupted:
        complain(INTERRUPTED)
        raise typer.Exit(130)
    if len(result.failures) == count:
        complain(f"none of the {count} members has results: {result.failures[0].message}")
        raise typer.Exit(1)


def _listed(files: Sequence[str]) -> str:
    figures = sum(name.endswith(".png") for name in files)
    told = [name for name in files if not name.endswith(".png")]
    return ", ".join(told + ([f"{figures} figure{'s' if figures > 1 else ''}"] if figures else []))


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


def _check_request(cycles: float | None, transient: float | None, rtol: float | None, threads: int | None) -> None:
    """Refuse what no ensemble can follow, before anything is derived or written."""
    from ballpass.runtime.run.request import tolerance

    faults = faults_of_turns(cycles, transient)
    if threads is not None and threads < 1:
        faults.append(f"--threads: {threads} threads cannot work. Allowed: a whole number from 1 on, or leave it away.")
    if faults:
        raise RequestError("\n".join(faults))
    if rtol is not None:
        tolerance("--rtol", rtol)


def _check_scene(scene: Scene) -> None:
    if scene.bearing is None:
        raise RequestError(
            "This scene has no bearing: nothing is integrated, and there are no quantities of an ensemble. Add a "
            "[bearing], or loop over `Model.simulate` in Python."
        )


def _report(
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


def _write(
    folder: Path,
    result: EnsembleResult,
    dataset: xarray.Dataset,
    report: Mapping[str, Any],
    ranges: Sequence[Range],
    *,
    figures: bool,
) -> list[str]:
    """Write all files beside, then put them in place; figures of an earlier sweep go.  Returns their names."""
    folder.mkdir(parents=True, exist_ok=True)
    made = Path(tempfile.mkdtemp(prefix=".sweep-", dir=folder))
    try:
        (made / TABLE).write_text(_table(result, dataset, ranges), encoding="utf-8", newline="")
        (made / GRID).write_bytes(bytes(dataset.to_netcdf(engine="h5netcdf")))
        (made / REPORT).write_text(json.dumps(report, indent=2, allow_nan=False) + "\n", encoding="utf-8")
        if figures and len(ranges) <= 2:
            _draw(result, dataset, ranges, made)
        names = sorted(path.name for path in made.iterdir())
        for old in sorted(folder.glob("sweep_*.png")):
            old.unlink()
        for name in names:
            os.replace(made / name, folder / name)
    finally:
        shutil.rmtree(made, ignore_errors=True)
    return names


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


def _members(dataset: xarray.Dataset, ranges: Sequence[Range]) -> Table:
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


def _extremes(dataset: xarray.Dataset, ranges: Sequence[Range]) -> Table:
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
                _place(ranges, member),
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


def _place(ranges: Sequence[Range], member: int) -> str:
    """Where a member lies, in words and the units of the request."""
    return ", ".join(
        f"{one.path} = {value:.6g} {one.shown_unit}".removesuffix(" 1")
        for one, value in zip(ranges, _shown(ranges, member), strict=True)
    )
