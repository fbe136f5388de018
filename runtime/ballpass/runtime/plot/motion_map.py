"""The map of motions: kinds over the plane of two parameters, and the largest Lyapunov exponent.

In: kinds and exponents on a grid.  Out: a figure.  Colours of kinds differ in luminance, and those of exponents grow in
it, so that the map survives a greyscale print.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from ballpass.runtime.ask.parameter_range import ParameterRange
from ballpass.runtime.motion.map_points import NONE
from ballpass.runtime.plot.style import GREY, INK, caption, label, new_figure, styled
from ballpass.runtime.plot.sweep import LUMINANCE, cell_edges, scale_axis

#: Colours of the kinds, from light to dark by equal steps: CIE L* 97, 83, 68, 53, 37, 22; what has no kind is hatched.
COLOURS = {
    "periodic 1": "#f4f6f8",
    "periodic 2": "#f5c975",
    "periodic 3": "#7bb19e",
    "periodic 4 and more": "#4a8690",
    "quasi-periodic": "#a32638",
    "chaotic": INK,
}

#: Figures that are less wide have their panels below each other [inch].
NARROW = 6.0
#: Smallest end of the colours beside zero, in shares of the largest exponent [1].
TINY = 1e-3


@styled
def draw_map(vary: Sequence[ParameterRange], kinds: np.ndarray, exponent: np.ndarray | None) -> Figure:
    """Map of kinds, and of exponents where there are any.

    Parameters
    ----------
    vary : parameters along x and y
    kinds : shape (first, second)
    exponent : largest, NaN where it is not known, shape (first, second) [1]; None: none was asked for
    """
    figure = new_figure(4.6 if exponent is not None else 5.4)
    shape = (1, 1 if exponent is None else 2)
    if exponent is not None and figure.get_figwidth() < NARROW:
        shape = (2, 1)
        figure.set_figheight(1.8 * figure.get_figheight())
    panels: list[Axes] = list(np.ravel([figure.subplots(*shape, sharex=True, sharey=True)]))
    named = list(COLOURS)
    places = {kind: named.index(kind) for kind in named} | {"undecided": np.nan, NONE: np.nan}
    codes = np.array([places.get(kind, named.index("periodic 4 and more")) for kind in kinds.ravel().tolist()])
    codes = codes.reshape(kinds.shape)
    edges = [cell_edges(one) for one in vary]
    panels[0].set_facecolor("white")
    panels[0].patch.set(hatch="xxx", edgecolor=GREY)
    colours, shown = ListedColormap(list(COLOURS.values())), np.ma.masked_invalid(codes.T)
    panels[0].pcolormesh(*edges, shown, cmap=colours, vmin=-0.5, vmax=len(named) - 0.5, rasterized=True)
    handles: list[Any] = [
        Patch(facecolor=COLOURS[kind], edgecolor=GREY, label=kind) for k, kind in enumerate(named) if np.any(codes == k)
    ]
    if np.any(np.isnan(codes)):
        handles.append(Patch(facecolor="white", edgecolor=GREY, hatch="xxx", label="undecided, or no motion"))
    if exponent is not None and np.any(np.isfinite(exponent)):
        shown = np.ma.masked_invalid(exponent.T)
        size = float(np.max(np.abs(shown)))
        span = TwoSlopeNorm(0.0, min(float(shown.min()), -TINY * size), max(float(shown.max()), TINY * size))
        mesh = panels[1].pcolormesh(*edges, shown, cmap=LUMINANCE, norm=span, rasterized=True)
        if shown.min() < 0.0 < shown.max() and min(shown.shape) > 1:
            panels[1].contour(vary[0].shown, vary[1].shown, shown, levels=[0.0], colors="black", linewidths=0.7)
        figure.colorbar(mesh, ax=panels[1], label=label("largest exponent per reading", "1"))
    for panel in panels:
        panel.grid(visible=False)
        scale_axis(panel, "x", vary[0])
        scale_axis(panel, "y", vary[1])
        panel.label_outer()
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    caption(
        figure,
        "Kinds of motion",
        f"{kinds.size} points, each from the scene's start."
        + (
            ""
            if exponent is None
            else " The line is where the largest exponent is zero; it is white where it is unknown."
        ),
    )
    return figure
