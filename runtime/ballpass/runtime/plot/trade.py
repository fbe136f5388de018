"""The figure of a trade: error against time, both logarithmic, and the front that no other choice beats."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ballpass.runtime.certify.trade_report import Measured, Trade
from ballpass.runtime.contract.method_registry import STEPPERS
from ballpass.runtime.plot.style import GREY, INK, PALE, SAND, SIGNAL, caption, log_ticks, new_figure, styled
from ballpass.runtime.request.locating import LOCATED

#: Markers and colours of methods by turns; shapes tell them apart in grey as well, and open ones locate kinks.
_STYLES = tuple(zip("osDp^vP*", (INK, SAND, SIGNAL, INK, GREY, SAND, SIGNAL, GREY), strict=True))

#: Decades the axis is lengthened at most to show where the reference is uncertain.
_DECADES = 4.0


@styled
def draw_trade(trade: Trade, quantity: str | None = None) -> Figure:
    """Error (95 % point over the members) against time a cycle; `quantity` None takes the worst of all."""
    figure = new_figure(5.4)
    axes = figure.add_subplot()
    groups: dict[tuple[str, str], list[Measured]] = {}
    for one in trade.measured:
        if math.isfinite(one.time) and 0.0 < trade.error(one, quantity) < math.inf:
            groups.setdefault((one.way.method, one.way.kinks), []).append(one)
    for (method, kinks), ones in groups.items():
        ones.sort(key=lambda m: -m.way.rtol)
        marker, colour = _STYLES[list(STEPPERS).index(method) % len(_STYLES)]
        located = kinks == LOCATED
        axes.plot(
            *_points(trade, quantity, ones),
            marker=marker,
            markersize=6,
            color=colour,
            markerfacecolor="white" if located else colour,
            markeredgecolor=colour if located else INK,
            linestyle=":",
            linewidth=0.7,
            label=method + (", kinks located" if located else ""),
            zorder=3,
        )
    front: dict[str, Any] = {"color": INK, "linewidth": 5.0, "alpha": 0.18, "solid_capstyle": "round", "zorder": 2}
    axes.plot(*_points(trade, quantity, trade.front(quantity)), label="best of all", **front)
    floor = 100.0 * (max(trade.uncertainty.values()) if quantity is None else trade.uncertainty[quantity])
    shaded = _axes(axes, floor)
    name = "the worst of all quantities" if quantity is None else quantity
    caption(
        figure,
        f"{trade.title}: what accuracy costs",
        f"Relative error of {name}, 95 % point over {trade.members} parameter sets within {100 * trade.spread:g} % of "
        f"the scene's, against the time of the integration, {trade.cycles:g} cycles a run. A line joins the tolerances "
        f"of a method. {'Hatched: below what is known, for the' if shaded else 'The'} reference is uncertain by "
        f"{floor:.1g} %.",
    )
    return figure


def _points(trade: Trade, quantity: str | None, ones: Iterable[Measured]) -> tuple[list[float], list[float]]:
    """Times [ms] and errors [%]."""
    pairs = [(1e3 * one.time, 100.0 * trade.error(one, quantity)) for one in ones]
    return [time for time, _ in pairs], [error for _, error in pairs]


def _axes(axes: Axes, floor: float) -> bool:
    """Scales, ticks and legend; whether the part below the reference's uncertainty [%] is shown."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("time a cycle [ms]")
    axes.set_ylabel("relative error [%]")
    low, high = axes.get_ylim()
    shown = bool(floor > low * 10.0**-_DECADES)
    if shown:
        low = min(low, floor / 10.0)
        axes.axhspan(low, floor, facecolor=PALE, edgecolor=GREY, hatch="///", linewidth=0.0, zorder=0)
    axes.set_ylim(low, min(high, 1e3))
    log_ticks(axes.xaxis)
    log_ticks(axes.yaxis)
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
    return shown
