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

from raceway.runtime.accuracy.quasi_static import NAME as QUASI_STATIC
from raceway.runtime.accuracy.quasi_static import STATUS_OF_END as STATUS_AT_REST
from raceway.runtime.accuracy.quasi_static import End as EndAtRest
from raceway.runtime.accuracy.quasi_static_runs import QuasiStaticFailed
from raceway.runtime.assembly import check_assembly
from raceway.runtime.ensembles.ensemble_driver import BALL_CHANNELS, EnsembleDriver
from raceway.runtime.ensembles.members import edge_windows
from raceway.runtime.errors import RequestError, SimulationError
from raceway.runtime.integrate import clock
from raceway.runtime.integrate.magnitudes import stepper_magnitudes
from raceway.runtime.integrate.reductions import (
    SCALED_TURNS,
    RunFailed,
    channel_names,
    check_span,
    observable_aliases,
    observe,
    step_limit,
)
from raceway.runtime.integrate.simulate import fill
from raceway.runtime.integrate.stepper import METHODS as STEPPERS
from raceway.runtime.integrate.stepper import End, Segments
from raceway.runtime.integrate.stepping import Cost
from raceway.runtime.integrate.trajectory import Interrupted, evaluate_outputs, start_trajectory
from raceway.runtime.parameters import unknown_name
from raceway.runtime.request import Request, run_length, start_state

if TYPE_CHECKING:
    from raceway.runtime.model import Model
    from raceway.runtime.parameters import Numbers

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
    """

    model: Model
    numbers: Numbers
    initial: np.ndarray
    magnitude: np.ndarray
    duration: float
    turn: float
    start: float
    segments: Segments

    @property
    def cycles(self) -> float:
        """Turns of the run; 1 where nothing turns."""
        return self.duration / self.turn if math.isfinite(self.turn) else 1.0

    def run(
        self,
        observables: Sequence[Observable],
        method: str,
        rtol: float,
        driver: EnsembleDriver | None = None,
        max_steps: int | None = None,
    ) -> Integrated:
        """Integrate and reduce.

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
        driver = driver or self.model.ensemble_driver
        row = driver.reductions(1, self.start, {channel for _, channel in observables})[0]
        state = self.initial.copy()
        tolerance = rtol * self.magnitude
        if method == QUASI_STATIC:
            seconds, steps = self._at_rest(tolerance, state, row)
        else:
            begin = _now()
            outcome = driver.stepper.run(
                family=STEPPERS[method],
                tolerance=tolerance,
                p=self.numbers.p,
                c=self.numbers.c,
                x=state,
                segments=self.segments,
                output_times=np.zeros(0),
                output_states=None,
                reduction=row,
                max_steps=max_steps if max_steps is not None else step_limit(self.duration, self.turn),
            )
            seconds, steps = _now() - begin, outcome.steps
            if outcome.end is not End.DONE:
                raise RunFailed(outcome.end, outcome.time, outcome.step)
        found = tuple(float(observe(driver, *one, row[None], state[None])[0]) for one in observables)
        return Integrated(values=found, seconds=seconds, steps=steps)

    def _at_rest(self, tolerance: np.ndarray, state: np.ndarray, row: np.ndarray) -> tuple[float, int]:
        model, numbers = self.model, self.numbers
        driver = model.quasi_static
        # an equilibrium has no transient: what lies before the time that counts need not be followed
        first = int(np.searchsorted(self.segments.times, self.start))
        kept = Segments(
            times=self.segments.times[first:].copy(),
            inputs=self.segments.inputs[first:].copy(),
            restarts=self.segments.restarts[first:].copy(),
        )
        begin = _now()
        outcome = driver.run(
            tolerance=tolerance,
            p=numbers.p,
            c=numbers.c,
            x=state,
            segments=kept,
            output_times=np.zeros(0),
            output_states=None,
            reduction=row,
        )
        seconds = _now() - begin
        if outcome.end is not EndAtRest.DONE:
            angle = clock.crank_angle(model.manifest, numbers.values, outcome.time)
            raise QuasiStaticFailed(STATUS_AT_REST[outcome.end], outcome.time, angle)
        return seconds, outcome.steps

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
        for kind, channel in observables:
            series = outputs[channel].max(axis=1) if channel in wanted else trajectory.x[:, names.index(channel)]
            found.append(_of_samples(kind, series[counted]))
        return Integrated(values=tuple(found), seconds=seconds, steps=cost.steps)


def prepare(
    model: Model,
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
    return Prepared(
        model=model,
        numbers=numbers,
        initial=state,
        magnitude=stepper_magnitudes(model, driver, numbers, state, looked_at, turn),
        duration=length,
        turn=turn,
        start=start,
        segments=_segments(model, numbers, length, turn, start),
    )


def _segments(model: Model, numbers: Numbers, duration: float, turn: float, start: float) -> Segments:
    windows = [*edge_windows(model, numbers, duration, turn, start)]
    edges = np.concatenate([windows[0], *(window[1:] for window in windows[1:])])
    inputs = model.manifest.inputs
    u = np.array([clock.inputs_at(inputs, numbers.values, a, 0.5 * (a + b)) for a, b in pairwise(edges)])
    u = np.ascontiguousarray(u.reshape(len(edges) - 1, len(inputs)))
    gates = [k for k, info in enumerate(inputs) if info.kind != "phase"]
    restarts = np.concatenate([[True], np.any(np.diff(u[:, gates], axis=0) != 0.0, axis=1)])
    return Segments(times=edges, inputs=u, restarts=restarts)


def check_observables(model: Model, names: Sequence[str]) -> tuple[Observable, ...]:
    """Kind and channel of observables by name: ``peak_ball_force``, ``rms:inner.y``.

    Raises
    ------
    RequestError
        Unknown names, or kinds that have no relative error.
    """
    aliases = observable_aliases(channel_names(model.manifest))
    known = {name: found for name, found in aliases.items() if found[0] in KINDS}
    faults = [unknown_name("quantity", name, known) for name in names if name not in known]
    if isinstance(names, str) or not names or faults:
        raise RequestError(
            "\n".join(faults) or f"A list of quantities is expected, not {names!r}. Example: ['peak_ball_force']."
        )
    return tuple(known[name] for name in names)


#: Kinds of observables whose relative error means something.
KINDS = ("max", "min", "mean", "rms", "range")


def default_observables(model: Model) -> tuple[str, ...]:
    """Peak ball force, rms and range of the inner ring's motion."""
    rings = [state.name for state in model.manifest.states if state.name in ("inner.x", "inner.y")]
    return ("peak_ball_force", *(f"{kind}_{name.replace('.', '_')}" for kind in ("rms", "range") for name in rings))


def _of_samples(kind: str, values: np.ndarray) -> float:
    if kind == "range":
        return float(np.ptp(values))
    if kind in ("mean", "rms"):
        # the last sample repeats the first one's place in a cycle: trapezoidal rule
        powers = values if kind == "mean" else values**2
        mean = float(np.mean(0.5 * (powers[1:] + powers[:-1])))
        return mean if kind == "mean" else math.sqrt(mean)
    return float(values.max() if kind == "max" else values.min())
