"""Amplitude of an oscillation at one frequency: a line of the spectrum."""

from __future__ import annotations

import numpy as np

from ballpass.runtime.quantity.location import FREQUENCY, check_frequency, frequency
from ballpass.runtime.quantity.records import Estimate, Kind, Quantity, View

#: A line that is smaller than this share of its channel is rounding [1].
ROUNDING = 8.0 * np.finfo(float).eps


def _amplitude(view: View, quantity: Quantity) -> Estimate:
    value, slope = view.channel(quantity)
    line_frequency, faster = frequency(view, quantity)
    length, longer = view.length
    mean, mean_slope = view.mean(value, slope)
    turning = np.exp(-2j * np.pi * line_frequency * view.nodes.t)
    angle_slope = 2.0 * np.pi * (faster * view.nodes.t[:, None] + line_frequency * view.nodes.slope)
    swing = (value - mean) * turning
    swing_slope = (slope - mean_slope) * turning[:, None] - 1j * swing[:, None] * angle_slope
    sum_, sum_slope = view.nodes.weight @ swing, view.nodes.weight @ swing_slope + swing @ view.nodes.weight_slope
    line, line_slope = 2.0 * sum_ / length, 2.0 * (sum_slope - sum_ * longer / length) / length
    size = abs(line)
    if size <= ROUNDING * float(np.max(np.abs(value))):
        # which way the line grows from there is rounding too
        return view.zero("zero", line_slope)
    return Estimate(value=size, slope=np.real(np.conj(line) * line_slope) / size)


KINDS = (
    Kind(
        name="amplitude",
        summary="amplitude of the oscillation about the mean at one frequency",
        words="amplitude at",
        place=FREQUENCY,
        check=check_frequency,
        frequency=frequency,
        evaluate=_amplitude,
    ),
)
