"""Tornado chart: which parameters move a quantity most.

In: a `SensitivityReport`.  Out: a figure.  Bars are dimensionless derivatives (p/Q) dQ/dp, the largest on top: how many
per cent the quantity changes when the parameter grows by one.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator

from matplotlib.figure import Figure
from matplotlib.patches import Patch

from ballpass.runtime.certify.certificate import Verdict
from ballpass.runtime.certify.grazing import merge_grazing
from ballpass.runtime.certify.sensitivity_report import Sensitivity, SensitivityReport
from ballpass.runtime.plot.style import GREY, INK, PALE, SAND, caption, new_figure, styled, unit_words

#: Bars of a chart.
BARS = 15

#: Below this share of the longest bar a bar cannot be seen.
VISIBLE = 2e-3

#: Hatches show the verdicts without colour.
_LOOKS: dict[Verdict, tuple[str, str, str]] = {
    Verdict.VERIFIED: (INK, "", "verified by the second route"),
    Verdict.NOT_CHECKED: (SAND, "//", "not checked"),
    Verdict.DISAGREES: (PALE, "xx", "the two routes disagree"),
}


@styled
def tornado(report: SensitivityReport, quantity: str) -> Figure:
    """Chart of one quantity of the report, that some parameter moves."""
    found = next(item for item in report.quantities if item.name == quantity)
    pairs = _bars(report, quantity)
    labels = [report.words[pair.parameter] for pair in pairs]
    bars_of = [
        words if labels.count(words) == 1 else f"{words} ({pair.parameter})"
        for words, pair in zip(labels, pairs, strict=True)
    ]
    figure = new_figure(1.8 + 0.36 * len(pairs))
    axes = figure.add_subplot()
    bars = [pair.dimensionless for pair in pairs]
    for row, pair in enumerate(pairs):
        colour, hatch, _ = _LOOKS[pair.check.verdict]
        bar = axes.barh(row, bars[row], height=0.66, color=colour, hatch=hatch, edgecolor="#212529", linewidth=0.6)
        axes.bar_label(bar, [f"{bars[row]:+.3g}".replace("-", "−")], padding=3, fontsize=8.5)
    axes.set_yticks(range(len(pairs)), ["\n".join(textwrap.wrap(words, 40)) for words in bars_of], fontsize=8.5)
    axes.set_ylim(len(pairs) - 0.4, -0.6)
    left, right = min(0.0, *bars), max(0.0, *bars)
    room = 0.14 * (right - left)
    axes.set_xlim(left - (room if left < 0.0 else 0.02 * right), right + (room if right > 0.0 else -0.02 * left))
    axes.axvline(0.0, color=GREY, linewidth=1.0)
    axes.grid(visible=False, axis="y")
    axes.set_xlabel("change of the quantity for a change of the parameter [% per %]")
    present = {pair.check.verdict for pair in pairs}
    looks = [_LOOKS[verdict] for verdict in Verdict if verdict in present]
    handles = [Patch(facecolor=c, hatch=hatch, edgecolor="#212529", label=words) for c, hatch, words in looks]
    axes.legend(handles=handles, loc="lower right" if right >= -left else "lower left")
    zero = sum(not math.isfinite(pair.dimensionless) for pair in report.of(quantity))
    hidden = len(report.parameters) - len(pairs) - zero
    words = f"{report.scene}: {quantity} = {found.value:.5g} {unit_words(found.unit)}; bars are (p/Q) dQ/dp."
    words += f" From the top: {', '.join(pair.parameter for pair in pairs)}."
    if hidden:
        words += f" Left out: {hidden} with smaller or no effect."
    if zero:
        words += f" Parameters of value 0, which have no % per %: {zero}; see the table for them."
    words += " Sensitivities are local: they hold for small changes."
    if report.grazing:
        count = len(merge_grazing(report.grazing))
        words += f" The motion grazes a kink at {count} place{'s' if count > 1 else ''}, where derivatives are fragile."
    about = report.words[quantity]
    caption(figure, "\n".join(textwrap.wrap(f"What moves it: {about[:1].lower()}{about[1:]}", 76)), words)
    return figure


def tornados(report: SensitivityReport) -> Iterator[tuple[str, Figure]]:
    """A chart for each quantity that has bars, by name of its file."""
    for item in report.quantities:
        if _bars(report, item.name):
            plain = "".join(letter if letter.isalnum() else "_" for letter in item.name).strip("_")
            yield f"tornado_{plain}", tornado(report, item.name)


def _bars(report: SensitivityReport, quantity: str) -> list[Sensitivity]:
    """Pairs that are drawn, largest first."""
    pairs = [pair for pair in report.of(quantity) if math.isfinite(pair.dimensionless)]
    longest = max((abs(pair.dimensionless) for pair in pairs), default=0.0)
    return [pair for pair in pairs if longest > 0.0 and abs(pair.dimensionless) > VISIBLE * longest][:BARS]
