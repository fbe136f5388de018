"""Signals of members: samples of outputs at a sample rate, with the noise of a sensor.

In: a model, the parameters of some members, a `Signals`.  Out: `Made`, their samples.  A member is a run of its own:
lanes of ensembles give reductions, and a run of the stepper with samples takes about as long as one in lanes takes
without (see `docs/howto/data_sets.md`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ballpass.runtime.contract.defaults import TOLERANCES
from ballpass.runtime.contract.errors import BallpassError, RequestError
from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.many.chunks import MemberFailure
from ballpass.runtime.many.distributions import NOISE, Distribution, stream
from ballpass.runtime.many.spall_entries import driven_spalls, entry_times
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.quantity.cuts import entering_times
from ballpass.runtime.quantity.grammar import parse_quantities, quantities_of, refuse_unknown_kinds
from ballpass.runtime.quantity.quantity_run import QuantityRun
from ballpass.runtime.ratings.of_bearing import bearing_words
from ballpass.runtime.request.request import Request, no_output
from ballpass.runtime.request.resolve import Run, resolve
from ballpass.runtime.solution.integration_error import IntegrationError
from ballpass.runtime.solution.simulate import simulate
from ballpass.runtime.time import timeline
from ballpass.runtime.time.span import Span
from ballpass.runtime.vibration.sensor import Sensor

#: Ways to store samples.
PRECISIONS = ("float32", "float64")


@dataclass(frozen=True, slots=True, kw_only=True)
class Signals:
    """The signals to record of every member.

    Attributes
    ----------
    outputs : names of outputs with one value at a time ("inner.ax")
    sample_rate : samples in a second [Hz]
    duration : time that is recorded [s]
    transient : time before it, which is simulated and left out [s]
    snr : ratio of the variance of the signal to that of white Gaussian noise added to it, 10 log10 of it; a
        distribution gives each member its own; None adds no noise [dB]
    rtol : tolerance of the runs; None takes the scene's [1]
    precision : of stored samples, "float32" or "float64"
    quantities : names of quantities of the recorded part of each run, which are stored as labels ("peak_ball_force");
        see `Model.quantities`
    sensor : what stands between the machine and the recorder; None records the outputs themselves

    Raises
    ------
    RequestError
        A number out of range, all faults at once; or a kind of quantity that there is not.

    Examples
    --------
    >>> signals = Signals(outputs=("inner.y",), sample_rate=20e3, duration=0.1, snr=30.0)
    >>> signals.samples
    2000
    """

    outputs: tuple[str, ...]
    sample_rate: float
    duration: float
    transient: float = 0.0
    snr: Distribution | float | None = None
    rtol: float | None = None
    precision: str = "float32"
    quantities: tuple[str, ...] = ()
    sensor: Sensor | None = None

    def __post_init__(self) -> None:
        least, most = TOLERANCES
        checks = (
            ("outputs", bool(self.outputs), "one name or more"),
            ("sample_rate", 0.0 < self.sample_rate < math.inf, "a frequency above 0"),
            ("duration", 0.0 < self.duration < math.inf, "a time above 0"),
            ("transient", 0.0 <= self.transient < math.inf, "a time from 0 on"),
            ("rtol", self.rtol is None or least <= self.rtol <= most, f"{least:g} to {most:g}"),
            ("precision", self.precision in PRECISIONS, " or ".join(PRECISIONS)),
        )
        faults = [
            f"{name}: {getattr(self, name)!r} was given. Allowed: {words}." for name, fine, words in checks if not fine
        ]
        if not faults and self.samples < 2:
            faults.append(
                f"duration: {self.duration:g} s at {self.sample_rate:g} Hz are fewer than 2 samples. Record longer."
            )
        if faults:
            raise RequestError("\n".join(faults))
        refuse_unknown_kinds(self.quantities)

    @property
    def samples(self) -> int:
        """Samples of a signal."""
        return round(self.duration * self.sample_rate)

    @property
    def times(self) -> np.ndarray:
        """Times of the samples in the runs, shape (samples,) [s]."""
        return self.transient + np.arange(self.samples) / self.sample_rate

    @property
    def every(self) -> int:
        """Samples of the run to each that is recorded: what a sensor filters is sampled more finely."""
        return 1 if self.sensor is None else max(1, math.ceil(self.sensor.rate / self.sample_rate))

    @property
    def before(self) -> int:
        """Samples of the run in front of the first that is recorded, which a sensor remembers."""
        if self.sensor is None:
            return 0
        return math.floor(min(self.sensor.memory, self.transient) * self.sample_rate * self.every)

    @property
    def run_times(self) -> np.ndarray:
        """Times of the samples of the runs [s]; `times` where there is no sensor."""
        count = self.before + (self.samples - 1) * self.every + 1
        return self.transient + (np.arange(count) - self.before) / (self.sample_rate * self.every)


@dataclass(frozen=True, slots=True, kw_only=True)
class Member:
    """One member to make.

    Attributes
    ----------
    kind : place of its class
    place : its place in the class, from 0 on
    parameters : overrides [SI]
    snr : [dB]; None for no noise
    """

    kind: int
    place: int
    parameters: Mapping[str, float]
    snr: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Made:
    """Signals of some members.

    Attributes
    ----------
    samples : by output, each of shape (members, samples); NaN for a member without results
    noise_rms : root mean square of the noise that was added, shape (members, outputs) [units of the outputs]
    quantities : shape (members, quantities); NaN for a member without results
    entries : by spall, times of each member at which a ball reaches it, where the motion decides them [s]
    failures : members without results, by their place here
    """

    samples: Mapping[str, np.ndarray]
    noise_rms: np.ndarray
    quantities: np.ndarray
    entries: Mapping[str, Sequence[np.ndarray]]
    failures: tuple[MemberFailure, ...]


def make_signals(
    models: Mapping[int, LoadedModel],
    signals: Signals,
    seed: int,
    members: Sequence[Member],
    driven: Sequence[str] = (),
) -> Made:
    """Simulate some members; a failure is recorded, not raised.

    Parameters
    ----------
    models : by class
    driven : spalls of which times of entry are wanted; the motion decides those of one class at least
    """
    shape = (len(members), signals.samples)
    samples = {name: np.full(shape, np.nan, signals.precision) for name in signals.outputs}
    noise_rms = np.zeros((len(members), len(signals.outputs)))
    quantities = np.full((len(members), len(signals.quantities)), np.nan)
    failures = []
    entries = {name: [np.zeros(0)] * len(members) for name in driven}
    times = signals.run_times
    rate = signals.sample_rate * signals.every
    for row, member in enumerate(members):
        model = models[member.kind]
        try:
            numbers = model.numbers(member.parameters)
            found = simulate(model, numbers, Request(times=times, outputs=signals.outputs, rtol=signals.rtol)).outputs
            if signals.quantities:
                run = _recorded(model, numbers, signals)
                quantities[row] = QuantityRun(model, quantities_of(model, signals.quantities)).measure(run).values
            if driven:
                for name, reached in _entries(model, numbers, signals, member.parameters).items():
                    if name in entries:
                        entries[name][row] = reached
        except BallpassError as fault:
            status, time = (fault.status.name, fault.time) if isinstance(fault, IntegrationError) else ("REFUSED", 0.0)
            failures.append(MemberFailure(member=row, status=status, time=time, message=str(fault)))
            continue
        random = stream(seed, member.kind, member.place, NOISE)
        for k, name in enumerate(signals.outputs):
            signal = found[name]
            if signals.sensor is not None:
                signal = signals.sensor.measured(signal, rate, random, signals.every, signals.before)
            if member.snr is not None:
                noise_rms[row, k] = np.std(signal) * 10.0 ** (-member.snr / 20.0)
                signal = signal + noise_rms[row, k] * random.standard_normal(len(signal))
            samples[name][row] = signal
    return Made(samples=samples, noise_rms=noise_rms, quantities=quantities, entries=entries, failures=tuple(failures))


def _entries(
    model: LoadedModel, numbers: Numbers, signals: Signals, parameters: Mapping[str, float]
) -> dict[str, np.ndarray]:
    """Times in the record at which a ball reaches a spall, by spall [s]."""
    end = signals.transient + signals.duration
    own = {name: np.array([value]) for name, value in parameters.items()}
    own = own or {info.name: np.array([info.default]) for info in model.manifest.parameters[:1]}
    known = {name: times[0] for name, times in entry_times(model, own, signals.transient, end).items()}
    found = {name: times[np.isfinite(times)] for name, times in known.items()}
    spalls = driven_spalls(model.manifest)
    if spalls:
        found |= {spalls[edge]: times for edge, times in entering_times(_recorded(model, numbers, signals)).items()}
    return found


def _recorded(model: LoadedModel, numbers: Numbers, signals: Signals) -> Run:
    """The recorded part of a run, which takes the steps of the one with samples."""
    turning = timeline.driver(model.manifest, numbers.values)
    span = Span.of(turning, duration=float(signals.times[-1]), transient=turning.turns(0.0, signals.transient))
    return resolve(model, numbers, Request(rtol=signals.rtol), span=replace(span, start=signals.transient))


def check_outputs(manifest: Manifest, signals: Signals, label: str, model: LoadedModel | None = None) -> None:
    """Refuse outputs that the model of a class does not have, or that have a value for each ball; and quantities.

    Parameters
    ----------
    model : where it is loaded: then also quantities that have no value with its numbers

    Raises
    ------
    RequestError
        All faults at once.
    """
    infos = {info.name: info for info in manifest.outputs}
    faults = []
    for name in signals.outputs:
        if name not in infos:
            faults.append(f"class {label}: {no_output(manifest, name, tuple(infos), 'output')}")
        elif infos[name].size != 1:
            faults.append(
                f"class {label}: {name} has a value for each {bearing_words('ball', manifest.bearings, name)}, and a "
                "signal has one. Allowed: outputs with one value, such as inner.ax or reaction.A.x."
            )
    try:
        if model is None:
            parse_quantities(manifest, signals.quantities)
        elif signals.quantities:
            quantities_of(model, signals.quantities)
    except RequestError as fault:
        faults += [f"class {label}: {line}" for line in str(fault).splitlines()]
    if faults:
        raise RequestError("\n".join(faults))
