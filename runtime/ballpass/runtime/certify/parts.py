"""A run in parts: each with reductions of its own and the state at its start, so that one part can be run once more.

In: a prepared run, a way to integrate.  Out: `InParts`; values of observables over any parts side by side.  Parts are
whole turns where the run has some, so that the parts of a periodic motion are alike; in a long run several turns are a
part, in a short one a part is a piece of a turn.  Samples can be written on the way: values, samples and states at the
starts of the parts are those of one integration.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ballpass.runtime.certify.quasi_static import NAME as QUASI_STATIC
from ballpass.runtime.certify.quasi_static import STATUS_OF_END as STATUS_AT_REST
from ballpass.runtime.certify.quasi_static import End as EndAtRest
from ballpass.runtime.certify.quasi_static_runs import QuasiStaticFailed
from ballpass.runtime.native.ensemble_driver import EnsembleDriver
from ballpass.runtime.native.reduction_rows import HEAD, ROWS
from ballpass.runtime.native.stepper import METHODS as STEPPERS
from ballpass.runtime.native.stepper import End
from ballpass.runtime.run import inputs as clock
from ballpass.runtime.run.reduced_run import RunFailed
from ballpass.runtime.run.reductions import observe
from ballpass.runtime.run.segments import part_of
from ballpass.runtime.run.trajectory import Trajectory

if TYPE_CHECKING:
    from ballpass.runtime.certify.prepared import Observable, Prepared

#: Parts that a run without a transient falls into at least, and the time that counts at most.  Each is a call of its
#: own, and begins with a small step.
FEWEST, MOST = 4, 8

#: Where else parts begin: so many of their lengths before the time that counts, for companions that start earlier.
BEFORE = (4, 2, 1)

#: Segments that one call takes: an interrupt is heard, and progress shown, between calls.
SEGMENTS_A_CALL = 600


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InParts:
    """An integration of some parts of a run, one after the other.

    Attributes
    ----------
    first : the first of the parts
    rows : reductions of each, shape (parts, .)
    states : at the start of each, and at the end of the last, shape (parts + 1, states)
    seconds : of the integration alone [s]
    steps, rejected : of all of them
    calls : of the integrator
    """

    first: int
    rows: np.ndarray
    states: np.ndarray
    seconds: float
    steps: int
    rejected: int
    calls: int

    def of(self, first: int, behind: int) -> np.ndarray:
        """Reductions of the parts of the run from `first` on, `behind` excluded."""
        return self.rows[first - self.first : behind - self.first]


def part_times(duration: float, turn: float, start: float) -> np.ndarray:
    """Times at which the parts of a run begin, and its end [s].

    Parameters
    ----------
    duration, turn : of the run, and of a turn, infinite where nothing turns [s]
    start : end of the transient, where a part begins [s]
    """
    unit = turn if FEWEST * turn <= duration * (1.0 + 1e-9) else duration / FEWEST
    near = 1e-9 * unit
    length = unit * max(1, math.ceil((math.ceil((duration - start - near) / unit)) / MOST))
    # backwards from the end: the part that is cut short comes first
    counted = duration - length * np.arange(math.ceil((duration - start - near) / length))[::-1]
    before = start - length * np.array(BEFORE)
    return np.concatenate([[0.0], before[before > near], [start] if start > near else [], counted])


def integrate_parts(
    run: Prepared,
    observables: Sequence[Observable],
    method: str,
    rtol: float,
    *,
    first: int = 0,
    behind: int | None = None,
    state: np.ndarray | None = None,
    driver: EnsembleDriver | None = None,
    max_steps: int | None = None,
    trajectory: Trajectory | None = None,
    progress: Callable[[float], None] | None = None,
) -> InParts:
    """Integrate parts of a run by the stepper or the quasi-static model.

    Parameters
    ----------
    first, behind : the parts, the last one excluded.  Default: all
    state : where the first of them begins, shape (states,).  Default: the start of the run
    driver : another compilation of the stepper
    max_steps : accepted and rejected.  Default: as many as any run may take
    trajectory : samples of the whole run to fill on the way
    progress : called with the finished fraction of the run

    Raises
    ------
    SimulationError
        The method could not reach the end.
    """
    driver = driver or run.model.ensemble_driver
    last = len(run.parts) - 1 if behind is None else behind
    rows = driver.reductions(last - first, run.start, {channel for _, channel in observables})
    x = (run.initial if state is None else state).copy()
    states = np.empty((last - first + 1, len(x)))
    at_rest, tolerance = method == QUASI_STATIC, rtol * run.magnitude
    left = run.step_limit if max_steps is None else max_steps
    seconds, step = 0.0, 0.0
    steps = rejected = calls = 0
    for part, row in enumerate(rows, first):
        states[part - first] = x
        # an equilibrium has no transient: without samples to fill, what lies before the time that counts is left out
        if at_rest and trajectory is None and run.segments.times[run.parts[part]] < run.start:
            continue
        for low in range(run.parts[part], run.parts[part + 1], SEGMENTS_A_CALL):
            high = min(low + SEGMENTS_A_CALL, run.parts[part + 1])
            segments = part_of(run.segments, low, high)
            wanted, filled = _samples(trajectory, low, high)
            if at_rest and trajectory is None and low == run.parts[part]:
                # the equilibrium at its start, which no part before has led to
                wanted, filled = segments.times[:1].copy(), states[part - first : part - first + 1]
            begin = run.now()
            if at_rest:
                still = run.model.quasi_static.run(
                    tolerance=tolerance,
                    p=run.numbers.p,
                    c=run.numbers.c,
                    x=x,
                    segments=segments,
                    output_times=wanted,
                    output_states=filled,
                    reduction=row,
                )
                seconds += run.now() - begin
                if still.end is not EndAtRest.DONE:
                    angle = clock.crank_angle(run.model.manifest, run.numbers.values, still.time)
                    raise QuasiStaticFailed(STATUS_AT_REST[still.end], still.time, angle)
                steps, rejected = steps + still.steps, rejected + still.rejected
            else:
                moved = driver.stepper.run(
                    family=STEPPERS[method],
                    tolerance=tolerance,
                    p=run.numbers.p,
                    c=run.numbers.c,
                    x=x,
                    segments=segments,
                    output_times=wanted,
                    output_states=filled,
                    reduction=row,
                    max_steps=left,
                    first_step=0.0 if segments.restarts[0] else step,
                )
                seconds += run.now() - begin
                if moved.end is not End.DONE:
                    raise RunFailed(moved.end, moved.time, moved.step)
                left, step = max(left - moved.steps - moved.rejected, 1), moved.step
                steps, rejected = steps + moved.steps, rejected + moved.rejected
            calls += 1
            if progress is not None:
                progress(float(segments.times[-1]) / run.duration)
    states[-1] = x
    if trajectory is not None:
        trajectory.finished, trajectory.passed, trajectory.calls = len(trajectory.t), len(run.segments.inputs), calls
    return InParts(first=first, rows=rows, states=states, seconds=seconds, steps=steps, rejected=rejected, calls=calls)


def values_of(run: Prepared, observables: Sequence[Observable], rows: np.ndarray) -> np.ndarray:
    """Observables over parts side by side, shape (observables,).

    Parameters
    ----------
    rows : reductions of the parts, shape (parts, .)
    """
    driver = run.model.ensemble_driver
    counted = rows[rows[:, HEAD.index("duration")] > 0.0]
    if not len(counted):
        return np.full(len(observables), np.nan)
    one = counted[:1].copy()
    width = len(driver.rows.channels)
    columns = {kind: len(HEAD) + ROWS.index(kind) * width + np.arange(width) for kind in ROWS}
    one[0, HEAD.index("duration")] = counted[:, HEAD.index("duration")].sum()
    for kind in ("integral", "square"):
        one[0, columns[kind]] = counted[:, columns[kind]].sum(axis=0)
    one[0, columns["max"]] = counted[:, columns["max"]].max(axis=0)
    one[0, columns["min"]] = counted[:, columns["min"]].min(axis=0)
    end = np.zeros((1, len(run.initial)))
    return np.array([float(observe(driver.rows, *observable, one, end)[0]) for observable in observables])


def _samples(trajectory: Trajectory | None, low: int, high: int) -> tuple[np.ndarray, np.ndarray | None]:
    """Times of the samples within segments, and the memory for their states."""
    if trajectory is None:
        return np.zeros(0), None
    sample, stop = int(trajectory.stops[low]), int(trajectory.stops[high])
    times = trajectory.segments.times
    # a sample that rounding puts beside an edge lies on it
    return np.clip(trajectory.t[sample:stop], times[low], times[high]), trajectory.x[sample:stop]
