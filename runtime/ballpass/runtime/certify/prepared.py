"""A run prepared up to the integration itself: what is left is what methods and tolerances differ in, and can be timed.

In: a model, parameters, a length of run.  Out: `Prepared`, whose `run` integrates by a method at a tolerance and gives
observables and the time of the integration alone.  Checks, magnitudes of the states, edges and inputs of the segments
are common to all methods; they are made once and not timed.
"""

from __future__ import annotations

import math
import time as clocks
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from ballpass.runtime.certify.parts import integrate_parts, part_times, values_of
from ballpass.runtime.certify.quasi_static import NAME as QUASI_STATIC
from ballpass.runtime.contract.errors import RequestError, SimulationError
from ballpass.runtime.contract.parameters import unknown_name
from ballpass.runtime.native.ensemble_driver import EnsembleDriver
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.reduction_rows import BALL_CHANNELS
from ballpass.runtime.native.stepper import METHODS as STEPPERS
from ballpass.runtime.native.stepper import Segments
from ballpass.runtime.point.assembly import check_assembly
from ballpass.runtime.run import inputs as clock
from ballpass.runtime.run.limits import brief_limit
from ballpass.runtime.run.magnitudes import stepper_magnitudes
from ballpass.runtime.run.reduced_run import SCALED_TURNS, check_span
from ballpass.runtime.run.reductions import channel_names, observable_aliases, observe
from ballpass.runtime.run.request import Request, run_length, start_state
from ballpass.runtime.run.segments import WORK, check_count, edge_windows, make_segments, segment_edges
from ballpass.runtime.run.simulate import fill
from ballpass.runtime.run.stepping import Cost
from ballpass.runtime.run.trajectory import Interrupted, Trajectory, evaluate_outputs, start_trajectory

if TYPE_CHECKING:
    from ballpass.runtime.contract.parameters import Numbers

#: Time of this thread on its processor where the system counts it finely: other programs do not enter.
_now = clocks.thread_time if clocks.get_clock_info("thread_time").resolution < 1e-5 else clocks.perf_counter

