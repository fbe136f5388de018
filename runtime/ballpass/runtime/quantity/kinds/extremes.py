"""Largest and smallest values of a run: how large, when, and of which ball."""

from __future__ import annotations

import numpy as np

from ballpass.runtime.quantity.competing_peaks import competing_peak
from ballpass.runtime.quantity.records import Array, Estimate, Kind, Mark, Quantity, ReducedRuns, View

#: Weights of seven values at equal distances h for their first derivative, times h, and their second one, times h^2.
FIRST = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / 60.0
SECOND = np.array([2.0, -27.0, 270.0, -490.0, 270.0, -27.0, 2.0]) / 180.0


def _extreme(view: View, quantity: Quantity, kind: str) -> Estimate:
    mark = view.marks[quantity.name, kind]
    signal = view.signals[quantity.channel]
    slope = signal.slope[mark.node, mark.ball]
    notes = []
    if mark.other is not None and mark.rate != mark.other_rate:
        # two balls carry the same load; the moment moves so that both stay equal
        slope = slope + mark.rate * _rank_change(view, quantity, mark)
        notes.append(f"balls {mark.ball + 1} and {mark.other + 1} change rank there")
    if mark.at_edge:
        notes.append("at an edge: the moment moves with it")
    # the minimum over the most loaded balls is not an extreme of one ball
    ranked = kind == "min" and signal.value.shape[1] > 1 and quantity.ball is None
    kink = "" if ranked else competing_peak(view, quantity, mark)
    ball = _ball(view, quantity, mark)
    return Estimate(value=mark.value, slope=slope, time=mark.time, ball=ball, notes=tuple(notes), kink=kink)


def _ball(view: View, quantity: Quantity, mark: Mark) -> int | None:
    return mark.ball + 1 if view.signals[quantity.channel].value.shape[1] > 1 else None


def _rank_change(view: View, quantity: Quantity, mark: Mark) -> Array:
    """Derivative of the time at which two balls carry the same load, less that of its node, shape (directions,)."""
    slope = view.signals[quantity.channel].slope
    apart = slope[mark.node, mark.ball] - slope[mark.node, mark.other]
    return np.asarray(-apart / (mark.rate - mark.other_rate))


def _time(view: View, quantity: Quantity, kind: str) -> Estimate:
    mark = view.marks[quantity.name, kind]
    signal = view.signals[quantity.channel]
    moved, kink = view.nodes.slope[mark.node], ""
    if mark.other is not None and mark.rate != mark.other_rate:
        moved = moved + _rank_change(view, quantity, mark)
    elif mark.around:
        # the rate is zero there: the time moves by the change of the rate over the curvature
        half = len(mark.around) // 2
        nodes = [*mark.around[:half], mark.node, *mark.around[half:]]
        distance = (view.nodes.t[nodes[-1]] - view.nodes.t[nodes[0]]) / (len(nodes) - 1)
        curvature = float(SECOND @ signal.value[nodes, mark.ball]) / distance**2
        if curvature != 0.0:
            moved = moved - (FIRST @ signal.slope[nodes, mark.ball]) / distance / curvature
    elif not mark.at_edge:
        kink = "the extreme lies at a kink of its channel, whose motion is not followed; the derivative is left out"
        moved = np.full(view.directions, np.nan)
    return Estimate(value=mark.time, slope=moved, time=mark.time, ball=_ball(view, quantity, mark), kink=kink)


def _peak_ball(view: View, quantity: Quantity) -> Estimate:
    mark = view.marks[quantity.name, "max"]
    ball = _ball(view, quantity, mark)
    note = "a number that jumps: its derivative is zero between two jumps"
    slope = np.zeros(view.directions)
    return Estimate(value=float(ball or 0), slope=slope, time=mark.time, ball=ball, notes=(note,))


def _range(view: View, quantity: Quantity) -> Estimate:
    top, bottom = _extreme(view, quantity, "max"), _extreme(view, quantity, "min")
    parts = (("largest", top.kink), ("smallest", bottom.kink))
    return Estimate(
        value=top.value - bottom.value,
        slope=top.slope - bottom.slope,
        notes=top.notes + bottom.notes,
        kink="; ".join(f"of its {word} value, {kink}" for word, kink in parts if kink),
    )


def _reduced_range(runs: ReducedRuns, quantity: Quantity) -> Array:
    return runs.entry("max", quantity.channel) - runs.entry("min", quantity.channel)


KINDS = (
    Kind(
        name="max",
        also=("peak",),
        summary="largest value",
        words="highest",
        evaluate=lambda view, quantity: _extreme(view, quantity, "max"),
        extremes=("max",),
        reduced=lambda runs, quantity: runs.entry("max", quantity.channel),
    ),
    Kind(
        name="min",
        summary="smallest value",
        words="lowest",
        evaluate=lambda view, quantity: _extreme(view, quantity, "min"),
        extremes=("min",),
        reduced=lambda runs, quantity: runs.entry("min", quantity.channel),
    ),
    Kind(
        name="range",
        summary="largest less smallest value",
        evaluate=_range,
        extremes=("max", "min"),
        reduced=_reduced_range,
    ),
    Kind(
        name="peak_time",
        summary="time of the largest value",
        words="time of the highest",
        unit="s",
        evaluate=lambda view, quantity: _time(view, quantity, "max"),
        extremes=("max",),
        around=True,
        reduced=lambda runs, quantity: runs.entry("max_time", quantity.channel),
    ),
    Kind(
        name="min_time",
        summary="time of the smallest value",
        words="time of the lowest",
        unit="s",
        evaluate=lambda view, quantity: _time(view, quantity, "min"),
        extremes=("min",),
        around=True,
        reduced=lambda runs, quantity: runs.entry("min_time", quantity.channel),
    ),
    Kind(
        name="peak_ball",
        summary="number of the ball that has the largest value, counted from 1; 0 for what is of no ball",
        words="ball of the highest",
        unit="1",
        evaluate=_peak_ball,
        extremes=("max",),
        reduced=lambda runs, quantity: runs.entry("max_ball", quantity.channel),
    ),
)
