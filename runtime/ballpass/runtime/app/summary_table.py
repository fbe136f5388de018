"""The main results of a run as a table for the terminal.

In: what `summarize` gave.  Out: tables of a report.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ballpass.runtime.app.summary_words import row_place, row_words, written
from ballpass.runtime.contract.method_registry import NOT_INTEGRATED
from ballpass.runtime.contract.units import table_unit
from ballpass.runtime.quantity.grammar import parse_quantity, quantity_words
from ballpass.runtime.ratings.of_bearing import bearing_words
from ballpass.runtime.report.numbers import rounded
from ballpass.runtime.report.report import ReportTable

if TYPE_CHECKING:
    from ballpass.runtime.contract.manifest import Manifest
    from ballpass.runtime.model import Model
    from ballpass.runtime.solution.accuracy import Accuracy

#: Keys that are columns of the table or left out of it; other keys name parts of a quantity and get rows.
_COLUMNS = ("value", "min", "max", "mean", "rms", "std")

#: What counts as rounding, over the largest number of the same unit [1].
ROUNDING = 1e-13

#: Parts of the table's caption about the run, with their words.
_RUN = {
    "rtol": "relative tolerance {}",
    "steps": "{} steps",
    "located_kinks": "{} kinks located",
    "wall_time": "integrated in {} s",
    "cycle_length": "a turn takes {} s",
    "transient_cycles_dropped": "transient turns left out: {}",
    "steady_cycles": "steady turns: {}",
    "samples": "their samples: {}",
}

#: Those that say nothing where nothing is integrated.
_INTEGRATION = ("rtol", "steps", "wall_time")


def render_summary(summary: Mapping[str, Any], manifest: Manifest, *, every: bool = False) -> tuple[ReportTable, int]:
    """The summary as a table in words, what a reader wants first on top; mean and standard deviation are in the file.

    Rows that are always zero are left out as well.

    Parameters
    ----------
    summary : what `summarize` gave
    every : all rows, with the names by which files and options call them

    Returns
    -------
    the table, and how many rows it leaves out
    """
    columns = ("value", "min", "max", "rms")
    rows: list[tuple[float, tuple[str, ...]]] = []
    left_out = 0
    rounding = _rounding(summary)
    for name, item in summary.items():
        if name in _RUN or not isinstance(item, Mapping) or "unit" not in item:
            continue
        factor, unit = table_unit(item["unit"])
        if name.startswith("point."):  # the size of a machine, not of a clearance
            factor, unit = 1e3, "mm"
        dust = rounding.get(item["unit"], 0.0)
        unit = "" if unit == "1" else unit
        found = {name: tuple(_cell(item, key, factor, dust) for key in columns)}
        for key, value in item.items():
            if key not in _COLUMNS and key != "unit" and not isinstance(value, Mapping):
                # a named part of a quantity, as the peak's elastic one; what is said of it is in the file
                found[f"{name}.{key}"] = (_cell(item, key, factor), "", "", "")
        for row, cells in found.items():
            if not any(cells):
                continue
            place = row_place(manifest, row)
            if not every and (place is None or {*cells} <= {"", "0"}):  # or zero all the time
                left_out += 1
                continue
            order = math.inf if place is None else float(place)
            words = row_words(manifest, row)
            # beside names of two bearings a column of units has no room within 80
            named = f"{words} [{unit}]\n  {row}" if unit else f"{words}\n  {row}"
            rows.append((order, (named, *cells) if every else (words, *cells, unit)))
    rows.sort(key=lambda row: row[0])
    table = ReportTable(
        heads=("", *columns) if every else ("", *columns, "unit"),
        rows=[row for _, row in rows],
        right=columns,
        wrapped=("",),
        caption=_caption(summary, every=every),
    )
    return table, left_out


def _rounding(summary: Mapping[str, Any]) -> dict[str, float]:
    """By unit, what is rounding beside the largest number of the table: forces of 1e-14 N are none."""
    largest: dict[str, float] = {}
    for item in summary.values():
        if isinstance(item, Mapping) and "unit" in item:
            sizes = [abs(item[key]) for key in ("min", "max") if key in item]
            largest[item["unit"]] = max([largest.get(item["unit"], 0.0), *sizes])
    largest["J"] = largest.get("N*m", 0.0)  # the work of a torque
    return {unit: ROUNDING * size for unit, size in largest.items()}


def _cell(item: Mapping[str, Any], key: str, factor: float, dust: float = 0.0) -> str:
    """A number of the table, with a star where more samples may show more; 0 where it is rounding alone."""
    if key not in item:
        return ""
    if abs(item[key]) < dust:
        return "0"
    return written(item, key, factor)


def render_quantities(manifest: Manifest, found: Mapping[str, Mapping[str, Any]]) -> ReportTable:
    """Quantities of ``--of``, as the summary has them."""
    rows = []
    for name, one in found.items():
        factor, unit = table_unit(one["unit"])
        time = "" if one["time"] is None else f"t = {one['time']:.6g} s"
        channel = parse_quantity(manifest, name).channel
        ball = "" if one["ball"] is None else bearing_words(f"ball {one['ball']}", manifest.bearings, channel)
        rows.append((name, f"{factor * one['value']:z.6g}", unit, ", ".join(filter(None, [time, ball]))))
    heads = ("quantity", "value", "unit", "at")
    caption = _quantities_words(manifest, {name: one["value"] for name, one in found.items()})
    return ReportTable(title="Quantities", heads=heads, rows=rows, right=("value",), caption=caption)


def _quantities_words(manifest: Manifest, values: Mapping[str, float]) -> str:
    """What each quantity is, a line each, and why it is no finite number."""
    why = {name: "" for name, value in values.items() if math.isfinite(value)}
    why |= {name: " (nan: the signal stands still)" for name, value in values.items() if math.isnan(value)}
    why |= {name: " (inf: no ball carries a load)" for name, value in values.items() if math.isinf(value)}
    return "\n".join(
        f"{name}: {quantity_words(manifest, parse_quantity(manifest, name))}{why[name]}" for name in values
    )


def render_accuracy(model: Model, accuracy: Accuracy) -> ReportTable:
    """Quantities of ``--error`` with their values and estimated errors."""
    rows = []
    for name in accuracy.of:
        unit = parse_quantity(model.manifest, name).unit
        factor, unit = table_unit(unit)
        value, error = accuracy.values[name], accuracy.estimates[name]
        # no more digits than the error allows
        digits = min(max(math.ceil(-math.log10(max(error, 1e-16))), 1), 9) if math.isfinite(error) else 1
        rows.append((name, f"{factor * value:z.{digits}g}", f"{rounded(100 * error, 2)} %", unit))
    right = ("value", "estimated error")
    return ReportTable(
        title="Extremes between samples included",
        heads=("quantity", *right, "unit"),
        rows=rows,
        right=right,
        caption=_quantities_words(model.manifest, {name: accuracy.values[name] for name in accuracy.of}),
    )


def _caption(summary: Mapping[str, Any], *, every: bool) -> str:
    still = summary["method"] == NOT_INTEGRATED
    told = {key: summary[key]["value"] for key in _RUN if key in summary and not (still and key in _INTEGRATION)}
    run = [  # counts whole, others with four digits
        _RUN[key].format(value if isinstance(value, int) else rounded(value))
        for key, value in told.items()
        if value is not None
    ]
    laws = {key.rpartition(".")[0]: law for key, law in summary.items() if key.rpartition(".")[2] == "damping_law"}
    alike = len(set(laws.values())) == 1
    each = [next(iter(laws.values()))] if alike else [f"{law} in {bearing}" for bearing, law in laws.items()]
    law = [f"damping law {', '.join(each)}"] if laws else []
    tools = [f"{name} {number}" for name, number in summary["versions"]["run_with"].items()]
    searched = [item.get("searched", {}) for item in summary.values() if isinstance(item, Mapping)]
    sampled = ["* of the samples alone"] if any("samples" in found.values() for found in searched) else []
    method = "all follows from the driver's angle: nothing is integrated" if still else summary["method"]
    return f"{', '.join([method, *run, *sampled, *law])}." + (f"\n{', '.join(tools)}." if every else "")
