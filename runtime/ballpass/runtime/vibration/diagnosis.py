"""Vibration signals for the diagnosis of bearings: envelope, orders of a shaft, spectrogram, statistics.

In: samples at equal steps.  Out: arrays and small frozen records.  SciPy does the signal processing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.extras import need
from ballpass.runtime.show import html
from ballpass.runtime.show.short import ShortRepr
from ballpass.runtime.vibration.spectrum import (
    LISTED,
    AmplitudeSpectrum,
    Window,
    amplitude_spectrum,
    even_samples,
    window_weights,
)

Array = NDArray[np.float64]

#: Order of the Butterworth band-pass of envelopes; it runs forward and backward: order doubled, phase kept.
BAND_ORDER = 4
#: Samples of a turn where orders are asked for, at most so many times those of a mean turn.
MOST_FINER = 8
#: Lines in a band of a kurtogram at least: kurtosis of fewer scatters by more than impacts raise it.
LEAST_LINES = 128
#: Part of a record at each end that a kurtogram fades out and leaves out.
ENDS = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class DiagnosisStatistics:
    """Basic statistics of a signal, its mean removed.

    Attributes
    ----------
    rms, peak : root mean square, and largest amount [unit of the signal]
    crest_factor : peak over rms [1]
    kurtosis : fourth moment over the squared variance, 3 for Gaussian noise, 1.5 for a sine [1]
    skewness : third moment over the variance to 3/2 [1]
    """

    rms: float
    peak: float
    crest_factor: float
    kurtosis: float
    skewness: float


def diagnosis(signal: ArrayLike) -> DiagnosisStatistics:
    """Statistics of diagnosis of samples (n,) at equal steps.

    Raises
    ------
    RequestError
        No samples in a row, or a signal that does not change.
    """
    values = np.asarray(signal, dtype=float)
    if values.ndim != 1 or values.size < 4:
        raise RequestError(f"signal has shape {values.shape}; allowed: (n,) with n >= 4")
    centred = values - np.mean(values)
    rms = float(np.sqrt(np.mean(centred**2)))
    if not rms > 1e-14 * float(np.max(np.abs(values))):
        raise RequestError("the signal does not change, so that it has no crest factor; allowed: one that vibrates")
    stats = need("scipy.stats")  # here: the import takes longer than a run

    peak = float(np.max(np.abs(centred)))
    return DiagnosisStatistics(
        rms=rms,
        peak=peak,
        crest_factor=peak / rms,
        kurtosis=float(stats.kurtosis(centred, fisher=False)),
        skewness=float(stats.skew(centred)),
    )


def envelope(t: ArrayLike, signal: ArrayLike, band: tuple[float, float]) -> Array:
    """Envelope of a signal within a band: amount of the analytic signal after a band-pass.

    The band-pass is a Butterworth filter that runs forward and backward; its transients last some periods of the lower
    edge at both ends.

    Parameters
    ----------
    t : (n,) times at equal steps [s]
    signal : (n,) samples [any unit]
    band : lower and upper edge, between zero and half the sampling rate [Hz]

    Returns
    -------
    (n,) [unit of the signal]

    Raises
    ------
    RequestError
        Steps are not equal, or the band does not lie below half the sampling rate.
    """
    time, values = even_samples(t, signal)
    rate = (time.size - 1) / (time[-1] - time[0])
    low, high = band
    if not 0.0 < low < high < rate / 2.0:
        raise RequestError(
            f"band is {low:g} to {high:g} Hz; allowed: two frequencies that increase, between 0 and half the sampling "
            f"rate, {rate / 2.0:g} Hz; sample the run faster or lower the band"
        )
    signals = need("scipy.signal")  # here: the import takes longer than a run

    stages = signals.butter(BAND_ORDER, [low, high], "bandpass", fs=rate, output="sos")
    return np.asarray(np.abs(signals.hilbert(signals.sosfiltfilt(stages, values))), dtype=float)


@dataclass(frozen=True, slots=True, kw_only=True)
class BandKurtosis:
    """Kurtosis of a signal within a band.

    Attributes
    ----------
    low, high : edges [Hz]
    kurtosis : of the complex envelope, 0 for stationary Gaussian noise, -1 for a sine, more for impacts [1]
    """

    low: float
    high: float
    kurtosis: float


def kurtogram(t: ArrayLike, signal: ArrayLike, narrowest: float) -> tuple[BandKurtosis, ...]:
    """Kurtosis within bands of many widths, the highest first: impacts ring in the first band.

    Widths are halves and thirds of half the sampling rate, and halves of these; bands overlap by half.

    Parameters
    ----------
    t : (n,) times at equal steps [s]
    signal : (n,) samples [any unit]
    narrowest : width of the narrowest bands [Hz]; wide enough that impacts stay apart in it: some times their rate

    Raises
    ------
    RequestError
        Steps are not equal, the signal does not change, or no band is as wide.

    References
    ----------
    Antoni, J.: Fast computation of the kurtogram for the detection of transient faults. Mech. Syst. Signal Process. 21
    (2007) 108-124, doi:10.1016/j.ymssp.2005.12.002.  Its bands come from a filter bank, these from the lines of one
    Fourier transform, weighted with a Hann window over each band.
    """
    time, values = even_samples(t, signal)
    rate = (time.size - 1) / (time[-1] - time[0])
    diagnosis(values)  # refuses a signal that does not change
    signals = need("scipy.signal")  # here: the import takes longer than a run

    # ends that do not meet would ring in every band
    lines = np.fft.rfft((values - np.mean(values)) * signals.windows.tukey(values.size, 2.0 * ENDS))
    highest = rate / 2.0
    widths = sorted({highest / (parts << k) for parts in (2, 3) for k in range(30)}, reverse=True)
    found = []
    for width in (width for width in widths if width >= narrowest):
        count = int(width / rate * values.size)
        if count < LEAST_LINES:
            break
        taper = signals.windows.hann(count, sym=False)
        for k in range(1, round(2.0 * highest / width) - 2):
            first = round(k * width / 2.0 / rate * values.size)
            power = np.abs(np.fft.ifft(lines[first : first + count] * taper)) ** 2
            inner = power[math.ceil(ENDS * count) : math.floor((1.0 - ENDS) * count)]
            kurtosis = float(np.mean(inner**2) / np.mean(inner) ** 2) - 2.0
            low = k * width / 2.0
            found.append(BandKurtosis(low=low, high=low + width, kurtosis=kurtosis))
    if not found:
        raise RequestError(
            f"narrowest is {narrowest:g} Hz; allowed: up to {widths[0]:g} Hz, a quarter of the sampling rate, in a "
            f"record of more than {LEAST_LINES} lines of that band; sample the run faster or longer"
        )
    return tuple(sorted(found, key=lambda band: -band.kurtosis))


def over_angle(angle: ArrayLike, signal: ArrayLike, per_turn: int | None = None) -> tuple[Array, Array]:
    """A signal at equal steps of an angle, read between its samples by a cubic spline.

    Parameters
    ----------
    angle : (n,) angles of the shaft, all increasing or all decreasing, counted on beyond a turn [rad]
    signal : (n,) samples [any unit]
    per_turn : samples in a turn.  Default: as many as the slowest turn has, to avoid aliasing, at most eight
        times those of a mean turn

    Returns
    -------
    turns : (m,) angles in turns from the first sample on, at equal steps [1]
    signal : (m,) [unit of the signal]

    Raises
    ------
    RequestError
        Shapes differ, the shaft stops or turns back, or the record is shorter than a turn.
    """
    turned, values = np.asarray(angle, dtype=float) / (2.0 * np.pi), np.asarray(signal, dtype=float)
    if turned.ndim != 1 or turned.size < 4 or values.shape != turned.shape:
        raise RequestError(f"angle has shape {turned.shape}, signal {values.shape}; allowed: (n,) both with n >= 4")
    turned = (turned - turned[0]) * np.sign(turned[-1] - turned[0])
    steps = np.diff(turned)
    if not np.min(steps) > 0.0:
        raise RequestError("the shaft stops or turns back within the record; allowed: one sense; cut the record there")
    if per_turn is None:
        per_turn = int(np.ceil(min(1.0 / np.min(steps), MOST_FINER * steps.size / turned[-1])))
    count = int(np.floor(turned[-1] * per_turn * (1.0 + 1e-12))) + 1
    if per_turn < 2 or turned[-1] < 1.0:
        raise RequestError(
            f"the record has {turned[-1]:.4g} turns, and per_turn is {per_turn}; allowed: a turn or more, 2 or more"
        )
    interpolate = need("scipy.interpolate")  # here: the import takes longer than a run

    even = np.minimum(np.arange(count) / per_turn, turned[-1])
    return np.arange(count) / per_turn, np.asarray(interpolate.CubicSpline(turned, values)(even), dtype=float)


def order_spectrum(
    angle: ArrayLike, signal: ArrayLike, *, window: Window = "hann", per_turn: int | None = None
) -> AmplitudeSpectrum:
    """Amplitudes of a signal over orders, multiples of a shaft's speed, which may change.

    The signal is read at equal steps of the angle (`over_angle`); the last whole turns count.  ``frequency`` and
    ``resolution`` of the result are orders [1].  Parameters and errors are those of `over_angle` and
    `amplitude_spectrum`.
    """
    turns, values = over_angle(angle, signal, per_turn)
    return amplitude_spectrum(turns, values, cycle_length=1.0, window=window)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Spectrogram(ShortRepr):
    """Amplitudes over time and frequency.

    Attributes
    ----------
    time : (k,) middles of the segments [s]
    frequency : (m,) from 0 to half the sampling rate [Hz]
    amplitude : (m, k), 0 to peak [unit of the signal]
    """

    time: Array
    frequency: Array
    amplitude: Array

    def _repr_html_(self) -> str:
        segments = np.unique(np.linspace(0, self.time.size - 1, LISTED).round().astype(int))
        lines = np.argmax(self.amplitude[:, segments], axis=0)
        heads = ("time [s]", "frequency [Hz]", "amplitude")
        rows = zip(self.time[segments], self.frequency[lines], self.amplitude[lines, segments], strict=True)
        return html.block(
            html.title(
                f"Spectrogram: {self.time.size} segments from {self.time[0]:.6g} to {self.time[-1]:.6g} s",
                f"{self.frequency.size} lines up to {self.frequency[-1]:.6g} Hz; the highest of some segments:",
            ),
            html.table(heads, [(f"{t:.6g}", f"{f:.6g}", f"{a:.4g}") for t, f, a in rows], right=heads),
        )


def spectrogram(
    t: ArrayLike, signal: ArrayLike, *, segment: float, overlap: float = 0.75, window: Window = "hann"
) -> Spectrogram:
    """Amplitudes of segments of a signal, its mean removed (`scipy.signal.ShortTimeFFT`): of a run-up, for example.

    Parameters
    ----------
    t : (n,) times at equal steps [s]
    signal : (n,) samples [any unit]
    segment : length of the segments [s]; lines are 1/segment apart
    overlap : of neighbours, as part of the segment, from 0 to below 1 [1]

    Raises
    ------
    RequestError
        Steps are not equal, the window is unknown, or segments do not fit the record.
    """
    time, values = even_samples(t, signal)
    rate = (time.size - 1) / (time[-1] - time[0])
    count = round(segment * rate)
    if not (4 <= count <= time.size and 0.0 <= overlap < 1.0):
        raise RequestError(
            f"segment is {segment!r} s, {count} samples, overlap {overlap!r}; allowed: 4 samples up to the record's "
            f"length of {time.size / rate:.6g} s, an overlap from 0 to below 1"
        )
    signals = need("scipy.signal")  # here: the import takes longer than a run

    weight = window_weights(window, count)
    hop = max(1, round(count * (1.0 - overlap)))
    transform = signals.ShortTimeFFT(weight, hop, rate, scale_to="magnitude", fft_mode="onesided2X")
    centred = values - np.mean(values)
    first, last = transform.lower_border_end[1], transform.upper_border_begin(centred.size)[1]
    found = np.abs(transform.stft(centred, p0=first, p1=max(last, first + 1)))
    middles = transform.t(centred.size, p0=first, p1=max(last, first + 1))
    return Spectrogram(time=time[0] + middles, frequency=np.asarray(transform.f), amplitude=found)
