"""Shares of inputs in the variance of a quantity, beside the quantity's distribution.

In: shares with their intervals, values.  Out: a figure.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from ballpass.runtime.contract.units import table_unit
from ballpass.runtime.plot.style import GREY, INK, SIGNAL, caption, label, new_figure, styled
from ballpass.runtime.shares.variance_shares import VarianceShare


@styled
def draw_shares(
    name: str, unit: str, inputs: Sequence[str], shares: Sequence[VarianceShare], values: np.ndarray
) -> Figure:
    """Bars of total and first-order shares, the largest first; values of the base members as a histogram."""
    figure = new_figure(2.6 + 0.28 * max(len(shares), 3))
    below = figure.subplots(2, 1, height_ratios=(max(len(shares), 1), 3)) if shares else [figure.add_subplot()]
    if shares:
        order = sorted(range(len(shares)), key=lambda k: shares[k].total)
        place = np.arange(len(order))
        for offset, kind, colour in ((0.2, "total", INK), (-0.2, "first", SIGNAL)):
            middle, low, high = (
                np.array([getattr(shares[k], f"{kind}{end}") for k in order]) for end in ("", "_low", "_high")
            )
            words = "total share" if kind == "total" else "first-order share"
            below[0].barh(place + offset, middle, height=0.36, color=colour, label=words)
            below[0].hlines(place + offset, low, high, color=GREY, linewidth=2.0)
        below[0].set_yticks(place, [inputs[k] for k in order])
        below[0].set_xlabel("share in the variance")
        below[0].legend(loc="lower right")
    factor, shown = table_unit(unit)
    known = factor * values[np.isfinite(values)]
    below[-1].hist(known, bins=min(60, max(8, round(np.sqrt(len(known))))), color=INK)
    below[-1].set_xlabel(label(name, shown))
    below[-1].set_ylabel("members")
    caption(figure, f"What makes {name} vary", "Lines are 95 % intervals by bootstrap.")
    return figure
