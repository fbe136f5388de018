"""The bifurcation diagram: stroboscopic values over a parameter, up and down, above the largest Lyapunov exponent.

In: motions at values of a parameter.  Out: a figure.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from ballpass.runtime.ask.parameter_range import ParameterRange
from ballpass.runtime.contract.units import table_unit
from ballpass.runtime.plot.style import GREY, INK, PALE, SIGNAL, caption, label, new_figure, styled

#: Shades of the kinds of motion; what is periodic has none.
_SHADES = {"chaotic": "#f6d5d9", "quasi-periodic": "#fbeccb", "undecided": PALE}


@styled
def draw_bifurcation(
    vary: ParameterRange, state: str, unit: str, row: int, up: Sequence[Any], down: Sequence[Any]
) -> Figure:
    """Diagram of one state.

    Parameters
    ----------
    vary : the parameter
    state, unit, row : the state that is shown, its unit and place
    up, down : motions in the order in which they were computed
    """
    exponents = up[0].exponent is not None
    figure = new_figure(6.4 if exponents else 4.4)
    panels = figure.subplots(2, 1, sharex=True, height_ratios=(1.7, 1.0)) if exponents else [figure.add_subplot()]
    above = panels[0]
    factor, shown_unit = table_unit(unit)
    # dots of few values stand apart and may be larger: the red ones within the blue ones
    wide = min(max(80.0 / len(up), 1.0), 3.0)
    for motions, colour, size, words in ((up, INK, 4.0 * wide, "up"), (down, SIGNAL, 1.5 * wide, "down")):
        across = np.concatenate([np.full(len(m.states), m.value / vary.factor) for m in motions])
        heights = factor * np.concatenate([m.states[:, row] for m in motions])
        above.plot(across, heights, ".", color=colour, markersize=size, markeredgewidth=0, label=words, rasterized=True)
    above.set_ylabel(label(f"{state}, stroboscopic", shown_unit))
    kinds = _shade(panels, vary, up)
    if exponents:
        below = panels[1]
        for motions, look in ((up, {"color": INK}), (down, {"color": SIGNAL, "linestyle": (0, (5, 2))})):
            across = np.array([m.value / vary.factor for m in motions])
            mean = np.array([m.exponent.mean for m in motions])
            half = np.array([m.exponent.half for m in motions])
            below.plot(across, mean, linewidth=1.2, **look)
            below.fill_between(across, mean - half, mean + half, color=look["color"], alpha=0.25, linewidth=0)
        below.axhline(0.0, color=GREY, linewidth=1.0)
        below.set_ylabel(label("largest exponent per reading", "1"))
    panels[-1].set_xlabel(label(vary.words, vary.shown_unit))
    panels[-1].margins(x=0.01)
    handles, labels = above.get_legend_handles_labels()
    patches = [Patch(color=_SHADES[kind], label=kind) for kind in kinds]
    figure.legend([*handles, *patches], [*labels, *kinds], loc="outside upper right", ncols=5, markerscale=3.0 / wide)
    caption(
        figure,
        "Bifurcation diagram",
        "Each value begins where the motion at the value before ended. Bands are 95 % intervals of the exponent by "
        "batch means; shades are the kinds of motion on the way up.",
    )
    return figure


def _shade(panels: Sequence[Any], vary: ParameterRange, up: Sequence[Any]) -> list[str]:
    """Shade where motions are not periodic; the kinds that there are."""
    values = np.array([m.value / vary.factor for m in up])
    edges = np.concatenate([[values[0]], 0.5 * (values[1:] + values[:-1]), [values[-1]]])
    for motion, left, right in zip(up, edges[:-1], edges[1:], strict=True):
        if motion.kind in _SHADES:
            for axes in panels:
                axes.axvspan(left, right, color=_SHADES[motion.kind], linewidth=0, zorder=0)
    return [kind for kind in _SHADES if any(m.kind == kind for m in up)]
