"""Other peaks that become the largest after a small change of a parameter: there the derivative of the maximum jumps.

In: an extreme of a run with derivatives; the next ones, and where no ball is named the other balls at its moment.
Out: a sentence, empty where none is near.

A peak of about the same derivative does not count, for example the same peak in another turn.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ballpass.runtime.quantity.records import Mark, Quantity, View

#: A change of a parameter by this share of its value, or of a radian, is a small one [1].
NEAR = 1e-3

#: Derivatives (p/Q) dQ/dp that differ by less are one: by this share of the larger one, and by themselves [1].
ALIKE, FLOOR = 0.1, 1e-3


def competing_peak(view: View, quantity: Quantity, mark: Mark) -> str:
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
                f"t = {one.time:.6g} s{f', ball {one.ball + 1}' if signal.value.shape[1] > 1 else ''}"
                for one in (other, mark)
            ]
            words = (
                f"a change of {view.names[k]} by {nearest * scales[k]:.2g} puts the extreme at {places[0]} in place of "
                f"that at {places[1]}, and makes the derivative {its[k]:.4g} instead of {slope[k]:.4g}"
            )
    return words


def _scale(view: View, name: str) -> float:
    """Scale of a change of a parameter: its value; of an angle a radian."""
    unit = next(info.unit for info in view.manifest.parameters if info.name == name)
    return 1.0 if unit == "rad" else abs(view.numbers.parameters[name])
