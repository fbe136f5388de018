"""From a bearing to the numbers of a recorder: resonance of the mounting, filter, noise, steps of a converter.

In: a signal at equal steps.  Out: what a sensor on the machine would have recorded of it.  Outputs are motions seen
from the ground, so that gravity is not in them, as in a vibration sensor whose constant part is blocked.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from ballpass.runtime.contract.column_files import read_columns
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.units import QuantityError, parse_quantity

#: Order of the low-pass: 0.9 of a sine at 0.91 of its frequency are left, a 256th at twice it.
LOW_PASS_ORDER = 8
#: The signal is sampled at so many times the highest frequency of the path at least, so that little is folded into it.
FINER = 10.0
#: What is left of a ringing when it counts as over.
OVER = 1e-6

_UNITS = {"resonance": "Hz", "low_pass": "Hz"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor:
    """A path from a point of the machine to a recorder; every part is optional.

    Attributes
    ----------
    resonance, damping : natural frequency [Hz] and damping ratio [1] of the mounted sensor, a mass on a spring and
        damper whose foot moves with the machine; it gives the motion of the mass
    transfer : measured transfer function, rows of frequency [Hz], gain [1] and phase [rad]; read between them by
        straight lines, and as its first and last row outside
    low_pass : frequency of an anti-alias filter, Butterworth of order 8 [Hz]
    noise : root mean square of added noise [unit of the signal]
    colour : its power falls with this power of the frequency: 0 white, 1 pink, 2 red [1]
    range, bits : largest amount that the converter takes [unit of the signal], and its bits

    Raises
    ------
    RequestError
        Numbers out of range; all faults at once.

    Notes
    -----
    Of the foot's motion a(t) the mass makes H a, H = (2 z w s + w^2)/(s^2 + 2 z w s + w^2), s = i 2 pi f, w = 2 pi
    times the resonance, z the damping ratio: 1 far below the resonance, sqrt(1 + 1/(2 z)^2) on it.

    Examples
    --------
    >>> sensor = Sensor(resonance=5e3, damping=0.1)
    >>> abs(sensor.response(np.array([5.0, 5e3]))).round(3)
    array([1.   , 5.099])
    """

    resonance: float | None = None
    damping: float = 0.05
    transfer: tuple[tuple[float, float, float], ...] = ()
    low_pass: float | None = None
    noise: float = 0.0
    colour: float = 0.0
    range: float | None = None
    bits: int | None = None

    def __post_init__(self) -> None:
        table = np.array(self.transfer, dtype=float).reshape(-1, 3)
        rising = bool(np.all(np.isfinite(table)) and np.all(np.diff(table[:, 0]) > 0.0) and np.all(table[:, :2] >= 0.0))
        whole = isinstance(self.bits, int) and not isinstance(self.bits, bool)
        checks = (
            ("resonance", self.resonance is None or 0.0 < self.resonance < math.inf, "a frequency above 0"),
            ("damping", 0.0 < self.damping < math.inf, "a ratio above 0"),
            ("transfer", rising, "rows of frequency, gain and phase; frequencies that increase, gains from 0 on"),
            ("low_pass", self.low_pass is None or 0.0 < self.low_pass < math.inf, "a frequency above 0"),
            ("noise", 0.0 <= self.noise < math.inf, "a root mean square from 0 on"),
            ("colour", -4.0 <= self.colour <= 4.0, "-4 to 4; 0 is white, 1 pink, 2 red"),
            ("range", self.range is None or 0.0 < self.range < math.inf, "an amount above 0"),
            ("bits", self.bits is None or (whole and 2 <= self.bits <= 32), "a whole number, 2 to 32"),
        )
        faults = [
            f"{name}: {getattr(self, name)!r:.60} was given. Allowed: {words}."
            for name, fine, words in checks
            if not fine
        ]
        if not faults and (self.bits is None) != (self.range is None):
            faults = ["bits: a converter has bits and a range. Give both, or neither."]
        if faults:
            raise RequestError("\n".join(faults))

    @property
    def rate(self) -> float:
        """Samples a second that its input needs at least [Hz]; 0 where it filters nothing."""
        highest = (self.resonance or 0.0, self.low_pass or 0.0, *(row[0] for row in self.transfer[-1:]))
        return FINER * max(highest)

    @property
    def memory(self) -> float:
        """Time after which it has forgotten a jump [s]."""
        slow = (
            [2.0 * math.pi * self.resonance * min(self.damping, 1.0 / (2.0 * self.damping))] if self.resonance else []
        )
        if self.low_pass:
            slow.append(2.0 * math.pi * self.low_pass * math.sin(math.pi / (2 * LOW_PASS_ORDER)))
        if self.transfer:
            slow.append(-math.log(OVER) * min(np.diff([row[0] for row in self.transfer]), default=math.inf))
        return -math.log(OVER) / min(slow) if slow else 0.0

    def response(self, frequency: np.ndarray) -> np.ndarray:
        """Factor of a sine, complex, by frequencies, shape (n,) [Hz].

        Examples
        --------
        >>> abs(Sensor(low_pass=1e4).response(np.array([1e3, 1e4, 2e4]))).round(4)
        array([1.    , 0.7071, 0.0039])
        """
        found = np.ones(len(frequency), dtype=complex)
        if self.resonance is not None:
            s, z = 1j * frequency / self.resonance, self.damping
            found *= (1.0 + 2.0 * z * s) / (1.0 + 2.0 * z * s + s**2)
        if self.low_pass is not None:
            angles = np.pi * (2.0 * np.arange(LOW_PASS_ORDER) + 1.0 + LOW_PASS_ORDER) / (2.0 * LOW_PASS_ORDER)
            for pole in np.exp(1j * angles):  # of the normed filter; their product is 1
                found *= -pole / (1j * frequency / self.low_pass - pole)
        if self.transfer:
            at, gain, phase = np.array(self.transfer).T
            found *= np.interp(frequency, at, gain) * np.exp(1j * np.interp(frequency, at, np.unwrap(phase)))
        return found

    def measured(
        self, signal: np.ndarray, rate: float, random: np.random.Generator, every: int = 1, first: int = 0
    ) -> np.ndarray:
        """What the recorder has of a signal.

        Parameters
        ----------
        signal : samples at equal steps, shape (n,) [any unit]
        rate : their number in a second [Hz]
        random : of the noise
        every, first : keep every so many-th sample behind the filters, from the first so many-th on

        Examples
        --------
        >>> sensor = Sensor(range=8.0, bits=4)
        >>> sensor.measured(np.array([0.4, 2.6, 11.0]), 1e3, np.random.default_rng(0))
        array([0., 3., 7.])
        """
        kept = self._filtered(signal, rate)[first::every]
        if self.noise > 0.0:
            kept = kept + self.noise * coloured(len(kept), self.colour, random)
        if self.bits is not None and self.range is not None:
            step = self.range / 2 ** (self.bits - 1)
            kept = np.clip(np.round(kept / step) * step, -self.range, self.range - step)
        return kept

    def _filtered(self, signal: np.ndarray, rate: float) -> np.ndarray:
        if self.rate == 0.0:
            return signal
        # continued at both ends, so that the end does not ring into the start
        ends = min(len(signal) - 1, math.ceil(self.memory * rate))
        long = np.pad(signal, ends, mode="reflect", reflect_type="odd")
        factor = self.response(np.fft.rfftfreq(len(long), 1.0 / rate))
        return np.fft.irfft(np.fft.rfft(long) * factor, len(long))[ends : ends + len(signal)]


def coloured(count: int, colour: float, random: np.random.Generator) -> np.ndarray:
    """Noise of mean 0 and expected variance 1 whose power is proportional to 1/f^colour, shape (count,)."""
    white = random.standard_normal(count)
    if colour == 0.0:
        return white
    lines = np.fft.rfft(white)
    weight = np.zeros(len(lines))
    weight[1:] = np.arange(1, len(lines)) ** (-0.5 * colour)
    # each line but the last of an even count stands for two
    power = 2.0 * np.sum(weight**2) - (weight[-1] ** 2 if count % 2 == 0 else 0.0)
    return np.asarray(np.fft.irfft(lines * weight, count) * math.sqrt(count / power))


def read_sensor(given: Mapping[str, object], folder: Path = Path()) -> Sensor:
    """A sensor from what people write: quantities with units, and the path of a table for ``transfer``.

    Parameters
    ----------
    given : by the names of the attributes: ``{"resonance": "8 kHz", "transfer": "path.csv"}``
    folder : of the path

    Raises
    ------
    RequestError
        Unknown names, wrong units, numbers out of range, a table that cannot be read.
    """
    known = [item.name for item in fields(Sensor)]
    unknown = [name for name in given if name not in known]
    if unknown:
        raise RequestError(f"{unknown[0]}: a sensor has no such number. Allowed: {', '.join(known)}.")
    values: dict[str, object] = {}
    for name, written in given.items():
        try:
            if name == "transfer":
                values[name] = _read_transfer(folder / str(written))
            elif name == "bits":
                values[name] = int(written) if isinstance(written, str) and written.isdigit() else written
            else:
                values[name] = parse_quantity(written, _UNITS.get(name, "1"))
        except QuantityError as fault:
            raise RequestError(f"{name}: {fault}") from None
    return Sensor(**values)  # type: ignore[arg-type]


def sensor_of_text(text: str) -> Sensor:
    """A sensor from one text: ``"resonance=8 kHz, low_pass=10 kHz, noise=0.05"``."""
    pairs = [part.partition("=") for part in text.split(",")]
    if not all(equals and name.strip() and value.strip() for name, equals, value in pairs):
        raise RequestError(
            f"{text!r:.60} is no sensor. Allowed: numbers with their names and commas between them, as in "
            '"resonance=8 kHz, damping=0.05, low_pass=10 kHz".'
        )
    return read_sensor({name.strip(): value.strip() for name, _, value in pairs})


def _read_transfer(path: Path) -> tuple[tuple[float, float, float], ...]:
    """Rows of frequency [Hz], gain and phase [rad, 0 where there is no such column]."""
    try:
        file = read_columns(path, str(path))
        named = {one.name: one.head for one in file.columns}
        keys = [named.get(name, str(k)) for k, name in enumerate(("frequency", "gain", "phase"), start=1)]
        frequency, gain, *phase = (file.column(key) for key in keys[: max(len(file.columns), 2)])
        rows = [file.si(frequency, "Hz"), file.si(gain, "1")]
        rows += [file.si(file.in_unit(one, one.unit or "deg"), "rad") for one in phase] or [np.zeros(len(rows[0]))]
    except RequestError as fault:
        raise RequestError(
            f"transfer: {path} cannot be read: {fault} Allowed: columns frequency [Hz], gain, and optionally "
            "phase [deg], by these names or in this order."
        ) from None
    return tuple(zip(*(row.tolist() for row in rows), strict=True))
