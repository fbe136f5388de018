"""Figures of a sweep: a quantity over one varied parameter as a line, over two as a map.

In: values on a grid of parameters.  Out: a figure.  The colours of a map grow in luminance with the value, and contours
carry numbers, so that it survives a greyscale print.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patheffects import AbstractPathEffect, withStroke
from matplotlib.ticker import MaxNLocator, StrMethodFormatter

from ballpass.runtime.ask.parameter_range import ParameterRange
from ballpass.runtime.plot.style import GREY, INK, PALE, SAND, SIGNAL, caption, label, log_ticks, new_figure, styled

#: From dark to light, with equal steps of luminance: places are those of the palette's own luminances.
LUMINANCE = LinearSegmentedColormap.from_list("luminance", [(0.0, INK), (0.43, SIGNAL), (0.82, SAND), (1.0, PALE)])

#: Contours of a map, at most.
CONTOURS = 7

#: Smallest change that is drawn as a change, relative to the largest value [1].
FLAT = 1e-12


@styled
def draw_sweep(
    title: str, axes: Sequence[ParameterRange], quantity: str, words: str, unit: str, values: np.ndarray, text: str
) -> Figure:
    """Figure of one quantity.

    Parameters
    ----------
    title : of the scene
    quantity, words : its name and description
    axes : one or two varied parameters
    values : of the quantity, some of them finite, shape (points,) or (points of the first, points of the second), NaN
        where there is none [`unit`]
    text : further text of the caption
    """
    figure = new_figure(4.4 if len(axes) == 1 else 5.0)
    panel = figure.add_subplot()
    if len(axes) == 1:
        _line(panel, axes[0], values)
        panel.set_ylabel(label(words, unit))
    else:
        mesh = _map(panel, axes[0], axes[1], values)
        figure.colorbar(mesh, ax=panel, label=label(words, unit), format=StrMethodFormatter("{x:g}"))
    missing = int(np.count_nonzero(~np.isfinite(values)))
    lost = f" Crosses mark {missing} of {values.size} without a result." if missing else ""
    varied = " and ".join(one.name for one in axes)
    caption(figure, f"{title}: {quantity}", f"{values.size} parameter sets over {varied}. {text}{lost}")
    return figure


def _line(panel: Axes, varied: ParameterRange, values: np.ndarray) -> None:
    panel.plot(varied.shown, values, color=INK, marker="o", markersize=4, linewidth=1.4)
    missing = ~np.isfinite(values)
    places = varied.shown[missing]
    panel.plot(places, np.full(places.size, 0.02), "x", transform=panel.get_xaxis_transform(), color=SIGNAL)
    scale_axis(panel, "x", varied)


def _map(panel: Axes, first: ParameterRange, second: ParameterRange, values: np.ndarray) -> Any:
    """The first parameter along x, the second along y."""
    shown = np.ma.masked_invalid(values.T)
    mesh = panel.pcolormesh(cell_edges(first), cell_edges(second), shown, cmap=LUMINANCE, rasterized=True)
    low, high = float(shown.min()), float(shown.max())
    if high - low > FLAT * max(abs(low), abs(high)) and min(shown.shape) > 1:
        levels = [level for level in MaxNLocator(CONTOURS).tick_values(low, high) if low < level < high]
        halo: list[AbstractPathEffect] = [withStroke(linewidth=2.4, foreground=PALE)]
        lines = panel.contour(first.shown, second.shown, shown, levels=levels, colors="black", linewidths=0.8)
        lines.set_path_effects(halo)
        for label in panel.clabel(lines, fmt="%g", fontsize=8):
            label.set_path_effects(halo)
    across, up = np.meshgrid(first.shown, second.shown)
    missing = np.ma.getmaskarray(shown)
    panel.plot(across[missing], up[missing], linestyle="none", marker="x", color=GREY)
    panel.grid(visible=False)
    scale_axis(panel, "x", first)
    scale_axis(panel, "y", second)
    return mesh


def cell_edges(varied: ParameterRange) -> np.ndarray:
    """Borders of the cells around the values, shape (points + 1,)."""
    centres = np.log(varied.shown) if varied.logarithmic else varied.shown
    middle = 0.5 * (centres[1:] + centres[:-1])
    edges = np.concatenate([[2.0 * centres[0] - middle[0]], middle, [2.0 * centres[-1] - middle[-1]]])
    return np.exp(edges) if varied.logarithmic else edges


def scale_axis(panel: Axes, axis: str, varied: ParameterRange) -> None:
    """Label and scale of an axis along which a parameter varies."""
    panel.set(**{f"{axis}label": label(varied.words, varied.shown_unit)})
    if not varied.logarithmic:
        return
    panel.set(**{f"{axis}scale": "log"})
    log_ticks(panel.xaxis if axis == "x" else panel.yaxis)
