"""A measured signal, the fitted model, and what is left: differences, and their correlation.

In: samples.  Out: a figure.
"""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from ballpass.runtime.contract.units import table_unit
from ballpass.runtime.plot.style import FIRST, GREY, INK, SIGNAL, caption, label, new_figure, styled

#: Lags of the correlation that are shown.
LAGS = 60


@styled
def draw_residuals(
    name: str, unit: str, axis: str, noise: float, t: np.ndarray, measured: np.ndarray, model: np.ndarray
) -> Figure:
    """Signal above, differences over noise below, their correlation at the right.

    Parameters
    ----------
    axis : "time", "frequency", or "quantity" for values of their own
    noise : deviation of the differences
    """
    figure = new_figure(5.2)
    panels = figure.subplot_mosaic([["signal", "signal"], ["left", "correlation"]], width_ratios=(2.0, 1.0))
    above, below, beside = panels["signal"], panels["left"], panels["correlation"]
    along = {"time": label("time", "s"), "frequency": label("frequency", "Hz"), "quantity": "number of the quantity"}[
        axis
    ]
    dot = 2.0 if axis == "time" else 6.0
    factor, shown = table_unit(unit)
    above.plot(t, factor * measured, ".", color=GREY, markersize=dot, label="measured", rasterized=True)
    line = {"linewidth": 0.9} if axis != "quantity" else {"linestyle": "none", "marker": "x"}
    above.plot(t, factor * model, **{**FIRST, **line}, label="model")
    above.set_xlabel(along)
    above.set_ylabel(label(name, shown))
    above.legend(loc="upper right")
    left = (model - measured) / noise
    below.plot(t, left, ".", color=INK, markersize=dot, rasterized=True)
    for level, words in ((-1.96, None), (1.96, "95 % of white noise")):
        below.axhline(level, color=SIGNAL, linewidth=1.0, linestyle=(0, (5, 2)), label=words)
    below.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)
    below.set_xlabel(along)
    below.set_ylabel("difference over noise")
    away = left - np.mean(left)
    lags = min(LAGS, len(away) - 1)
    found = [np.sum(away[lag:] * away[: len(away) - lag]) / np.sum(away**2) for lag in range(1, lags + 1)]
    beside.vlines(np.arange(1, lags + 1), 0.0, found, color=INK, linewidth=1.2)
    edge = 1.96 / np.sqrt(len(away))
    beside.axhspan(-edge, edge, color=SIGNAL, alpha=0.2, linewidth=0)
    largest = max(0.2, 1.1 * float(np.max(np.abs(found))))
    beside.set_ylim(-largest, largest)
    beside.set_xlabel("lag, samples")
    beside.set_ylabel("correlation")
    caption(
        figure,
        f"Fit to {name}",
        "Of white noise 95 % of differences lie between the dashed lines, 95 % of correlations in the band.",
    )
    return figure
