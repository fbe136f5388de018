"""The loop around the project's own stepper, for everything that runs a model with it.

In: a `Run`, and sinks that take what it passes: samples, reductions, ends of steps.  Out: the sinks, filled.

A run is cut into windows of so many segments (`segments.run_windows`), each one run of the driver, made in calls
of so many steps: between calls progress is shown, and an interrupt or a stop of the ensemble takes effect.  The
sinks, and the number of steps in a call, change no bit of the motion.
"""

from __future__ import annotations

import ctypes
import math
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from ballpass.runtime.contract.errors import SimulationError
from ballpass.runtime.contract.method_registry import CHOICE, STEPPERS
from ballpass.runtime.contract.plausible_ranges import UnusualWarning
from ballpass.runtime.contract.status import Status
from ballpass.runtime.native.reduction_rows import HEAD, void_moment
from ballpass.runtime.native.stepper import End, Outcome, Segments, Stepper
from ballpass.runtime.request.assembly import may_lock
from ballpass.runtime.request.locating import LOCATED, stepper_for
from ballpass.runtime.request.resolve import Run
from ballpass.runtime.request.segments import SEGMENTS_A_CALL, joined_segments, rest_of, run_windows
from ballpass.runtime.run.driver_stops import driver_stop
from ballpass.runtime.run.failure_location import FailureLocation, locate_failure, stall_words
from ballpass.runtime.run.limits import allowance

if TYPE_CHECKING:
    from ballpass.runtime.run.directions import Directions

#: Steps, accepted and rejected, that one call of the stepper takes: a fraction of a second.
STEPS_A_CALL = 50_000

#: Status of a run for each end of the stepper.
STATUS_OF_END = {
    End.TOO_MANY_STEPS: Status.TOO_MANY_STEPS,
    End.STEP_TOO_SMALL: Status.STEP_TOO_SMALL,
    End.NOT_FINITE: Status.NOT_FINITE,
    End.BAD_ARGUMENT: Status.INTEGRATOR_FAILED,
    End.STALLED: Status.STALLED,
    End.VOID: Status.VOID,
}


class RunFailed(SimulationError):
    """The stepper could not reach the end of a run.

    Attributes
    ----------
    end, time, step, state : how it ended, when [s], the last step size [s], the state there, shape (states,)
    place : angle and most loaded ball then
    detail : further text of the message
    """

    def __init__(
        self, end: End, time: float, step: float, state: np.ndarray, place: FailureLocation, detail: str
    ) -> None:
        self.end, self.time, self.step, self.state, self.place, self.detail = end, time, step, state, place, detail
        self.status = Status.LOCKED if place.locked and end is not End.VOID else STATUS_OF_END[end]
        angle = f", crank angle {math.degrees(place.crank_angle):.4f} deg"
        super().__init__(f"{self.status.value}\nt = {time:.9g} s{angle}. {detail} {place.words}".rstrip())


class Sink(Protocol):
    """Takes data of a run."""

    def arguments(self, segments: Segments, goes_on: bool) -> dict[str, Any]:
        """Arguments of `Stepper.run` for it.

        Parameters
        ----------
        segments : of the call
        goes_on : whether the call continues the one before, whose segments were the same
        """

    def take(self, outcome: Outcome) -> None:
        """Note the results of a call."""


@dataclass(slots=True, kw_only=True, eq=False)
class Samples:
    """States at times, and their derivatives.

    Attributes
    ----------
    times : increasing, shape (samples,) [s]
    x : states there, shape (samples, states)
    near : times closer than this are one time [s]
    end : of the run [s]
    directions : to differentiate along
    finished : samples filled
    """

    times: np.ndarray
    x: np.ndarray
    near: float
    end: float
    directions: Directions | None = None
    finished: int = 0
    _first: int = 0
    _given: dict[str, Any] = field(default_factory=dict)

    def arguments(self, segments: Segments, goes_on: bool) -> dict[str, Any]:
        """Those samples that lie in the segments; one at their end is the next call's."""
        if goes_on:
            return self._given
        left, right = float(segments.times[0]), float(segments.times[-1])
        stop = len(self.times) if right >= self.end else int(np.searchsorted(self.times, right - self.near))
        first = self._first = self.finished
        stop = max(stop, first)
        # a sample beside an edge by rounding lies on it
        self._given = {
            "output_times": np.clip(self.times[first:stop], left, right),
            "output_states": self.x[first:stop],
        }
        if self.directions is not None:
            self._given["tangents"] = self.directions.tangents(segments, first, stop - first)
        return self._given

    def take(self, outcome: Outcome) -> None:
        """Note how many are filled."""
        self.finished = self._first + outcome.written


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReductionRow:
    """A row of reductions that a run adds to, and one for the time before that one begins."""

    row: np.ndarray
    before: np.ndarray | None = None

    def arguments(self, segments: Segments, goes_on: bool) -> dict[str, Any]:
        """The rows themselves."""
        return {"reduction": self.row, "before": self.before}

    def take(self, outcome: Outcome) -> None:
        """Nothing: the driver has added to the rows."""


