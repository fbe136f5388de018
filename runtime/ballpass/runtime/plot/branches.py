"""Figures of periodic states: multipliers in the complex plane, branches over a parameter.

In: multipliers, or branches of states.  Out: a figure.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from ballpass.runtime.ask.parameter_range import ParameterRange
from ballpass.runtime.contract.units import table_unit
from ballpass.runtime.motion.continuation import KINDS, SteadyBranch
from ballpass.runtime.plot.style import GREY, INK, MANY, SIGNAL, caption, label, new_figure, styled

#: Markers of the points at which the kind of the states changes.
_MARKERS = dict(zip(KINDS, ("o", "s", "D", "^"), strict=True))


@styled
def draw_multipliers(multipliers: np.ndarray, title: str) -> Figure:
    """Multipliers and the unit circle."""
    figure = new_figure(5.0)
    axes = figure.add_subplot()
    around = np.linspace(0.0, 2.0 * np.pi, 361)
    axes.plot(np.cos(around), np.sin(around), color=GREY, linewidth=1.0)
    axes.plot(multipliers.real, multipliers.imag, "o", color=SIGNAL, markersize=6)
    axes.set_aspect("equal")
    axes.set_xlabel(label("real part", "1"))
    axes.set_ylabel(label("imaginary part", "1"))
    caption(figure, title, "Multipliers of the periodic state. Inside the circle what lies beside it comes back to it.")
    return figure


@styled
def draw_branches(branches: Sequence[SteadyBranch], over: ParameterRange, state: str, state_unit: str) -> Figure:
    """The first state at t = 0 and the largest multiplier over the parameter; unstable states are dashed."""
    figure = new_figure(6.2)
    above, below = figure.subplots(2, 1, sharex=True)
    factor, shown_unit = table_unit(state_unit)
    for branch, look in zip(branches, MANY, strict=False):
        values = np.array([point.value / over.factor for point in branch.points])
        heights = factor * np.array([point.nodes[0, 0] for point in branch.points])
        sizes = np.array([abs(point.multipliers[0]) for point in branch.points])
        stable = np.array([point.stable or bool(point.kind) for point in branch.points])
        colour, words = look["color"], f"period {branch.repeats}"
        for axes, ordinates in ((above, heights), (below, sizes)):
            axes.plot(values, ordinates, color=colour, linestyle=(0, (4, 2)), linewidth=1.0)
            axes.plot(values, np.where(stable, ordinates, np.nan), color=colour, linewidth=1.8, label=words)
        for point in branch.special:
            height, marker = factor * point.nodes[0, 0], _MARKERS[point.kind]
            above.plot(point.value / over.factor, height, marker, color=INK, markersize=5, zorder=5)
        for point in (point for pair in branch.contact_changes for point in pair):
            above.plot(point.value / over.factor, factor * point.nodes[0, 0], "|", color=GREY, markersize=9)
    if any(not (point.stable or point.kind) for branch in branches for point in branch.points):
        above.plot([], [], color=GREY, linestyle=(0, (4, 2)), linewidth=1.0, label="unstable")
    for kind, marker in _MARKERS.items():
        if any(point.kind == kind for branch in branches for point in branch.points):
            above.plot([], [], marker, color=INK, markersize=5, label=kind)
    if any(branch.contact_changes for branch in branches):
        above.plot([], [], "|", color=GREY, markersize=9, label="contacts change")
    below.axhline(1.0, color=GREY, linewidth=1.0)
    above.set_ylabel(label(f"{state} at t = 0", shown_unit))
    below.set_ylabel(label("largest multiplier, magnitude", "1"))
    below.set_xlabel(label(over.words, over.shown_unit))
    above.legend(loc="best")
    caption(figure, "Periodic states", "Solid lines are stable states, dashed ones unstable.")
    return figure
