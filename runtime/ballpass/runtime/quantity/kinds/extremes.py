"""Largest and smallest values of a run: how large, when, and of which ball."""

from __future__ import annotations

import numpy as np

from ballpass.runtime.quantity.extreme_value import ball_of, extreme, rank_change
from ballpass.runtime.quantity.records import Estimate, Kind, Quantity, View

#: Weights of seven values at equal distances h for their first derivative, times h, and their second one, times h^2.
FIRST = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / 60.0
SECOND = np.array([2.0, -27.0, 270.0, -490.0, 270.0, -27.0, 2.0]) / 180.0


def _time(view: View, quantity: Quantity, kind: str) -> Estimate:
    mark = view.marks[quantity.name, kind]
    signal = view.signals[quantity.channel]
    moved, kink = view.nodes.slope[mark.node], ""
    if mark.other is not None and mark.rate != mark.other_rate:
        moved = moved + rank_change(view, quantity, mark)
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
    return Estimate(value=mark.time, slope=moved, time=mark.time, ball=ball_of(view, quantity, mark), kink=kink)


def _peak_ball(view: View, quantity: Quantity) -> Estimate:
    mark = view.marks[quantity.name, "max"]
    ball = ball_of(view, quantity, mark)
    note = "a number that jumps: its derivative is zero between two jumps"
    slope = np.zeros(view.directions)
    return Estimate(value=float(ball or 0), slope=slope, time=mark.time, ball=ball, notes=(note,))


def _range(view: View, quantity: Quantity) -> Estimate:
    top, bottom = extreme(view, quantity, "max"), extreme(view, quantity, "min")
    parts = (("largest", top.kink), ("smallest", bottom.kink))
    return Estimate(
        value=top.value - bottom.value,
        slope=top.slope - bottom.slope,
        notes=top.notes + bottom.notes,
        kink="; ".join(f"of its {word} value, {kink}" for word, kink in parts if kink),
    )


def _value_kind(name: str, size: str, words: str, also: tuple[str, ...] = ()) -> Kind:
    return Kind(
        name=name,
        also=also,
        summary=f"{size} value",
        words=words,
        evaluate=lambda view, quantity: extreme(view, quantity, name),
        extremes=(name,),
        reduced=lambda runs, quantity: runs.entry(name, quantity.channel),
        rows=(name,),
    )


def _time_kind(name: str, of: str, size: str, words: str) -> Kind:
    return Kind(
        name=name,
        summary=f"time of the {size} value",
        words=f"time of the {words}",
        unit="s",
        evaluate=lambda view, quantity: _time(view, quantity, of),
        extremes=(of,),
        around=True,
        reduced=lambda runs, quantity: runs.entry(f"{of}_time", quantity.channel),
        rows=(of,),
    )


KINDS = (
    _value_kind("max", "largest", "highest", also=("peak",)),
    _value_kind("min", "smallest", "lowest"),
    Kind(
        name="range",
        summary="largest less smallest value",
        evaluate=_range,
        extremes=("max", "min"),
        reduced=lambda runs, quantity: runs.entry("max", quantity.channel) - runs.entry("min", quantity.channel),
        rows=("max", "min"),
    ),
    _time_kind("peak_time", "max", "largest", "highest"),
    _time_kind("min_time", "min", "smallest", "lowest"),
    Kind(
        name="peak_ball",
        summary="number of the ball that has the largest value, counted from 1; 0 for what is of no ball",
        words="ball of the highest",
        unit="1",
        evaluate=_peak_ball,
        extremes=("max",),
        reduced=lambda runs, quantity: runs.entry("max_ball", quantity.channel),
        rows=("max",),
    ),
)
