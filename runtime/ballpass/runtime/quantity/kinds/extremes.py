"""Largest and smallest values of a run: how large, when, and of which ball.

Their derivatives jump where another peak becomes the largest: where a small change of a parameter does that, a sentence
says so.  A peak of about the same derivative does not count, for example the same peak in another turn.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ballpass.runtime.quantity.cuts import jumps_at
from ballpass.runtime.quantity.records import Array, Estimate, Kind, Mark, Quantity, ReducedRuns, View
from ballpass.runtime.ratings.of_bearing import bearing_words
from ballpass.runtime.time.turning import beside

#: Weights of seven values at equal distances h for their first derivative, times h, and their second one, times h^2.
FIRST = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / 60.0
SECOND = np.array([2.0, -27.0, 270.0, -490.0, 270.0, -27.0, 2.0]) / 180.0

#: A change of a parameter by this share of its value, or of a radian, is a small one [1].
NEAR = 1e-3

#: An extreme of an angle without whole turns that is nearer to where it jumps is there [rad].
AT_JUMP = 1e-5

#: Derivatives (p/Q) dQ/dp that differ by less are one: by this share of the larger one, and by themselves [1].
ALIKE, FLOOR = 0.1, 1e-3


def extreme(view: View, quantity: Quantity, kind: str) -> Estimate:
    """The largest or smallest value: "max" or "min"."""
    mark = view.marks[quantity.name, kind]
    signal = view.signals[quantity.channel]
    slope = signal.slope[mark.node, mark.ball]
    notes = []
    if mark.other is not None and mark.rate != mark.other_rate:
        # two balls carry the same load; the moment moves so that both stay equal
        slope = slope + mark.rate * _rank_change(view, quantity, mark)
        notes.append(_words(view, quantity, f"balls {mark.ball + 1} and {mark.other + 1} change rank there"))
    if mark.at_edge:
        notes.append("at an edge: the moment moves with it")
    jump = jumps_at(quantity.channel)
    if jump is not None and abs(beside(mark.value, jump)) < AT_JUMP:
        notes.append("the angle jumps there by a turn")
        value = mark.value - float(beside(mark.value, jump))
        mark, slope = replace(mark, value=value, competing=()), np.zeros(view.directions)
    # the minimum over the most loaded balls is not an extreme of one ball
    ranked = kind == "min" and signal.value.shape[1] > 1 and quantity.ball is None
    kink = "" if ranked else _competing_peak(view, quantity, mark)
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
    top, bottom = extreme(view, quantity, "max"), extreme(view, quantity, "min")
    parts = (("largest", top.kink), ("smallest", bottom.kink))
    return Estimate(
        value=top.value - bottom.value,
        slope=top.slope - bottom.slope,
        notes=top.notes + bottom.notes,
        kink="; ".join(f"of its {word} value, {kink}" for word, kink in parts if kink),
    )


def _reduced_range(runs: ReducedRuns, quantity: Quantity) -> Array:
    return runs.entry("max", quantity.channel) - runs.entry("min", quantity.channel)


def _competing_peak(view: View, quantity: Quantity, mark: Mark) -> str:
    """The extreme that the smallest change of a parameter puts in place of this one."""
    signal = view.signals[quantity.channel]
    best, slope = signal.value[mark.node, mark.ball], signal.slope[mark.node, mark.ball]
    scales = np.array([_scale(view, name) for name in view.names])
    nearest, words = NEAR, ""
    together = range(signal.value.shape[1] if quantity.ball is None else 0)  # balls that share the load of that moment
    for other in (*(replace(mark, ball=ball) for ball in together if ball != mark.ball), *mark.competing):
        value, its = signal.value[other.node, other.ball], signal.slope[other.node, other.ball]
        apart = np.abs(its - slope) * scales
        least = np.maximum(ALIKE * np.maximum(np.abs(its), np.abs(slope)) * scales, FLOOR * abs(best))
        with np.errstate(divide="ignore", invalid="ignore"):
            change = np.where(apart > least, np.abs(value - best) / apart, np.inf)
        k = int(np.argmin(change)) if change.size else 0
        if change.size and change[k] < nearest:
            nearest = change[k]
            places = [
                _words(
                    view,
                    quantity,
                    f"t = {one.time:.6g} s{f', ball {one.ball + 1}' if signal.value.shape[1] > 1 else ''}",
                )
                for one in (other, mark)
            ]
            words = (
                f"a change of {view.names[k]} by {nearest * scales[k]:.2g} puts the extreme at {places[0]} in place of "
                f"that at {places[1]}, and makes the derivative {its[k]:.4g} instead of {slope[k]:.4g}"
            )
    return words


def _words(view: View, quantity: Quantity, text: str) -> str:
    return bearing_words(text, view.manifest.bearings, quantity.channel)


def _scale(view: View, name: str) -> float:
    """Scale of a change of a parameter: its value; of an angle a radian."""
    unit = next(info.unit for info in view.manifest.parameters if info.name == name)
    return 1.0 if unit == "rad" else abs(view.numbers.parameters[name])


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
        reduced=_reduced_range,
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
