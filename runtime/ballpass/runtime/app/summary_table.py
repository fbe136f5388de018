"""The numbers people read first as a table for the terminal.

In: what `summarize` gave.  Out: tables of `rich`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from rich.table import Table

from ballpass.runtime.app.summary import TABLE_UNITS
from ballpass.runtime.certify.whole_run import check_observables
from ballpass.runtime.many.ensemble import observable_unit
from ballpass.runtime.run.tables import simple_table

if TYPE_CHECKING:
    from ballpass.runtime.model import Model
    from ballpass.runtime.run.accuracy import Accuracy

#: Keys that are columns of the table or left out of it; other keys name parts of a quantity and get rows.
_COLUMNS = ("value", "min", "max", "mean", "rms", "std")

#: What the table's caption tells of the run, and with which words.
_RUN = {
    "rtol": "rtol {}",
    "steps": "{} steps",
    "located_kinks": "{} kinks located",
    "wall_time": "integrated in {} s",
    "cycle_length": "cycle {} s",
    "transient_cycles_dropped": "{} transient cycles dropped",
    "steady_cycles": "{} steady ones",
    "samples": "{} steady samples",
    "growth": "a start moved by the tolerance changes results by {}",
}


def render_summary(summary: Mapping[str, Any]) -> Table:
    """The summary as a table for a terminal of 80 columns; mean and standard deviation are in the file only.

    Parameters
    ----------
    summary : what `summarize` gave
    """
    columns = ("value", "min", "max", "rms")
    heads = ("quantity", *columns, "unit")
    table = simple_table(f"{summary['title']}: {summary['method']}", heads, right=columns, caption=_caption(summary))
    for name, item in summary.items():
        if name in _RUN or not isinstance(item, Mapping) or "unit" not in item:
            continue
        factor, unit = TABLE_UNITS.get(item["unit"], (1.0, item["unit"]))
        cells = [_cell(item, key, factor) for key in columns]
        if any(cells):
            table.add_row(name, *cells, unit)
        for key, value in item.items():
            if key not in _COLUMNS and key != "unit" and not isinstance(value, Mapping):
                # a named part of a quantity, as the peak's elastic one; what is said of it is in the file
                table.add_row(f"{name}.{key}", _cell(item, key, factor), "", "", "", unit)
    return table


def _cell(item: Mapping[str, Any], key: str, factor: float) -> str:
    """A number of the table, with a star where more samples may show more; where it has no digits, mean and standard
    deviation over the turns."""
    spread = item.get("over_turns", {}).get(key)
    if spread is not None:
        return f"{factor * spread['mean']:z.3g} ± {factor * spread['std']:.1g}"
    if key not in item:
        return ""
    star = "*" if item.get("searched", {}).get(key) == "samples" else ""
    return f"{factor * item[key]:z.4g}{star}"


def render_accuracy(model: Model, accuracy: Accuracy) -> Table:
    """Quantities of ``--error`` with their values and estimated errors, as a table for a terminal."""
    right = ("value", "estimated error")
    table = simple_table("Extremes between samples included", ("quantity", *right, "unit"), right=right)
    for name, found in zip(accuracy.of, check_observables(model, accuracy.of), strict=True):
        unit = observable_unit(model.manifest, *found)
        factor, unit = TABLE_UNITS.get(unit, (1.0, unit))
        table.add_row(name, f"{factor * accuracy.values[name]:z.7g}", f"{100 * accuracy.estimates[name]:.2g} %", unit)
    return table


def _caption(summary: Mapping[str, Any]) -> str:
    run = [
        words.format(f"{summary[key]['value']:.4g}")
        for key, words in _RUN.items()
        if key in summary and summary[key]["value"] is not None
    ]
    laws = ", ".join(
        f"{key.removesuffix('damping_law').replace('.', ' ')}{law}"
        for key, law in summary.items()
        if key == "damping_law" or key.endswith(".damping_law")
    )
    law = [f"damping law {laws}"] if laws else []
    if any("over_turns" in item for item in summary.values() if isinstance(item, Mapping)):
        law.append("± mean and standard deviation over the steady turns")
    tools = [f"{name} {number}" for name, number in summary["versions"]["run_with"].items()]
    searched = [item.get("searched", {}) for item in summary.values() if isinstance(item, Mapping)]
    sampled = ["* of the samples alone"] if any("samples" in found.values() for found in searched) else []
    return f"{', '.join(run + sampled + law)}.\n{', '.join(tools)}."
