"""Differences of a model from measured signals, spectra or quantities, with exact derivatives by all unknowns.

In: a model, trials, unknowns.  Out: `Misfit`, which gives differences and Jacobian as `scipy.optimize.least_squares`
takes them.

Unknowns are counted so that each is about one: parameters and shifts of time in shares of their ranges, gains by
themselves, offsets in deviations of their signal.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ballpass.runtime.ask.kept_parts import Arrays, KeptParts
from ballpass.runtime.ask.parameter_range import ParameterRange
from ballpass.runtime.contract.defaults import SENSITIVITY
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.fit.measured import Trial
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.quantity.grammar import quantities_of
from ballpass.runtime.quantity.nodes import fixed_nodes
from ballpass.runtime.quantity.quantity_run import QuantityRun
from ballpass.runtime.quantity.records import Quantity
from ballpass.runtime.quantity.track import ChannelValues, FollowedRun
from ballpass.runtime.request.locating import kinks_with_derivatives
from ballpass.runtime.request.request import Request
from ballpass.runtime.request.resolve import Run, resolve
from ballpass.runtime.run.directions import Chain
from ballpass.runtime.run.loop import segments_of

#: Kinds of unknowns that belong to the measurement, not to the machine.
NUISANCES = ("shift", "gain", "offset")


@dataclass(frozen=True, slots=True, kw_only=True)
class Unknown:
    """A number to find.

    Attributes
    ----------
    name, unit : for people; the unit is SI
    kind : ``parameter``, ``shift``, ``gain`` or ``offset``
    range : of a parameter or a shift; None for others, which have no bounds
    size : of an offset, the deviation of its signal [unit]
    record : place of the trial of a shift, or of the signal of a gain or offset
    """

    name: str
    unit: str
    kind: str
    range: ParameterRange | None = None
    size: float = 1.0
    record: int = 0

    @property
    def relative(self) -> bool:
        """Whether its changes are counted in shares of it: it cannot be zero."""
        if self.kind == "parameter" and self.range is not None:
            return self.range.low * self.range.high > 0.0
        return self.kind == "gain"

    def value(self, count: float) -> float:
        """The number that is counted so [unit]."""
        return self.range.at(count) if self.range is not None else self.size * count

    def slope(self, count: float) -> float:
        """Its derivative by the count."""
        return self.range.slope(count) if self.range is not None else self.size


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SignalRecord:
    """What one trial says of an output, a spectrum or quantities, without what is missing.

    Attributes
    ----------
    name : of the trial and the output
    channels : outputs that it is of
    unit : of the values
    axis : "time", "frequency", or "quantity" for values of their own
    trial : place of the trial
    kept : which of its samples there are, shape (samples,)
    t, values : times as recorded [s], or frequencies [Hz], or numbers, and samples, of the same shape
    sizes : in which the samples are counted, of the same shape
    quantities : one for each value; none for samples over time
    """

    name: str
    channels: tuple[str, ...]
    unit: str
    axis: str
    trial: int
    kept: np.ndarray
    t: np.ndarray
    values: np.ndarray
    sizes: np.ndarray
    quantities: tuple[Quantity, ...] = ()

    @property
    def noise(self) -> float:
        """Size of the noise from which its search begins."""
        return float(np.std(self.values)) if self.axis != "quantity" else 1.0


class Misfit:
    """Differences of outputs from measured signals.

    Parameters
    ----------
    model : the model
    trials : measured signals
    ranges : of the parameters to find
    begin : time of the run at the data's time zero [s]
    shift : range of an unknown shift of each trial's time; None for none
    gain, offset : whether each signal has an unknown one
    parameters : overrides of other parameters, SI
    rtol : tolerance of the runs [1]
    cycles, transient : length of runs for spectra and quantities, in turns

    Attributes
    ----------
    records, unknowns : in the order of differences and counts
    ranges : of the parameters
    decides : what decides the model's samples at given counts, beside the model; see `kept_parts`
    parts : keeps them; nothing at first

    Raises
    ------
    RequestError
        Times before the run's start, or numbers that a trial sets although they are to be found.
    """

    def __init__(
        self,
        model: LoadedModel,
        trials: Sequence[Trial],
        ranges: Sequence[ParameterRange],
        *,
        begin: float,
        shift: ParameterRange | None,
        gain: bool,
        offset: bool,
        parameters: Mapping[str, float],
        rtol: float,
        cycles: float | None,
        transient: float | None,
    ) -> None:
        self._model, self._trials, self.ranges, self._rtol = model, trials, tuple(ranges), rtol
        self._begin, self._fixed, self._shifted = begin, dict(parameters), shift is not None
        self._cycles, self._transient = cycles, transient
        self.parts = KeptParts(None, ())
        self.records = tuple(
            record
            for k, trial in enumerate(trials)
            for record in (*_signals(model, k, trial), *_others(model, k, trial))
        )
        self._runs = {
            k: QuantityRun(model, [item for record in self.records if record.trial == k for item in record.quantities])
            for k, trial in enumerate(trials)
            if trial.quantities
        }
        ends = (0.0,) if shift is None else (0.0, shift.low, shift.high)
        self._after = max(ends)
        for trial in trials:
            first = begin + float(trial.t[0]) + min(ends) if len(trial.t) else 0.0
            if first < 0.0:
                raise RequestError(
                    f"{trial.name}: its first sample is at {first:g} s of the run, which starts at 0 s. Say at which "
                    "time of the run the data's time is zero (--begin)."
                )
            twice = [one.name for one in ranges if one.name in trial.parameters]
            if twice:
                raise RequestError(f"{trial.name} sets {', '.join(twice)}, which are to be found. Leave them away.")
        found = [Unknown(name=one.name, unit=one.unit, kind="parameter", range=one) for one in ranges]
        if shift is not None:
            found += [
                Unknown(name=f"time shift of {trial.name}", unit="s", kind="shift", range=shift, record=k)
                for k, trial in enumerate(trials)
                if len(trial.t)
            ]
        for k, record in enumerate(self.records):
            if gain and record.axis != "quantity":
                found.append(Unknown(name=f"gain of {record.name}", unit="1", kind="gain", record=k))
            if offset and record.axis == "time":
                size = float(np.std(record.values))
                name = f"offset of {record.name}"
                found.append(Unknown(name=name, unit=record.unit, kind="offset", size=size, record=k))
        self.unknowns = tuple(found)
        samples = sum(len(record.values) for record in self.records)
        if samples <= len(found):
            raise RequestError(
                f"data: {samples} values for {len(found)} numbers to find. Allowed: more values than numbers."
            )
        self.decides = (
            *(self.unknowns, begin, shift, self._fixed, rtol, cycles, transient),
            *(sorted(trial.parameters.items()) for trial in trials),
            *((one.trial, one.channels, one.quantities) for one in self.records),
            *(part for one in self.records for part in (one.kept, one.t, one.sizes)),
        )
        self._place = {(one.kind, one.record): k for k, one in enumerate(found) if one.kind != "parameter"}

    @property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Of the counts."""
        low = [0.0 if one.range is not None else -np.inf for one in self.unknowns]
        return np.array(low), np.array([1.0 if one.range is not None else np.inf for one in self.unknowns])

    def values(self, counts: np.ndarray) -> np.ndarray:
        """Numbers that are counted so, SI."""
        return np.array([one.value(float(c)) for one, c in zip(self.unknowns, counts, strict=True)])

    @property
    def ranged(self) -> tuple[ParameterRange, ...]:
        """Ranges of the unknowns that have one, in order."""
        return tuple(one.range for one in self.unknowns if one.range is not None)

    def shares_of(self, values: Mapping[str, float]) -> np.ndarray:
        """Counts of the unknowns that have ranges, from values of parameters; no shift."""
        return np.array([one.share_of(values.get(one.name, 0.0)) for one in self.ranged])

    @property
    def linear(self) -> np.ndarray:
        """Places of the unknowns on which outputs depend linearly, gains and offsets."""
        return np.array([k for k, one in enumerate(self.unknowns) if one.kind in ("gain", "offset")], dtype=int)

    def runs(self, counts: np.ndarray) -> list[Run]:
        """Each trial's run."""
        return [self._run(k, self.values(counts)) for k in range(len(self._trials))]

    def _run(self, place: int, values: np.ndarray) -> Run:
        model, trial = self._model, self._trials[place]
        found = {one.name: float(value) for one, value in zip(self.ranges, values, strict=False)}
        numbers = model.numbers(self._fixed | dict(trial.parameters) | found)
        if len(trial.t):
            # of one length for all shifts, so that its steps are the same
            length = self._begin + float(trial.t[-1]) + self._after
            run = resolve(model, numbers, Request(duration=length, transient_cycles=0.0, rtol=self._rtol))
        else:
            asked = Request(cycles=self._cycles, transient_cycles=self._transient, rtol=self._rtol)
            run = resolve(model, numbers, asked).check_steady()
        return replace(run, kinks=kinks_with_derivatives(None, model.manifest))

    def outputs(self, counts: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Of each record the model's samples, shape (samples,), and their derivatives by the counts.

        Raises
        ------
        RequestError
            Parameters that cannot be simulated.
        SimulationError
            A run failed.
        """
        ends = np.cumsum([len(record.values) for record in self.records])[:-1]
        y, jacobian = self.parts.once(counts, lambda: self._outputs(counts))
        return list(zip(np.split(y, ends), np.split(jacobian, ends), strict=True))

    def _outputs(self, counts: np.ndarray) -> Arrays:
        values = self.values(counts)
        slopes = [one.slope(float(c)) for one, c in zip(self.unknowns, counts, strict=True)]
        shifts = [values[self._place.get(("shift", k), -1)] if self._shifted else 0.0 for k in range(len(self._trials))]
        runs = [self._measured(k, values, float(shift)) for k, shift in enumerate(shifts)]
        names = len(self.ranges)
        found = []
        for place, record in enumerate(self.records):
            plain, by_parameters, by_time = runs[record.trial][record.name]
            at = {kind: self._place.get((kind, record.trial if kind == "shift" else place)) for kind in NUISANCES}
            gain = 1.0 if at["gain"] is None else values[at["gain"]]
            y, jacobian = gain * plain, np.zeros((len(plain), len(values)))
            jacobian[:, :names] = gain * by_parameters * slopes[:names]
            if at["shift"] is not None:
                jacobian[:, at["shift"]] = gain * by_time * slopes[at["shift"]]
            if at["gain"] is not None:
                jacobian[:, at["gain"]] = plain
            if at["offset"] is not None:
                y = y + values[at["offset"]]
                jacobian[:, at["offset"]] = slopes[at["offset"]]
            found.append((y, jacobian))
        return np.concatenate([y for y, _ in found]), np.concatenate([slope for _, slope in found])

    def _measured(self, place: int, values: np.ndarray, shift: float) -> dict[str, Arrays]:
        """Samples of a trial by record, with derivatives by the parameters and by time."""
        run, records = self._run(place, values), [one for one in self.records if one.trial == place]
        if place in self._runs:
            names = [one.name for one in self.ranges]
            found = iter(self._runs[place].differentiate(run, names, SENSITIVITY * self._rtol).estimates)
            rows = [[next(found) for _ in one.quantities] for one in records]
            return {
                one.name: (
                    np.array([item.value for item in row]) / one.sizes,
                    np.array([item.slope for item in row]) / one.sizes[:, None],
                    np.zeros(len(row)),
                )
                for one, row in zip(records, rows, strict=True)
            }
        samples = self._sampled(place, run, shift)
        return {one.name: tuple(part[one.kept] for part in samples[one.channels[0]]) for one in records}

    def _sampled(self, place: int, run: Run, shift: float) -> dict[str, Arrays]:
        """All samples of a trial by output, likewise."""
        model, trial, names = self._model, self._trials[place], [one.name for one in self.ranges]
        numbers = run.numbers
        segments = segments_of(run)
        # the first parameter once more, at times that move by one: the difference to it is the derivative by time
        chain = Chain(model, numbers, [*names, names[0]])
        t = self._begin + trial.t + shift
        moving = np.zeros((len(t), len(names) + 1))
        moving[:, -1] = 1.0
        held = np.clip(np.searchsorted(segments.times, t, side="right") - 1, 0, len(segments.times) - 2)
        nodes = replace(fixed_nodes(t, held, held), slope=moving)
        motion = FollowedRun(run=run, segments=segments, still=not model.states)
        track = motion.along(nodes, chain, SENSITIVITY * self._rtol)
        signals = ChannelValues(model, list(trial.signals)).along(track, numbers, chain)
        found: dict[str, Arrays] = {}
        for name, signal in signals.items():
            slope = signal.slope[:, 0]
            found[name] = (signal.value[:, 0], slope[:, :-1], slope[:, -1] - slope[:, 0])
        return found


def _signals(model: LoadedModel, place: int, trial: Trial) -> Iterator[SignalRecord]:
    units = {info.name: info.unit for info in (*model.manifest.states, *model.manifest.outputs)}
    for output, values in trial.signals.items():
        kept = np.isfinite(values)
        yield SignalRecord(
            name=f"{output} of {trial.name}",
            channels=(output,),
            unit=units[output],
            axis="time",
            trial=place,
            kept=kept,
            t=trial.t[kept],
            values=values[kept],
            sizes=np.ones(np.count_nonzero(kept)),
        )


def _others(model: LoadedModel, place: int, trial: Trial) -> Iterator[SignalRecord]:
    for one in trial.quantities:
        quantities = quantities_of(model, one.names)
        spectrum = len(one.frequencies) > 0
        yield SignalRecord(
            name=one.name,
            channels=tuple(dict.fromkeys(item.channel for item in quantities)),
            unit=one.unit if spectrum else "1",
            axis="frequency" if spectrum else "quantity",
            trial=place,
            kept=np.ones(len(one.values), dtype=bool),
            t=one.frequencies if spectrum else np.arange(1.0, 1.0 + len(one.values)),
            values=one.values / one.sizes,
            sizes=one.sizes,
            quantities=quantities,
        )
