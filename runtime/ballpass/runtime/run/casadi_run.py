"""A run by CasADi's integrator: segment after segment, in pieces that end at samples.

In: a run and its `Trajectory`.  Out: the same, filled.
"""

from __future__ import annotations

import contextlib

import numpy as np

from ballpass.runtime.contract.method_registry import NOT_INTEGRATED
from ballpass.runtime.contract.status import Status
from ballpass.runtime.native import casadi_integrators
from ballpass.runtime.native.kernel import EvaluationError
from ballpass.runtime.request.resolve import Run
from ballpass.runtime.run.trajectory import Interrupted, Trajectory


def integrate(run: Run, trajectory: Trajectory) -> None:
    """Fill the samples of `trajectory`, and count steps; without a method there are no states to fill.

    Raises
    ------
    Interrupted
        The integrator could not reach the end.
    """
    if run.method == NOT_INTEGRATED:
        trajectory.finished = len(trajectory.t)
        trajectory.passed = len(trajectory.segments.inputs)
        return
    segments, stops = trajectory.segments, trajectory.stops
    state = run.initial.copy()
    for k, u in enumerate(segments.inputs):
        given = np.concatenate([u, run.numbers.p, run.numbers.c])
        interval = (float(segments.times[k]), float(segments.times[k + 1]))
        trajectory.passed = k + 1
        state = _segment(run, trajectory, given, state, interval, (int(stops[k]), int(stops[k + 1])))
        if run.progress is not None:
            run.progress((interval[1] - run.begin) / run.duration)


def _segment(
    run: Run,
    trajectory: Trajectory,
    given: np.ndarray,
    state: np.ndarray,
    interval: tuple[float, float],
    samples: tuple[int, int],
) -> np.ndarray:
    """Integrate over one segment; the state at its end.

    Parameters
    ----------
    given : inputs, parameters and constants, one behind the other
    """
    left, right = interval
    k, stop = samples
    times, near = trajectory.t, trajectory.near
    now = left

    def go(until: float, intervals: int) -> np.ndarray:
        nonlocal now, state
        trajectory.calls += 1
        function, piece = run.model.virtual_integrator(intervals), (now - left, until - now)
        try:
            block, steps, rejected = casadi_integrators.advance(function, state, piece, run.tolerance, given)
        except EvaluationError as fault:
            raise Interrupted(Status.INTEGRATOR_FAILED, now, str(fault)) from fault
        trajectory.steps, trajectory.rejected = trajectory.steps + steps, trajectory.rejected + rejected
        if not np.isfinite(block).all():
            raise Interrupted(Status.NOT_FINITE, now, "")
        now, state = until, block[-1]
        return block

    def fill(size: int) -> None:
        """The next `size` samples, which one call can take."""
        nonlocal k
        last = float(times[k + size - 1])
        if last > now + near:
            trajectory.x[k : k + size] = go(last, size)
        else:
            trajectory.x[k : k + size] = state
        k += size
        trajectory.finished = k

    if k < stop:
        if times[k] > now + near:
            go(float(times[k]), 1)
        trajectory.x[k] = state
        k += 1
        trajectory.finished = k
        # a multistep method starts with tiny steps: where samples lie evenly, one start for all
        if trajectory.even and stop - k > 1:
            # a failed call gives no samples: they are computed one by one, to keep those before the failure
            with contextlib.suppress(Interrupted):
                fill(stop - k)
        for _ in range(stop - k):
            fill(1)
    if right > now + near:
        go(right, 1)
    return state
