"""Spectra of a signal: amplitude or power by frequency.

In: samples at equal steps.  Out: an `AmplitudeSpectrum`, single-sided, in the unit of the signal; or a `PowerSpectrum`.

For amplitudes the record is cut to a whole number of cycles of the machine, its mean taken off, and weighted with a
window whose coherent gain is divided out: a sine of amplitude a whose frequency is a line of the spectrum has the
height a there.

Choice of window
----------------
``boxcar`` (default): on a whole number of cycles every harmonic of the cycle falls on a line and leaks nothing, and
the lines are as narrow as the record allows.  Frequencies that are no harmonics (ball pass) leak into their
neighbours and may read up to 36 % low (scalloping).
``hann``: leaks far less, at lines twice as wide; may read up to 15 % low.
``flattop``: reads any amplitude within 0.1 %, at lines about five times as wide: for long records.

Any other window that `scipy.signal.get_window` knows by name alone may be given.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.extras import need
from ballpass.runtime.show import html
from ballpass.runtime.show.short import ShortRepr

#: Name of a window.
Window = str
#: Powers of lines [unit^2], or per bandwidth [unit^2/Hz], as in `scipy.signal`.
Scaling = Literal["spectrum", "density"]

#: Lines that a notebook shows.
LISTED = 8

#: Largest difference between steps that still counts as equal, relative to the step; rounding of t is far below.
_STEP_TOLERANCE = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class AmplitudeSpectrum(ShortRepr):
    """Single-sided amplitude spectrum.

    Attributes
    ----------
    frequency : (m,) line frequencies from 0 to half the sampling rate [Hz]
    amplitude : (m,) amplitudes, 0 to peak [unit of the signal]
    resolution : distance of the lines, one over the record's length [Hz]
    cycles : whole cycles in the record; None where the record was not cut to cycles
    window : name of the window
    """

    frequency: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    resolution: float
    cycles: int | None
    window: Window

    def _repr_html_(self) -> str:
        return _highest(self, "amplitude", self.amplitude)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class PowerSpectrum(ShortRepr):
    """Single-sided power spectrum, by Welch's method.

    Attributes
    ----------
    frequency : (m,) line frequencies from 0 to half the sampling rate [Hz]
    power : (m,) of the lines [unit of the signal squared], or their density [the same per Hz]
    resolution : distance of the lines [Hz]
    window, scaling : as asked for
    """

    frequency: NDArray[np.float64]
    power: NDArray[np.float64]
    resolution: float
    window: Window
    scaling: Scaling

    def _repr_html_(self) -> str:
        return _highest(self, "power", self.power)


def _highest(spectrum: AmplitudeSpectrum | PowerSpectrum, head: str, sizes: NDArray[np.float64]) -> str:
    """The highest lines of a spectrum as HTML."""
    chosen = np.argsort(-sizes, kind="stable")[:LISTED]
    return html.block(
        html.title(
            f"{type(spectrum).__name__}: {sizes.size} lines up to {spectrum.frequency[-1]:.6g} Hz",
            f"lines {spectrum.resolution:.4g} Hz apart, window {spectrum.window}; the highest:",
        ),
        html.table(
            ("frequency [Hz]", head),
            [(f"{spectrum.frequency[k]:.6g}", f"{sizes[k]:.4g}") for k in chosen],
            right=("frequency [Hz]", head),
        ),
    )


def power_spectrum(
    t: ArrayLike,
    signal: ArrayLike,
    *,
    window: Window = "hann",
    scaling: Scaling = "density",
    segment: float | None = None,
) -> PowerSpectrum:
    """Power spectrum of a signal, the mean of each segment removed (`scipy.signal.welch`).

    Parameters
    ----------
    t : (n,) times at equal steps [s]
    signal : (n,) samples [any unit]
    window : any name that `scipy.signal.get_window` takes
    scaling : ``"spectrum"``: a sine of amplitude a has the power a^2/2; ``"density"``: the integral over the frequency
        is the mean square
    segment : length of the segments that are averaged, half overlapping [s]; None: the whole record at once

    Raises
    ------
    RequestError
        Steps are not equal, the window or the scaling is unknown, or a segment is longer than the record.
    """
    time, values = even_samples(t, signal)
    if scaling not in ("spectrum", "density"):
        raise RequestError(f"scaling is {scaling!r}; allowed: spectrum, density")
    rate = (time.size - 1) / (time[-1] - time[0])
    count = time.size if segment is None else round(segment * rate)
    if not 4 <= count <= time.size:
        raise RequestError(
            f"segment is {segment!r} s, {count} samples; allowed: 4 samples up to the record's length of "
            f"{time.size / rate:.6g} s"
        )
    signals = need("scipy.signal")  # here: the import takes longer than a run

    weight = window_weights(window, count)
    frequency, power = signals.welch(values, rate, window=weight, nperseg=count, scaling=scaling, detrend="constant")
    return PowerSpectrum(frequency=frequency, power=power, resolution=rate / count, window=window, scaling=scaling)


def whole_cycles(
    t: ArrayLike, signal: ArrayLike, cycle_length: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
    """Last whole cycles of a record, at equal steps, without the end point that repeats the start.

    Where a cycle is not a whole number of steps, the record is read between its samples by a cubic spline, at the
    step next to the given one that divides the cycle.

    Parameters
    ----------
    t : (n,) times at equal steps [s]
    signal : (n,) samples [any unit]
    cycle_length : length of a cycle [s]

    Returns
    -------
    t, signal : (k * cycles,) the cut record [s], [unit of the signal]
    cycles : number of whole cycles

    Raises
    ------
    RequestError
        Steps are not equal, or the record is shorter than a cycle.
    """
    time, values = even_samples(t, signal)
    if not (np.isfinite(cycle_length) and cycle_length > 0.0):
        raise RequestError(f"cycle_length is {cycle_length!r} s; allowed: positive and finite")
    step = (time[-1] - time[0]) / (time.size - 1)
    cycles = int(np.floor((time[-1] - time[0]) / cycle_length * (1.0 + 1e-12) + 1e-9))
    if cycles < 1:
        raise RequestError(
            f"the record spans {time[-1] - time[0]:.6g} s, less than one cycle of {cycle_length:.6g} s; "
            "allowed: one cycle or more; run more cycles or drop fewer transient ones"
        )
    per_cycle = max(round(cycle_length / step), 2)
    start = time[-1] - cycles * cycle_length
    count = cycles * per_cycle
    grid = start + np.arange(count) * (cycle_length / per_cycle)
    if abs(per_cycle * step - cycle_length) * cycles < _STEP_TOLERANCE * step:
        first = time.size - 1 - count
        return grid, values[first : first + count], cycles
    interpolate = need("scipy.interpolate")  # here: the import takes longer than a run

    return grid, np.asarray(interpolate.CubicSpline(time, values)(grid), dtype=float), cycles


def amplitude_spectrum(
    t: ArrayLike, signal: ArrayLike, *, cycle_length: float | None = None, window: Window = "boxcar"
) -> AmplitudeSpectrum:
    """Single-sided amplitude spectrum of a signal without its mean.

    Parameters
    ----------
    t : (n,) times at equal steps [s]
    signal : (n,) samples [any unit]
    cycle_length : length of a cycle [s]; the last whole cycles of the record are used.  None: the record as it is
    window : see the module's text

    Raises
    ------
    RequestError
        Steps are not equal, the record is shorter than a cycle, or the window is unknown.

    Notes
    -----
    Amplitude of line k: ``2 |X_k| / sum(w)``, at half the sampling rate ``|X_k| / sum(w)``; X the discrete Fourier
    transform of w (signal - mean), the mean being weighted with w so that the line at zero frequency vanishes.
    """
    cycles: int | None = None
    if cycle_length is None:
        time, values = even_samples(t, signal)
    else:
        time, values, cycles = whole_cycles(t, signal, cycle_length)
    count = values.size
    length = count * (time[-1] - time[0]) / (count - 1)
    weight = window_weights(window, count)
    centred = values - np.sum(weight * values) / np.sum(weight)
    amplitude = np.abs(np.fft.rfft(weight * centred)) * (2.0 / np.sum(weight))
    if count % 2 == 0:
        amplitude[-1] /= 2.0  # this line has no counterpart at negative frequencies
    return AmplitudeSpectrum(
        frequency=np.arange(amplitude.size) / length,
        amplitude=np.asarray(amplitude, dtype=float),
        resolution=1.0 / length,
        cycles=cycles,
        window=window,
    )


def window_weights(window: Window, count: int) -> NDArray[np.float64]:
    """Weights of a window in its periodic form, the one for spectra."""
    if window == "boxcar":
        return np.ones(count)
    signals = need("scipy.signal")  # here: the import takes longer than a run

    try:
        return np.asarray(signals.get_window(window, count), dtype=float)
    except (TypeError, ValueError):
        raise RequestError(
            f"window is {window!r}; allowed: boxcar, hann, flattop, or another one that scipy.signal.get_window knows "
            "by its name alone"
        ) from None


def even_samples(t: ArrayLike, signal: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times and signal as arrays; RequestError where their shapes differ or the steps are not equal."""
    time, values = np.asarray(t, dtype=float), np.asarray(signal, dtype=float)
    if time.ndim != 1 or values.shape != time.shape or time.size < 4:
        raise RequestError(
            f"t has shape {time.shape}, signal {values.shape}; allowed: (n,) both with n >= 4; "
            "take one column of an output that has one per ball"
        )
    steps = np.diff(time)
    mean = (time[-1] - time[0]) / (time.size - 1)
    if not mean > 0.0 or np.max(np.abs(steps - mean)) > _STEP_TOLERANCE * mean:
        raise RequestError(
            f"steps of t run from {np.min(steps):.6g} s to {np.max(steps):.6g} s; allowed: equal, positive steps; "
            "sample the run on an even grid"
        )
    return time, values
