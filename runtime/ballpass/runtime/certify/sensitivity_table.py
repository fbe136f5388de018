"""A report of sensitivities as tables for the terminal.

In: a `SensitivityReport`.  Out: things that rich prints.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich import box
from rich.console import Group
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from ballpass.runtime.certify.certificate import Verdict
from ballpass.runtime.certify.grazing import describe, merge_grazing
from ballpass.runtime.certify.sensitivity_report import Sensitivity, SensitivityReport

#: Grazing places that are listed; the JSON has all.
LISTED = 3

#: Characters of a line where nobody says how wide the paper is.
WIDTH = 110

#: Styles of the verdicts.
_STYLES = {Verdict.VERIFIED: "green", Verdict.DISAGREES: "bold red", Verdict.NOT_CHECKED: "yellow"}


def render_report(report: SensitivityReport, *, top: int | None = None) -> Group:
    """Tables of the report, a quantity each, parameters ranked by the size of the dimensionless derivative.

    Parameters that are zero have none and stand apart, ranked by dQ/dp times a natural change of the parameter.

    Parameters
    ----------
    top : most rows of each section; None for all.  Pairs that disagree are always there
    """
    parts: list[Table | Text] = []
    for quantity in report.quantities:
        table = Table(
            title=_title(report, quantity.name),
            caption="; ".join(quantity.notes) or None,
            title_justify="left",
            caption_justify="left",
            header_style="bold",
            box=box.SIMPLE_HEAD,
            padding=(0, 1, 0, 0),
        )
        table.add_column("parameter", overflow="fold", min_width=20)
        for name in ("p/Q dQ/dp", "dQ/dp"):
            table.add_column(name, justify="right", no_wrap=True)
        table.add_column("unit", overflow="fold", min_width=7)
        table.add_column("apart", justify="right", no_wrap=True)
        table.add_column("verdict", min_width=12)
        ranked = report.of(quantity.name)
        _add_rows(table, [pair for pair in ranked if math.isfinite(pair.dimensionless)], top)
        without = [pair for pair in ranked if not math.isfinite(pair.dimensionless)]
        if without:
            what = "quantity" if quantity.value == 0.0 else "parameter"
            table.add_section()
            table.add_row(f"{what} is 0: no %/%, see dQ/dp", *[""] * 5, style="italic")
            _add_rows(table, without, top)
        parts.append(table)
    parts += [Text.from_markup(line) for line in _remarks(report)]
    return Group(*parts)


def _add_rows(table: Table, ranked: Sequence[Sensitivity], top: int | None) -> None:
    """Rows of one section."""
    shown = [
        pair for rank, pair in enumerate(ranked) if top is None or rank < top or pair.check.verdict is Verdict.DISAGREES
    ]
    for pair in shown:
        table.add_row(*_row(pair))
    if len(shown) < len(ranked):
        table.add_row(f"{len(ranked) - len(shown)} more, smaller", *[""] * 5, style="dim")


def _title(report: SensitivityReport, name: str) -> str:
    quantity = next(item for item in report.quantities if item.name == name)
    words = f"{name} = {quantity.value:.6g} {quantity.unit}"
    if quantity.time is not None:
        words += f" at t = {quantity.time:.6g} s"
    if quantity.ball is not None:
        words += f", ball {quantity.ball}"
    return escape(words)


def _row(pair: Sensitivity) -> tuple[str, ...]:
    check = pair.check
    relative = f"{pair.dimensionless:+.4f}" if math.isfinite(pair.dimensionless) else "–"
    size = max(abs(pair.derivative), abs(check.value or 0.0))
    apart = "-" if check.disagreement is None else f"{check.disagreement / size:.0e}" if size > 0.0 else "0"
    style = _STYLES[check.verdict]
    number, words = f"{pair.derivative:.4g}", check.verdict.value
    if pair.is_nothing:
        # digits that nothing vouches for are not shown
        relative = "~0" if math.isfinite(pair.dimensionless) else relative
        number, apart, words = f"~0 (<{check.quantum:.0e})", "-", f"{words}: ~0"
    elif check.bounded:
        words += f" to ±{check.quantum:.0e}"
    return (escape(pair.parameter), relative, number, escape(pair.unit), apart, f"[{style}]{words}[/]")


def _remarks(report: SensitivityReport) -> list[str]:
    """What stands below the tables."""
    counts = report.verdicts
    words = ", ".join(f"{count} {verdict.value}" for verdict, count in counts.items() if count)
    route = next((pair.check.route for pair in report.pairs if pair.check.route != "none"), None)
    nothing = sum(pair.is_nothing for pair in report.pairs)
    if nothing:
        words += f" ({nothing} of them ~0: both routes below the bound shown, no digit of the derivative is verified)"
    lines = [f"{len(report.pairs)} pairs: {words}" + (f"; apart: relative distance to {route}" if route else "")]
    lines.append("p/Q dQ/dp: % per %; dQ/dp in SI units, angles in radians")
    lines += [
        f"[bold red]disagrees[/]: d({escape(pair.quantity)})/d({escape(pair.parameter)}) is {pair.derivative:.9g}, by "
        f"{pair.check.route} {_number(pair.check.value)} ± {_number(pair.check.uncertainty)} {pair.unit}"
        for pair in report.disagreements
    ]
    tolerance = report.settings["sensitivity_rtol"]
    if tolerance is not None:
        lines.append(f"derivatives at tolerance {tolerance:.0e}, {report.settings['steps']} steps")
    reasons: dict[str, int] = {}
    for pair in report.pairs:
        if pair.check.verdict is Verdict.NOT_CHECKED and pair.check.reason:
            # numbers differ from pair to pair; what may help is the same
            kind = pair.check.reason.split(" by ", 1)[0] + ": " + pair.check.reason.rsplit(": ", 1)[-1]
            kind = pair.check.reason if ": " not in pair.check.reason else kind
            reasons[kind] = reasons.get(kind, 0) + 1
    lines += [f"[yellow]not checked[/], {count} pairs: {escape(reason)}" for reason, count in reasons.items()]
    if report.grazing:
        places = merge_grazing(report.grazing)
        count = f"{len(places)} place{'s' if len(places) > 1 else ''}"
        if len(places) < len(report.grazing):
            count += f" ({len(report.grazing)} counting each ball)"
        more = f"; the first {LISTED} here, --json lists all" if len(places) > LISTED else ""
        lines.append(f"[yellow]grazing[/] at {count}: a small change moves the motion over a kink there{more}")
        lines += [f"  {escape(describe(items))}" for items in places[:LISTED]]
    return lines


def _number(value: float | None) -> str:
    return "no number" if value is None else f"{value:.9g}"
