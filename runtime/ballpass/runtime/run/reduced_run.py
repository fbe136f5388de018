"""A run of the project's own stepper that keeps reductions only, in bounded memory.

In: a model, numbers, a length of time.  Out: `Reductions`.  A run takes calls of `STEPS_A_CALL` steps, and its segments
are made some turns at a time; its bits are those of one call.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ballpass.runtime.contract.errors import RequestError, SimulationError
from ballpass.runtime.contract.parameters import Numbers, real
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.reduction_rows import reduction_rows
from ballpass.runtime.native.stepper import METHODS as STEPPERS
from ballpass.runtime.native.stepper import End, Family, Segments, Stepper
from ballpass.runtime.run import inputs as clock
from ballpass.runtime.run.failure_location import Whereabouts, whereabouts
from ballpass.runtime.run.limits import allowance
from ballpass.runtime.run.locating import choose_kinks, stepper_for
from ballpass.runtime.run.magnitudes import stepper_magnitudes
from ballpass.runtime.run.reductions import Reductions, channel_names, reductions_of
from ballpass.runtime.run.request import Request, check_length, run_length, tolerance
from ballpass.runtime.run.segments import edge_windows, make_segments, rest_of
from ballpass.runtime.run.stall import stall_words
from ballpass.runtime.run.start import start_state, start_time
from ballpass.runtime.run.stepping import STATUS_OF_END

#: Steps, accepted and rejected, that one call of the stepper takes: a fraction of a second.  Between calls progress is
#: told, and an interrupt or the wish of an ensemble to stop is heard.
STEPS_A_CALL = 50_000

#: Turns of a run that are looked at for the magnitudes of its states.
SCALED_TURNS = 16


def check_span(duration: float, turn: float, transient: float, begin: float = 0.0) -> float:
    """Time from which on is reduced [s].

    Raises
    ------
    RequestError
        The run is too long, the transient no number of turns from 0 on, nothing turns, or nothing is left of the run.
    """
    end = begin + duration
    check_length(end, turn)
    if not 0.0 <= transient < math.inf:
        raise RequestError(f"transient: a number of cycles from 0 on is expected, not {transient!r}.")
    if transient > 0.0 and not math.isfinite(turn):
        raise RequestError("transient: its cycles are turns, and nothing turns in this model. Set it to 0.")
    start = max(begin, transient * turn if transient > 0.0 else 0.0)
    if start >= end * (1.0 - 1e-9):
        raise RequestError(
            f"The run of {end / turn:g} cycles lies within its {transient:g} transient cycles: nothing is left. "
            "Run more cycles, or set fewer transient ones."
        )
    return start


def choose_family(asked: str) -> Family:
    """Family of the driver for a method's name.

    Raises
    ------
    RequestError
        Another method than the project's own stepper.
    """
    if asked == "auto":
        return Family.AUTO
    if asked not in STEPPERS:
        raise RequestError(
            f"method {asked!r}: reductions and ensembles are part of the project's own stepper. "
            f"Take auto or one of {', '.join(STEPPERS)}; for other methods call simulate and reduce its samples."
        )
    return STEPPERS[asked]


def reduce_run(model: LoadedModel, numbers: Numbers, request: Request) -> Reductions:
    """Integrate and reduce; what the request leaves open is as the scene's run settings say.

    Raises
    ------
    RequestError
        A wrong request.
    SimulationError
        The computation failed.
    """
    names = channel_names(model.manifest)
    run = start_reducing(model, numbers, request, names)
    run.on_to(run.end)
    found = reductions_of(
        model.manifest, run.row, names, end=run.state, steps=run.steps, rejected=run.rejected, turn=run.turn
    )
    assert found is not None  # `check_span` leaves some time
    return found


def start_reducing(model: LoadedModel, numbers: Numbers, request: Request, channels: Sequence[str]) -> ReducedRun:
    """A run that reduces these channels, before its first step; see `reduce_run`."""
    run = model.manifest.run
    method = request.method or run.method
    rtol = tolerance("rtol", run.rtol if request.rtol is None else request.rtol)
    initial = start_state(model, numbers, request.initial)
    turn = clock.period(model.manifest, numbers.values)
    duration = run_length(model, request, turn)
    transient = run.transient_cycles if request.transient_cycles is None else real(request.transient_cycles)
    begin = start_time(request.initial)
    start = check_span(duration, turn, transient, begin)
    family = choose_family(method)
    named = "stepper" if method == "auto" else method
    chosen = choose_kinks(request.kinks, named, model.manifest, rtol)
    looked_at = min(duration, SCALED_TURNS * turn)
    return ReducedRun(
        model=model,
        stepper=stepper_for(model, chosen),
        numbers=numbers,
        family=family,
        tolerance=rtol * stepper_magnitudes(model, model.stepper, numbers, initial, looked_at, turn, begin),
        state=initial.copy(),
        row=reduction_rows(model.manifest).empty(1, start, channels)[0],
        turn=turn,
        start=start,
        time=begin,
        end=begin + duration,
        progress=request.progress,
    )


@dataclass(slots=True, kw_only=True)
class ReducedRun:
    """A run that keeps reductions, as far as it has come.

    Attributes
    ----------
    state : at `time`, shape (states,)
    row : the reductions so far
    turn : time of a turn, infinite where nothing turns [s]
    start : from when on is reduced [s]
    time : how far it has come [s]
    end : how far it was asked to go [s]
    steps, rejected : so far
    """

    model: LoadedModel
    stepper: Stepper
    numbers: Numbers
    family: Family
    tolerance: np.ndarray
    state: np.ndarray
    row: np.ndarray
    turn: float
    start: float
    time: float
    end: float
    progress: Callable[[float], None] | None
    steps: int = 0
    rejected: int = 0

    def on_to(self, time: float) -> None:
        """Integrate to a later time [s]; SimulationError where that fails."""
        steps, rejected = integrate_reduced(
            *(self.model, self.stepper, self.numbers, self.family, self.tolerance, self.state, self.row),
            (time, self.turn, self.start),
            progress=self.progress,
            begun=Begun(time=self.time, steps=self.steps + self.rejected),
        )
        self.time = time
        self.steps += steps
        self.rejected += rejected


def integrate_reduced(
    model: LoadedModel,
    stepper: Stepper,
    numbers: Numbers,
    family: Family,
    tolerance: np.ndarray,
    state: np.ndarray,
    row: np.ndarray,
    span: tuple[float, float, float],
    *,
    progress: Callable[[float], None] | None = None,
    stop: ctypes.c_int | None = None,
    begun: Begun | None = None,
) -> tuple[int, int]:
    """Integrate one run, adding to a reduction; `state` is brought to the end.  Returns steps, rejected steps.

    A run takes calls of `STEPS_A_CALL` steps; its bits are those of one that is not cut.

    Parameters
    ----------
    stepper : a driver with reductions
    span : time at the end, time of a turn, time from which on is reduced [s]
    progress : told the finished part between calls
    stop : ends the run between calls, with the reduction as it is, when it becomes nonzero
    begun : of a run that goes on where another driver ended, with its `state` and `row`

    Raises
    ------
    RunFailed
        The driver could not reach the end, or crawls.
    """
    duration, turn, start = span
    begun = begun or Begun()
    allowed = allowance(duration, turn, begun.time, begun.steps)
    before: Segments | None = None
    steps = rejected = 0
    for edges in edge_windows(model, numbers, duration, turn, start):
        before = left = make_segments(model.manifest.inputs, numbers, edges, before)
        if edges[-1] <= begun.time:
            continue
        if edges[0] < begun.time:
            rest = rest_of(left, begun.time, model.manifest.inputs, numbers)
            if rest is None:
                continue
            left = rest
        held, taken = stepper.hold(), 0
        while True:
            outcome = stepper.run(
                family=family,
                tolerance=tolerance,
                p=numbers.p,
                c=numbers.c,
                x=state,
                segments=left,
                output_times=np.zeros(0),
                output_states=None,
                reduction=row,
                max_steps=taken + min(STEPS_A_CALL, allowed.left),
                held=held,
            )
            more = outcome.steps + outcome.rejected - taken  # an outcome counts those of all calls
            taken += more
            gives_up = allowed.spend(more, outcome.time)
            if outcome.end is not End.DONE and (gives_up or outcome.end is not End.TOO_MANY_STEPS):
                place = whereabouts(model, numbers, outcome.time, state)
                detail = stall_words(model, numbers, state) if outcome.end is End.STALLED else ""
                raise RunFailed(outcome.end, outcome.time, outcome.step, place, detail)
            if progress is not None:
                progress(outcome.time / duration)
            if stop is not None and stop.value:
                return steps + outcome.steps, rejected + outcome.rejected
            if outcome.end is End.DONE:
                break
        steps += outcome.steps
        rejected += outcome.rejected
    return steps, rejected


@dataclass(frozen=True, slots=True, kw_only=True)
class Begun:
    """How far a run has come by another driver: time [s], and steps, accepted and rejected."""

    time: float = 0.0
    steps: int = 0


class RunFailed(SimulationError):
    """The driver could not reach the end of a run."""

    def __init__(self, end: End, time: float, step: float, place: Whereabouts | None = None, detail: str = "") -> None:
        self.end, self.time, self.step, self.place = end, time, step, place
        self.status = STATUS_OF_END[end]
        angle = f", crank angle {math.degrees(place.crank_angle):.4f} deg" if place is not None else ""
        words = f" {place.words} {detail}" if place is not None else ""
        super().__init__(f"{self.status.value}\nt = {time:.9g} s{angle}, step size {step:.3g} s.{words}".rstrip())
