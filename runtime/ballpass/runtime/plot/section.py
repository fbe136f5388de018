"""Figure of a Poincaré section: velocity over position, and the position over the place of the balls.

In: points, the phase of each, a curve over it.  Out: a figure.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from ballpass.runtime.contract.units import table_unit
from ballpass.runtime.motion.invariant_curve import InvariantCurve
from ballpass.runtime.plot.style import INK, SIGNAL, caption, label, new_figure, styled

#: Points along the curve.
ALONG = 1000


@styled
def draw_section(
    states: np.ndarray,
    phase: np.ndarray,
    around: str,
    names: Sequence[str],
    units: Sequence[str],
    row: int,
    curve: InvariantCurve | None,
    words: str,
) -> Figure:
    """Draw the points, and the curve where they lie on one.

    Parameters
    ----------
    states : points, shape (points, states)
    phase, around : place of the balls, shape (points,), and its unit; "" where it is the same for all points
    names, units, row : of the states, and place of the one that is shown
    curve : None where there is none
    words : below the figure
    """
    figure = new_figure(4.6)
    section, *over = np.ravel([figure.subplots(1, 2 if around else 1)])
    half = len(names) // 2
    # a coordinate is shown over its rate, whichever of the two was named
    place, rate = row % half, row % half + half
    scales = [table_unit(unit) for unit in units]
    factors, shown = np.array([factor for factor, _ in scales]), [unit for _, unit in scales]
    points = {"color": INK, "marker": "o", "markersize": 2.6, "linestyle": "none", "markeredgewidth": 0}
    heights = factors * states
    section.plot(heights[:, place], heights[:, rate], label="points", **points)
    for panel in over:
        panel.plot(phase, heights[:, place], **points)
        panel.set_xlabel(label("place of the rolling elements", around))
        panel.set_ylabel(label(names[place], shown[place]))
    if curve is not None:
        along = np.linspace(0.0, 1.0, ALONG)
        heights = factors * curve(along)
        look = {"color": SIGNAL, "linewidth": 0.9, "zorder": 1}
        section.plot(heights[:, place], heights[:, rate], label="curve that was fitted", **look)
        over[0].plot(along, heights[:, place], **look)
    section.locator_params("x", nbins=5)
    section.set_xlabel(label(names[place], shown[place]))
    section.set_ylabel(label(names[rate], shown[rate]))
    figure.legend(*section.get_legend_handles_labels(), loc="outside upper right", ncols=2)
    caption(figure, "Poincaré section", words)
    return figure
