"""Elementary effects of inputs: size against deviation, the figure of Morris (1991).

In: effects.  Out: a figure.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from ballpass.runtime.contract.units import table_unit
from ballpass.runtime.plot.style import GREY, MANY, caption, label, new_figure, styled
from ballpass.runtime.shares.elementary_effects import ElementaryEffect


@styled
def draw_effects(name: str, unit: str, inputs: Sequence[str], effects: Sequence[ElementaryEffect]) -> Figure:
    """A point for each input, the largest first in the legend, with the interval of its size."""
    figure = new_figure(4.2)
    axes = figure.add_subplot()
    factor, shown = table_unit(unit)
    known = [k for k in range(len(effects)) if np.isfinite(effects[k].size)]
    for place, k in enumerate(sorted(known, key=lambda k: -effects[k].size)):
        one, look = effects[k], MANY[place % len(MANY)]
        axes.hlines(factor * one.deviation, factor * one.size_low, factor * one.size_high, color=GREY, linewidth=1.2)
        axes.plot(factor * one.size, factor * one.deviation, **{**look, "linestyle": "none"}, label=inputs[k])
    most = factor * max([effects[k].size for k in known], default=1.0)
    axes.plot([0.0, most], [0.0, most], color=GREY, linewidth=0.8, linestyle=(0, (5, 2)))
    axes.set_xlim(left=0.0)
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel(label(f"size of the effect on {name}", shown))
    axes.set_ylabel(label("deviation", shown))
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    words = "At the left what matters least; near the dashed line or above it inputs act together or are not linear."
    caption(figure, f"Effects of inputs on {name}", words)
    return figure