#: An observable: kind (max, min, mean, rms, range) and channel.
Observable = tuple[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Integrated:
    """What an integration gave.

    Attributes
    ----------
    values : observables in the order they were asked for
    seconds : of the integration alone [s]
    steps : accepted, None where the method does not tell
    """

    values: tuple[float, ...]
    seconds: float
    steps: int | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prepared:
    """A run that is ready to be integrated, any number of times.

    Attributes
    ----------
    model, numbers : of the run
    initial : state at the start, shape (states,)
    magnitude : of the states, shape (states,)
    duration, turn, start : length, time of a turn, time from which on is reduced [s]
    segments : of the whole run
    parts : first segment of each part of the run, and behind them the number of segments (see
        `ballpass.runtime.certify.parts`)
    """

    model: LoadedModel
    numbers: Numbers
    initial: np.ndarray
    magnitude: np.ndarray
    duration: float
    turn: float
    start: float
    segments: Segments
    parts: tuple[int, ...]

    @property
    def cycles(self) -> float:
        """Turns of the run; 1 where nothing turns."""
        return self.duration / self.turn if math.isfinite(self.turn) else 1.0

    @property
    def step_limit(self) -> int:
        """Most steps that an integration may take, accepted and rejected: less than a run that is the only way."""
        return brief_limit(self.duration, self.turn)

    @staticmethod
    def now() -> float:
        """The clock that integrations are timed by [s]."""
        return _now()

    def run(
        self,
        observables: Sequence[Observable],
        method: str,
        rtol: float,
        driver: EnsembleDriver | None = None,
        max_steps: int | None = None,
    ) -> Integrated:
        """Integrate and reduce, in parts as `--error` does: where parts begin, steps do, and errors depend on that.

        Parameters
        ----------
        method : one of the stepper's, ``quasi-static``, or one of CasADi's, which is sampled as the scene says
        driver : another compilation of the stepper
        max_steps : of the stepper, accepted and rejected.  Default: as many as any run may take

        Raises
        ------
        SimulationError
            The method could not reach the end.
        """
        if method not in STEPPERS and method != QUASI_STATIC:
            return self._sampled(observables, method, rtol)
        done = integrate_parts(self, observables, method, rtol, driver=driver, max_steps=max_steps)
        found = tuple(values_of(self, observables, done.rows).tolist())
        return Integrated(values=found, seconds=done.seconds, steps=done.steps)

    def _sampled(self, observables: Sequence[Observable], method: str, rtol: float) -> Integrated:
        """By one of CasADi's methods, from samples: these methods have no reductions on their way."""
        model, numbers = self.model, self.numbers
        count = max(1, round(model.manifest.run.samples_per_cycle * self.cycles))
        times = self.duration * (np.arange(count + 1) / count)
        trajectory = start_trajectory(model, numbers, times, self.initial, (0.0, self.duration), self.turn, even=True)
        cost = Cost()
        begin = _now()
        try:
            fill(model, numbers, method, rtol * self.magnitude, trajectory, cost)
        except Interrupted as fault:
            raise SimulationError(f"{fault.status.value}\nMethod {method}, t = {fault.time:.9g} s.") from None
        seconds = _now() - begin
        wanted = tuple(dict.fromkeys(c for _, c in observables if c in BALL_CHANNELS))
        outputs = evaluate_outputs(model, numbers, trajectory, wanted)
        counted = trajectory.t >= self.start * (1.0 - 1e-12)
        names = [state.name for state in model.manifest.states]
        found = []
        first = int(np.argmax(counted))
        for kind, channel in observables:
            series = outputs[channel].max(axis=1) if channel in wanted else trajectory.x[:, names.index(channel)]
            value = _of_samples(kind, series[counted])
            if kind in EXTREMES:
                value = self._between(kind, channel, trajectory, series, first, value)
            found.append(value)
        return Integrated(values=tuple(found), seconds=seconds, steps=cost.steps)

    def _between(
        self, kind: str, channel: str, trajectory: Trajectory, series: np.ndarray, first: int, value: float
    ) -> float:
        """An extreme, sought between the samples: from the sampled states, by a way that adds no error of its own.

        Parameters
        ----------
        series : the samples, of which those from `first` on count
        value : what the samples show
        """
        driver = self.model.ensemble_driver
        rows = driver.reductions(1, 0.0, {channel})
        last = len(series) - 1
        peaks = [] if kind == "min" else _tops(series[first:])
        dips = [] if kind == "max" else _tops(-series[first:])
        for k in sorted({first + k for k in (*peaks, *dips)}):
            low, high = max(k - 1, first), min(k + 1, last)
            edges = segment_edges(self.model, self.numbers, trajectory.t[low], trajectory.t[high], self.turn)
            method, rtol = CLOSELY
            driver.stepper.run(
                family=STEPPERS[method],
                tolerance=rtol * self.magnitude,
                p=self.numbers.p,
                c=self.numbers.c,
                x=trajectory.x[low].copy(),
                segments=make_segments(self.model.manifest.inputs, self.numbers, edges),
                output_times=np.zeros(0),
                output_states=None,
                reduction=rows[0],
            )
        end = np.zeros((1, len(self.initial)))
        seen = {what: float(observe(driver.rows, what, channel, rows, end)[0]) for what in ("max", "min")}
        if kind == "range":
            counted = series[first:]
            return max(seen["max"], float(counted.max())) - min(seen["min"], float(counted.min()))
        return max(seen["max"], value) if kind == "max" else min(seen["min"], value)


def prepare(
    model: LoadedModel,
    parameters: Mapping[str, float] | None = None,
    *,
    cycles: float | None = None,
    duration: float | None = None,
    transient: float | None = None,
    initial: np.ndarray | None = None,
) -> Prepared:
    """Prepare a run from t = 0.  What is not given is taken from the scene's run settings.

    Raises
    ------
    RequestError
        A wrong request, a linkage that cannot be assembled, or no compiler for the stepper.
    """
    numbers = model.numbers(parameters)
    check_assembly(model, numbers)
    turn = clock.period(model.manifest, numbers.values)
    request = Request(cycles=cycles, duration=duration, initial=initial)
    length = run_length(model, request, turn)
    start = check_span(length, turn, model.manifest.run.transient_cycles if transient is None else transient)
    state = start_state(model, numbers, initial)
    driver = model.ensemble_driver.stepper
    looked_at = min(length, SCALED_TURNS * turn)
    segments, parts = _segments(model, numbers, length, turn, start)
    return Prepared(
        model=model,
        numbers=numbers,
        initial=state,
        magnitude=stepper_magnitudes(model, driver, numbers, state, looked_at, turn),
        duration=length,
        turn=turn,
        start=start,
        segments=segments,
        parts=parts,
    )


def _segments(
    model: LoadedModel, numbers: Numbers, duration: float, turn: float, start: float
) -> tuple[Segments, tuple[int, ...]]:
    """Segments of a run, and where its parts begin among them."""
    times = part_times(duration, turn, start)
    check_count(model.manifest.inputs, numbers, duration, turn, columns=WORK + 2 * len(times))
    windows = [*edge_windows(model, numbers, duration, turn, start)]
    edges = np.concatenate([windows[0], *(window[1:] for window in windows[1:])])
    near = 1e-9 * min(turn, duration)
    closest = np.abs(edges[:, None] - times[None]).min(axis=0) if len(edges) * len(times) else np.zeros(0)
    edges = np.sort(np.concatenate([edges, times[closest > near]]))
    parts = tuple(int(np.argmin(np.abs(edges - time))) for time in times)
    inputs = model.manifest.inputs
    u = np.array([clock.inputs_at(inputs, numbers.values, a, 0.5 * (a + b)) for a, b in pairwise(edges)])
    u = np.ascontiguousarray(u.reshape(len(edges) - 1, len(inputs)))
    gates = [k for k, info in enumerate(inputs) if info.kind != "phase"]
    restarts = np.concatenate([[True], np.any(np.diff(u[:, gates], axis=0) != 0.0, axis=1)])
    return Segments(times=edges, inputs=u, restarts=restarts), parts


def check_observables(model: LoadedModel, names: Sequence[str]) -> tuple[Observable, ...]:
    """Kind and channel of observables by name: ``peak_ball_force``, ``rms:inner.y``.

    Raises
    ------
    RequestError
        Unknown names, or kinds that have no relative error.
    """
    aliases = observable_aliases(channel_names(model.manifest))
    known = {name: found for name, found in aliases.items() if found[0] in KINDS}
    faults = [_fault(model, name, known) for name in names if name not in known]
    if isinstance(names, str) or not names or faults:
        raise RequestError(
            "\n".join(faults) or f"A list of quantities is expected, not {names!r}. Example: ['peak_ball_force']."
        )
    return tuple(known[name] for name in names)


def _fault(model: LoadedModel, name: str, known: Mapping[str, Observable]) -> str:
    """Why there is no error of a quantity."""
    channel = str(name).rpartition(":")[2]
    offered = ", ".join(dict.fromkeys(channel for _, channel in known.values()))
    if channel.startswith(("reaction.", "drive_torque", "body.", "load.")) and any(
        channel in (info.name, info.name.rpartition(".")[0]) for info in model.manifest.quantities
    ):
        return (
            f"{name!r}: {channel} follows from time alone, by the kinematics of the mechanism; it has no error of "
            f"integration at any tolerance. Errors are measured of: {offered}."
        )
    return unknown_name("quantity", name, known)


#: Kinds of observables whose relative error means something.
KINDS = ("max", "min", "mean", "rms", "range")


def default_observables(model: LoadedModel) -> tuple[str, ...]:
    """Peak ball force, rms and range of the inner ring's motion."""
    rings = [state.name for state in model.manifest.states if state.name in ("inner.x", "inner.y")]
    return ("peak_ball_force", *(f"{kind}_{name.replace('.', '_')}" for kind in ("rms", "range") for name in rings))


#: Kinds that samples read too small.
EXTREMES = ("max", "min", "range")

#: So many of the largest samples are looked at closely, and how: what this adds to an error is below all others.
CANDIDATES, CLOSELY = 3, ("stepper-dop853", 1e-11)


def _tops(series: np.ndarray) -> list[int]:
    """Indices of the largest samples that no neighbour exceeds."""
    padded = np.pad(series, 1, constant_values=-np.inf)
    top = np.flatnonzero((series >= padded[:-2]) & (series >= padded[2:]))
    return [int(k) for k in top[np.argsort(-series[top], kind="stable")[:CANDIDATES]]]


def _of_samples(kind: str, values: np.ndarray) -> float:
    if kind == "range":
        return float(np.ptp(values))
    if kind in ("mean", "rms"):
        # the last sample repeats the first one's place in a cycle: trapezoidal rule
        powers = values if kind == "mean" else values**2
        mean = float(np.mean(0.5 * (powers[1:] + powers[:-1])))
        return mean if kind == "mean" else math.sqrt(mean)
    return float(values.max() if kind == "max" else values.min())