@dataclass(slots=True, kw_only=True, eq=False)
class KeptSteps:
    """The accepted steps, from which states at any time of the run can be read.

    Attributes
    ----------
    numbers : of each step (`Stepper.kept`)
    check : called with how many there are, before more memory is taken for them
    count : steps so far
    parts : of them, shape (steps, numbers): of each its end [s] first, then 1.0 where it lies on a kink, else 0.0
    """

    numbers: int
    check: Callable[[int], None] = lambda _steps: None
    count: int = 0
    parts: list[np.ndarray] = field(default_factory=list)
    _room: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        self._room = np.empty((STEPS_A_CALL, self.numbers))

    def arguments(self, segments: Segments, goes_on: bool) -> dict[str, Any]:
        """Room for those of a call."""
        return {"kept": self._room}

    def take(self, outcome: Outcome) -> None:
        """Keep those of a call."""
        self.count += outcome.kept
        self.check(self.count)
        self.parts.append(self._room[: outcome.kept].copy())

    @property
    def all(self) -> np.ndarray:
        """Those of the whole run, shape (steps, numbers)."""
        if len(self.parts) == 1:
            return self.parts[0]
        return np.concatenate([np.empty((0, self.numbers)), *self.parts])


@dataclass(slots=True, kw_only=True, eq=False)
class RunUnderWay:
    """A run by the stepper, up to the time reached.

    Attributes
    ----------
    run : what runs
    sinks : take its data
    state : at `time`, shape (states,)
    time : from which it can continue [s]
    reached : time reached [s]
    stop : ends it between calls when it becomes nonzero
    segments : of the whole run, where they are known and one window; None: they are made
    steps, rejected, located, calls : counts; `located` of kinks
    families : the last family of an automatic choice, call by call
    """

    run: Run
    sinks: Sequence[Sink] = ()
    state: np.ndarray
    time: float
    stop: ctypes.c_int | None = None
    segments: Segments | None = None
    steps: int = 0
    rejected: int = 0
    located: int = 0
    calls: int = 0
    reached: float = 0.0
    families: list[str] = field(default_factory=list)

    def go_on(self, until: float | None = None) -> None:
        """Integrate to the end of the run, or to a time, which may lie after it [s].

        Raises
        ------
        RunFailed
            The driver could not reach the end, or its steps are too small.
        """
        run, until = self.run, self.run.end if until is None else until
        directions = next((sink.directions for sink in self.sinks if isinstance(sink, Samples)), None)
        stepper = stepper_for(run.model, run.kinks, derivatives=directions is not None)
        watched = next((sink for sink in self.sinks if isinstance(sink, KeptSteps)), None)
        if watched is None and may_lock(run.model, run.numbers):
            watched = KeptSteps(numbers=stepper.kept)
        sinks = self.sinks if watched is None or watched in self.sinks else (*self.sinks, watched)
        allowed = allowance(until - run.begin, run.stretch, self.time, self.steps + self.rejected)
        windows: Iterable[Segments] = (self.segments,) if self.segments is not None else ()
        if self.segments is None or (self.time, until) != (run.begin, run.end):
            windows = run_windows(run.model, run.numbers, (self.time, until), run.stretch, run.start)
        # a derivative at fixed time jumps with a load, and a call does not have the rate before its start
        for left in joined_segments(windows) if directions is not None else windows:
            held, taken, first_step = (stepper.hold() if directions is None else None), 0, 0.0
            goes_on = False
            while True:
                arguments = {key: value for sink in sinks for key, value in sink.arguments(left, goes_on).items()}
                arguments.setdefault("output_times", np.zeros(0))
                arguments.setdefault("output_states", None)
                more = min(STEPS_A_CALL, allowed.left)
                outcome = stepper.run(
                    method=STEPPERS[run.method],
                    tolerance=run.tolerance,
                    p=run.numbers.p,
                    c=run.numbers.c,
                    x=self.state,
                    segments=left,
                    max_steps=(taken if held is not None else 0) + more,
                    held=held,
                    first_step=first_step,
                    **arguments,
                )
                for sink in sinks:
                    sink.take(outcome)
                before = taken if held is not None else 0  # with `held` an outcome counts those of all its calls
                taken = outcome.steps + outcome.rejected
                self.calls += 1
                self.reached = outcome.time
                gives_up = allowed.spend(taken - before, outcome.time)
                if outcome.end is not End.DONE and (gives_up or outcome.end is not End.TOO_MANY_STEPS):
                    self._count(outcome)
                    self._refuse_stop(stepper, watched)
                    raise self._failure(outcome, directions)
                if run.progress is not None:
                    run.progress((outcome.time - run.begin) / (until - run.begin))
                done = outcome.end is End.DONE
                stopped = self.stop is not None and bool(self.stop.value)
                if done or stopped or held is None:
                    self._count(outcome)
                    self.time = outcome.time
                if stopped:
                    return
                if done:
                    break
                goes_on = held is not None
                if held is None:
                    rest = rest_of(left, outcome.time, run.model.manifest, run.numbers)
                    if rest is None:
                        break
                    left, first_step = rest, outcome.step
        self.time = until
        self._refuse_stop(stepper, watched)
        self._refuse_void()

    def _refuse_stop(self, stepper: Stepper, watched: KeptSteps | None) -> None:
        """Refuse a run whose driver came to where the linkage locks."""
        stop = None if watched is None else driver_stop(self.run, stepper, watched.all)
        if stop is not None:
            place = locate_failure(self.run.model, self.run.numbers, *stop)
            raise RunFailed(End.STEP_TOO_SMALL, stop[0], 0.0, stop[1], place, "The driver does not go on there.")

    def _refuse_void(self) -> None:
        """Refuse results in which a ball is flattened as none can be, at the moment where it is most.

        They are those behind the transient; all of a run that ends within it.  What is so in the transient alone is a
        warning.
        """
        run, values = self.run, self.run.numbers.values
        for sink in self.sinks:
            if not isinstance(sink, ReductionRow):
                continue
            within = not sink.row[HEAD.index("duration")] > 0.0
            row = sink.before if within and sink.before is not None else sink.row
            found = void_moment(run.model.manifest, values, row)
            early = None if sink.before is None else void_moment(run.model.manifest, values, sink.before)
            if found is None and early is not None:
                text = f"Before the turns that count, t = {early[1]:.3g} s: {early[0]}"
                warnings.warn(text, UnusualWarning, stacklevel=3)
            if found is not None:
                why, time = found
                there = start_run(replace(run, progress=None), [])
                if time > run.begin:
                    there.go_on(time)  # again, for the state at that moment
                place = locate_failure(run.model, run.numbers, time, there.state)
                raise RunFailed(End.VOID, time, 0.0, there.state, place, why)

    def _count(self, outcome: Outcome) -> None:
        self.steps += outcome.steps
        self.rejected += outcome.rejected
        self.located += outcome.kinks if self.run.kinks == LOCATED else 0
        if self.run.method == CHOICE:
            self.families.append(outcome.method)

    def _failure(self, outcome: Outcome, directions: Directions | None) -> RunFailed:
        run = self.run
        detail = f"Step size {outcome.step:.3g} s"
        if outcome.state >= 0:
            detail += f", worst state {run.model.states[outcome.state]}"
        if outcome.end is End.TOO_MANY_STEPS:
            past = outcome.time - run.begin
            detail += f", {self.steps + self.rejected} steps for the first {past:.3g} s of {run.duration:.6g} s"
        detail += "."
        if directions is not None and directions.controlled:
            detail += " The derivatives took part in the choice of steps: a looser sensitivity_rtol may come through."
        if outcome.end is End.STALLED:
            detail += f" {stall_words(run.model, run.numbers, self.state)}"
        place = locate_failure(run.model, run.numbers, outcome.time, self.state)
        return RunFailed(outcome.end, outcome.time, outcome.step, self.state, place, detail)


def segments_of(run: Run) -> Segments:
    """All segments of a run."""
    windows = run_windows(run.model, run.numbers, (run.begin, run.end), run.stretch, run.start)
    (segments,) = joined_segments(windows, all_=True)
    return segments


def steps_of(run: Run) -> np.ndarray:
    """The accepted steps of a run, shape (steps, numbers), see `KeptSteps`; SimulationError where it fails."""
    kept = KeptSteps(numbers=stepper_for(run.model, run.kinks).kept)
    start_run(run, [kept]).go_on()
    return kept.all


def start_run(run: Run, sinks: Sequence[Sink], segments: Segments | None = None) -> RunUnderWay:
    """A run before its first step; `segments`: all of it, where they are known."""
    known = segments if segments is not None and len(segments.inputs) < SEGMENTS_A_CALL else None
    return RunUnderWay(run=run, sinks=sinks, state=run.initial.copy(), time=run.begin, segments=known)
