"""The largest or smallest value along a run, with its derivative and what would take its place.

In: the data of a run for a kind of quantity.  Out: an `Estimate` in the channel's unit.

Derivatives of extremes jump where another peak becomes the largest: where a small change of a parameter does that, a
sentence says so.  A peak of about the same derivative does not count, for example the same peak in another turn.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ballpass.runtime.quantity.cuts import jumps_at
from ballpass.runtime.quantity.records import Array, Estimate, Mark, Quantity, View
from ballpass.runtime.ratings.of_bearing import bearing_words
from ballpass.runtime.time.turning import beside

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
        slope = slope + mark.rate * rank_change(view, quantity, mark)
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
    ball = ball_of(view, quantity, mark)
    return Estimate(value=mark.value, slope=slope, time=mark.time, ball=ball, notes=tuple(notes), kink=kink)


def ball_of(view: View, quantity: Quantity, mark: Mark) -> int | None:
    """Number of the ball of a mark, counted from 1; None for a channel without balls."""
    return mark.ball + 1 if view.signals[quantity.channel].value.shape[1] > 1 else None


def rank_change(view: View, quantity: Quantity, mark: Mark) -> Array:
    """Derivative of the time at which two balls carry the same load, less that of its node, shape (directions,)."""
    slope = view.signals[quantity.channel].slope
    apart = slope[mark.node, mark.ball] - slope[mark.node, mark.other]
    return np.asarray(-apart / (mark.rate - mark.other_rate))


def _competing_peak(view: View, quantity: Quantity, mark: Mark) -> str:
    """The extreme that the smallest change of a parameter puts in place of this one."""
    signal = view.signals[quantity.channel]
    best, slope = signal.value[mark.node, mark.ball], signal.slope[mark.node, mark.ball]
    units = {info.name: info.unit for info in view.manifest.parameters}
    # of an angle a radian
    scales = np.array([1.0 if units[name] == "rad" else abs(view.numbers.parameters[name]) for name in view.names])
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
