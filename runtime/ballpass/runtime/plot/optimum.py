"""A search for the least value: the goal at each evaluation.

In: values.  Out: a figure.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from ballpass.runtime.contract.units import table_unit
from ballpass.runtime.plot.style import INK, SIGNAL, caption, label, new_figure, styled


@styled
def draw_trace(goal: str, unit: str, trace: Sequence[float], *, largest: bool) -> Figure:
    """Values in the order of the evaluations, and the best so far."""
    figure = new_figure(4.0)
    axes = figure.add_subplot()
    factor, shown = table_unit(unit)
    trace = [factor * value for value in trace]
    number = np.arange(1, len(trace) + 1)
    axes.plot(number, trace, "o", color=SIGNAL, markersize=4, label="each evaluation")
    most, best = ("largest", np.maximum) if largest else ("least", np.minimum)
    axes.step(number, best.accumulate(trace), where="post", color=INK, linewidth=1.4, label=f"{most} so far")
    axes.set_xlabel(label("evaluation", "1"))
    axes.set_ylabel(label(goal, shown))
    axes.legend()
    caption(figure, f"Search for the {most} {goal}", "Each evaluation is a run with derivatives.")
    return figure
