"""Observables of a run: turns, statistics, stroboscopic points, orbit.

In: plain numpy arrays in SI.  Out: numbers, arrays and small frozen records in SI.  Spectra are in `spectrum`.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ballpass.runtime.contract.errors import RequestError

Array = NDArray[np.float64]

#: Part of a turn by which the ends of a record may miss a turn's ends: rounding of times, far below a sample.
_TURN_TOLERANCE = 1e-9


def turns(t: ArrayLike, cycle_length: float) -> tuple[slice, ...]:
    """Whole turns of a record, the last one ending at the record's end.

    Each slice holds both end samples of its turn, so that neighbours share one; where a turn is not a whole number of
    steps, its ends are the samples next to it.

    Parameters
    ----------
    t : (n,) increasing times [s]
    cycle_length : length of a turn [s]

    Returns
    -------
    slices of t, oldest first; empty for a record shorter than a turn
    """
    time = _increasing(t)
    _positive(cycle_length, "cycle_length", "s")
    count = int(np.floor((time[-1] - time[0]) / cycle_length + _TURN_TOLERANCE))
    ends = time[-1] - cycle_length * np.arange(count, -1, -1)
    index = [int(np.argmin(np.abs(time - end))) for end in ends]
    return tuple(slice(first, last + 1) for first, last in pairwise(index))


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalStatistics:
    """Extremes of the samples, and means over time, of one signal [unit of the signal].

    Attributes
    ----------
    minimum, maximum : of the samples; a spike between two samples is missed
    mean : over time
    rms : plain root mean square, with the mean in it
    std : root mean square of the deviation from the mean
    """

    minimum: float
    maximum: float
    mean: float
    rms: float
    std: float


def statistics(t: ArrayLike, signal: ArrayLike) -> SignalStatistics:
    """Statistics of a signal, means by the trapezoidal rule.

    On a whole number of cycles the rule counts the end that repeats the start once.

    Parameters
    ----------
    t : (n,) increasing times [s]
    signal : (n,) samples [any unit]

    Raises
    ------
    RequestError
        Shapes differ, or times do not increase.
    """
    time = _increasing(t)
    values = _like(time, signal, "signal")
    length = time[-1] - time[0]
    mean = float(np.trapezoid(values, time) / length)
    return SignalStatistics(
        minimum=float(np.min(values)),
        maximum=float(np.max(values)),
        mean=mean,
        rms=float(np.sqrt(np.trapezoid(values**2, time) / length)),
        std=float(np.sqrt(np.trapezoid((values - mean) ** 2, time) / length)),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class StroboscopicPoints:
    """State once per turn: times [s], positions [m] and velocities [m/s], each (k,)."""

    time: Array
    position: Array
    velocity: Array


def stroboscopic_points(
    t: ArrayLike, position: ArrayLike, velocity: ArrayLike, *, cycle_length: float, offset: float = 0.0
) -> StroboscopicPoints:
    """Stroboscopic (Poincaré) points: the state at the times ``offset + k * cycle_length`` inside the record.

    Between samples the position is the cubic with the given positions and velocities at both ends (Hermite), and the
    velocity is its derivative; at a sample both are the sample.

    Parameters
    ----------
    t : (n,) increasing times [s]
    position, velocity : (n,) samples [m], [m/s]
    cycle_length : time between two points [s]
    offset : shift of the first point against t = 0 [s]

    Raises
    ------
    RequestError
        Shapes differ, times do not increase, or the cycle length is not positive.
    """
    time = _increasing(t)
    x, v = _like(time, position, "position"), _like(time, velocity, "velocity")
    _positive(cycle_length, "cycle_length", "s")
    first = int(np.ceil((time[0] - offset) / cycle_length - _TURN_TOLERANCE))
    last = int(np.floor((time[-1] - offset) / cycle_length + _TURN_TOLERANCE))
    at = np.clip(offset + cycle_length * np.arange(first, last + 1), time[0], time[-1])
    place, speed = hermite(time, x, v, at)
    return StroboscopicPoints(time=at, position=place, velocity=speed)


def hermite(
    t: NDArray[np.float64], x: NDArray[np.float64], v: NDArray[np.float64], at: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Values and slopes of the cubic between samples with slopes, at times within them (n,)."""
    k = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 2)
    step = t[k + 1] - t[k]
    s = (at - t[k]) / step
    chord = (x[k + 1] - x[k]) / step
    bend, twist = 3.0 * chord - 2.0 * v[k] - v[k + 1], v[k] + v[k + 1] - 2.0 * chord
    value = x[k] + step * s * (v[k] + s * (bend + s * twist))
    return value, v[k] + s * (2.0 * bend + 3.0 * s * twist)


@dataclass(frozen=True, slots=True, kw_only=True)
class Orbit:
    """Path of a ring centre in one turn.

    Attributes
    ----------
    time, x, y : (n,) [s], [m], [m]
    gap : distance between its two ends [m]; zero for a motion that repeats each turn
    """

    time: Array
    x: Array
    y: Array
    gap: float


def orbits(t: ArrayLike, x: ArrayLike, y: ArrayLike, *, cycle_length: float) -> tuple[Orbit, ...]:
    """Path of a ring centre, turn by turn, oldest first.

    Parameters
    ----------
    t : (n,) increasing times [s]
    x, y : (n,) coordinates of the centre [m]
    cycle_length : length of a turn [s]
    """
    time = _increasing(t)
    across, up = _like(time, x, "x"), _like(time, y, "y")
    return tuple(
        Orbit(
            time=time[turn],
            x=across[turn],
            y=up[turn],
            gap=float(np.hypot(across[turn][-1] - across[turn][0], up[turn][-1] - up[turn][0])),
        )
        for turn in turns(time, cycle_length)
    )


def _increasing(t: ArrayLike) -> Array:
    time = np.asarray(t, dtype=float)
    if time.ndim != 1 or time.size < 2 or not np.all(np.diff(time) > 0.0):
        raise RequestError(f"t has shape {time.shape}; allowed: (n,) strictly increasing times with n >= 2")
    return time


def _like(time: Array, signal: ArrayLike, name: str) -> Array:
    values = np.asarray(signal, dtype=float)
    if values.shape != time.shape:
        raise RequestError(
            f"{name} has shape {values.shape}, t {time.shape}; allowed: equal; "
            "take one column of an output that has one per ball"
        )
    return values


def _positive(value: float, name: str, unit: str) -> None:
    if not (np.isfinite(value) and value > 0.0):
        raise RequestError(f"{name} is {value!r} {unit}; allowed: positive and finite")
