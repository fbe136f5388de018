"""A run by the project's own stepper: many segments in a call, and a run that takes long in several calls.

In: a `Trajectory`.  Out: the same, filled.  Progress is shown, and an interrupt heard, between calls; so a call takes
so many segments and steps at most.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.contract.status import Status
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.stepper import End, Family, Outcome
from ballpass.runtime.run.limits import LEAST_PROGRESS, STEPS_A_LOOK, least_progress, step_limit
from ballpass.runtime.run.locating import LOCATED, STEPPED_OVER, Kinks, stepper_for
from ballpass.runtime.run.segments import part_of, rest_of
from ballpass.runtime.run.trajectory import Cost, Interrupted, Trajectory

if TYPE_CHECKING:
    from ballpass.runtime.run.directions import Directions

#: Segments that one call of the stepper takes, ...
SEGMENTS_A_CALL = 600

#: ... and steps, accepted and rejected: a fraction of a second.  Behind each call that takes them all it is looked at
#: whether the run comes on.
STEPS_A_CALL = STEPS_A_LOOK

#: What the ways of the stepper to end mean to people.
STATUS_OF_END = {
    End.TOO_MANY_STEPS: Status.TOO_MANY_STEPS,
    End.STEP_TOO_SMALL: Status.STEP_TOO_SMALL,
    End.NOT_FINITE: Status.NOT_FINITE,
    End.BAD_ARGUMENT: Status.INTEGRATOR_FAILED,
    End.STALLED: Status.STALLED,
}


def step_through(
    model: LoadedModel,
    numbers: Numbers,
    family: Family,
    tolerance: np.ndarray,
    trajectory: Trajectory,
    cost: Cost,
    *,
    progress: Callable[[float], None] | None = None,
    directions: Directions | None = None,
    kinks: Kinks = STEPPED_OVER,
    reductions: np.ndarray | None = None,
) -> None:
    """Fill the samples of `trajectory`; with derivatives along `directions`.

    Parameters
    ----------
    reductions : two rows to add to: of the time that counts, and of that before; not with derivatives

    Raises
    ------
    Interrupted
        The stepper could not reach the end.
    """
    cost.kinks, cost.located = kinks, 0 if kinks == LOCATED else None
    stepper = stepper_for(model, kinks, derivatives=directions is not None)
    inputs = model.manifest.inputs
    state = trajectory.initial.copy()
    span = trajectory.end - trajectory.begin
    allowed = step_limit(span, trajectory.turn)
    least = least_progress(span, trajectory.turn, LEAST_PROGRESS, STEPS_A_CALL)
    for first, last in _calls(trajectory.segments.restarts, whole=directions is not None):
        left = part_of(trajectory.segments, first, last)
        sample, stop = int(trajectory.stops[first]), int(trajectory.stops[last])
        # a sample that rounding puts beside an edge lies on it
        wanted = np.clip(trajectory.t[sample:stop], left.times[0], left.times[-1])
        step = 0.0
        while True:
            start = float(left.times[0])
            outcome = stepper.run(
                family=family,
                tolerance=tolerance,
                p=numbers.p,
                c=numbers.c,
                x=state,
                segments=left,
                output_times=wanted,
                output_states=trajectory.x[sample:stop],
                tangents=None if directions is None else directions.tangents(left, sample, stop - sample),
                reduction=None if reductions is None else reductions[0],
                before=None if reductions is None else reductions[1],
                max_steps=STEPS_A_CALL,
                first_step=step,
            )
            cost.steps += outcome.steps
            cost.rejected += outcome.rejected
            if cost.located is not None:
                cost.located += outcome.kinks
            if family is Family.AUTO:
                cost.families.append(outcome.family.name.lower())
            allowed -= outcome.steps + outcome.rejected
            trajectory.calls += 1
            trajectory.finished = sample = sample + outcome.written
            if progress is not None:
                progress((outcome.time - trajectory.begin) / span)
            if outcome.end is End.DONE:
                break
            crawls = outcome.time - start < least or allowed <= 0
            if outcome.end is not End.TOO_MANY_STEPS or crawls:
                failure = _failure(model, trajectory, outcome, start)
                failure.state = state
                if directions is not None and directions.controlled:
                    failure.detail += (
                        " The derivatives took part in the choice of steps: a looser sensitivity_rtol may come through."
                    )
                raise failure
            rest = rest_of(left, outcome.time, inputs, numbers)
            if rest is None:
                break
            left, wanted, step = rest, wanted[outcome.written :], outcome.step
        trajectory.passed = last


def _calls(restarts: np.ndarray, *, whole: bool) -> Iterator[tuple[int, int]]:
    """First and last segment (excluded) of each call.

    Parameters
    ----------
    restarts : whether a load jumps at the start of each segment
    whole : no call begins at a jump.  The derivative at fixed time jumps there by the difference of the rates before
        and behind, and a call knows no rate from before its start.
    """
    first, count = 0, len(restarts)
    while first < count:
        last = min(first + SEGMENTS_A_CALL, count)
        while whole and last < count and restarts[last]:
            last += 1
        yield first, last
        first = last


def _failure(model: LoadedModel, trajectory: Trajectory, outcome: Outcome, start: float) -> Interrupted:
    edges = trajectory.segments.times[:-1]
    trajectory.passed = max(int(np.searchsorted(edges, outcome.time, side="right")), 1)
    detail = f"Step size {outcome.step:.3g} s"
    if outcome.state >= 0:
        detail += f", worst state {model.states[outcome.state]}"
    if outcome.end is End.TOO_MANY_STEPS:
        detail += (
            f", {outcome.steps + outcome.rejected} steps for the last {outcome.time - start:.3g} s "
            f"of {trajectory.end - trajectory.begin:.6g} s"
        )
    return Interrupted(STATUS_OF_END[outcome.end], outcome.time, f"{detail}.")
