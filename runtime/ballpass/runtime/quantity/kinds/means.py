"""Means and integrals over time."""

from __future__ import annotations

import math

from ballpass.runtime.native.reduction_rows import moments_of, rms_of
from ballpass.runtime.quantity.records import Array, Estimate, Kind, Quantity, ReducedRuns, View

#: Units of integrals over time that have names.
_OVER_TIME = {"W": "J", "m/s": "m", "m/s^2": "m/s", "rad/s": "rad", "rad/s^2": "rad/s"}


def _mean(view: View, quantity: Quantity) -> Estimate:
    value, slope = view.mean(*view.channel(quantity))
    return Estimate(value=value, slope=slope)


def _integral(view: View, quantity: Quantity) -> Estimate:
    value, slope = view.integral(*view.channel(quantity))
    return Estimate(value=value, slope=slope)


def _rms(view: View, quantity: Quantity) -> Estimate:
    value, slope = view.channel(quantity)
    square, moved = view.mean(value**2, 2.0 * value[:, None] * slope)
    root = math.sqrt(square)
    if root == 0.0:
        return view.zero("zero throughout", slope)
    return Estimate(value=root, slope=moved / (2.0 * root))


def _reduced_mean(runs: ReducedRuns, quantity: Quantity) -> Array:
    return runs.entry("shift", quantity.channel) + runs.entry("integral", quantity.channel) / runs.duration


def _reduced_rms(runs: ReducedRuns, quantity: Quantity) -> Array:
    shift, integral, square = (runs.entry(kind, quantity.channel) for kind in ("shift", "integral", "square"))
    return rms_of(*moments_of(shift, integral, square, runs.duration))


KINDS = (
    Kind(name="mean", summary="mean over time", evaluate=_mean, reduced=_reduced_mean, rows=("integral",)),
    Kind(
        name="integral",
        summary="integral over time; of a power the work",
        unit_of=lambda unit: _OVER_TIME.get(unit, f"{unit}*s"),
        evaluate=_integral,
        reduced=lambda runs, quantity: _reduced_mean(runs, quantity) * runs.duration,
        rows=("integral",),
    ),
    Kind(
        name="rms",
        summary="root mean square over time, with the mean in it",
        evaluate=_rms,
        reduced=_reduced_rms,
        rows=("integral", "square"),
    ),
)
