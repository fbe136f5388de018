"""Kurtosis: the weight of the peaks in a signal.  A damaged raceway raises it before the rms."""

from __future__ import annotations

import math

import numpy as np

from ballpass.runtime.quantity.records import Estimate, Kind, Quantity, View


def _kurtosis(view: View, quantity: Quantity) -> Estimate:
    value, slope = view.channel(quantity)
    mean, moved = view.mean(value, slope)
    # about the mean: with a small vibration on a large offset raw moments lose all digits
    apart, its = value - mean, slope - moved
    squares = apart**2  # products: powers of NumPy other than the second are slow
    square, square_slope = view.mean(squares, 2.0 * apart[:, None] * its)
    fourth, fourth_slope = view.mean(squares**2, 4.0 * (apart * squares)[:, None] * its)
    if not square > np.finfo(float).eps * mean**2:
        return Estimate(value=math.nan, slope=np.full(view.directions, math.nan), notes=("the signal stands still",))
    found = fourth / square**2
    return Estimate(value=found, slope=fourth_slope / square**2 - 2.0 * found * square_slope / square)


KINDS = (
    Kind(
        name="kurtosis",
        summary="fourth moment about the mean over the squared variance: 1.5 of a sine, 3 of noise, more of impacts",
        unit="1",
        evaluate=_kurtosis,
    ),
)
