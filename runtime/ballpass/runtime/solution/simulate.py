"""Integrate a model from breakpoint to breakpoint and sample it.

In: a model, numbers, a request.  Out: a `Solution`.

1. The request is checked, and what it leaves open is taken from the scene (`resolve`, `sampling`).
2. The method fills the samples (`loop`: the project's own stepper; `casadi_run`: CasADi's).
3. The outputs asked for are evaluated at all samples at once (`trajectory`).
"""

from __future__ import annotations

import math
import time as clocks
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ballpass.runtime.contract.method_registry import STEPPERS
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.contract.status import Status
from ballpass.runtime.native.casadi_integrators import METHODS
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.reduction_rows import reduction_rows
from ballpass.runtime.native.stepper import End
from ballpass.runtime.ratings.result_limits import FLATTENED, void_words
from ballpass.runtime.request.locating import LOCATED, kinks_with_derivatives
from ballpass.runtime.request.request import Request, tolerance
from ballpass.runtime.request.resolve import Run, resolve
from ballpass.runtime.request.sampling import sampling_of
from ballpass.runtime.run.casadi_run import integrate
from ballpass.runtime.run.failure_location import ball_deflections, locate_failure, ring_distances
from ballpass.runtime.run.loop import ReductionRow, RunFailed, RunUnderWay, Samples, Sink, start_run
from ballpass.runtime.run.reductions import joined, reduced_channels, reductions_of
from ballpass.runtime.run.trajectory import Interrupted, Trajectory, evaluate_outputs, start_trajectory
from ballpass.runtime.solution.integration_error import IntegrationError
from ballpass.runtime.solution.solution import Solution, Statistics

if TYPE_CHECKING:
    from ballpass.runtime.run.directions import Directions


def simulate(
    model: LoadedModel, numbers: Numbers, request: Request, prepare: Callable[[int], Directions] | None = None
) -> Solution:
    """Run a model; with derivatives along the directions that `prepare` makes for a number of samples.

    Raises
    ------
    RequestError
        A wrong request: unknown method, tolerance or duration out of range, a linkage that cannot be assembled.
    IntegrationError
        The computation failed; the samples so far are in its attribute ``partial``.
    """
    started = clocks.perf_counter()
    sampling = sampling_of(model, request, numbers)
    # derivatives first: too many for the memory are refused before memory for the rest is allocated
    directions = prepare(len(sampling.times)) if prepare is not None else None
    run = resolve(model, numbers, request, span=sampling.span, stepper=False)
    if directions is not None:
        run = replace(run, kinks=kinks_with_derivatives(request.kinks, model.manifest))
        if request.sensitivity_rtol is not None:
            directions.control(tolerance("sensitivity_rtol", request.sensitivity_rtol), run.magnitude)
    trajectory, turn = start_trajectory(run, sampling), run.span.turning.turn
    channels = reduced_channels(model.manifest, sampling.outputs)
    layout = reduction_rows(model.manifest)
    rows = layout.empty(2, [run.start, 0.0], layout.all_of(channels), run.rtol)
    by_stepper = run.method in STEPPERS
    reducing = by_stepper and channels and directions is None
    going: RunUnderWay | None = None
    failure: RunFailed | Interrupted | None = None
    try:
        if by_stepper:
            samples = Samples(
                times=trajectory.t, x=trajectory.x, near=trajectory.near, end=run.end, directions=directions
            )
            sinks: list[Sink] = [samples, *([ReductionRow(row=rows[0], before=rows[1])] if reducing else [])]
            going = start_run(run, sinks, trajectory.segments)
            try:
                going.go_on()
            finally:
                _note(trajectory, samples, going)
        else:
            integrate(run, trajectory)
        if not reducing:
            _refuse_void(run, trajectory)
    except (RunFailed, Interrupted) as end:
        failure = end
    last = trajectory.x[max(trajectory.finished - 1, 0)] if len(trajectory.x) else run.initial
    counted, before = (
        reductions_of(
            model.manifest,
            row,
            channels,
            end=last,
            steps=trajectory.steps,
            rejected=trajectory.rejected,
            turn=turn,
        )
        for row in rows
    )
    if failure is not None and failure.status in (Status.VOID, Status.LOCKED):
        trajectory.finished = int(np.searchsorted(trajectory.t[: trajectory.finished], failure.time, side="right"))
    status = Status.DONE
    if failure is not None:
        state = failure.state if isinstance(failure, RunFailed) else last
        place = locate_failure(model, numbers, failure.time, state)
        status = Status.LOCKED if place.locked and failure.status is not Status.VOID else failure.status
    done = trajectory.finished
    solution = Solution(
        t=trajectory.t[:done],
        x=trajectory.x[:done],
        outputs=evaluate_outputs(model, numbers, trajectory, sampling.outputs),
        parameters=numbers.parameters,
        constants={info.name: numbers.values[info.name] for info in model.manifest.constants},
        cycle_length=turn if math.isfinite(turn) else None,
        transient_cycles=run.span.transient,
        manifest=model.manifest,
        statistics=_statistics(run, trajectory, going, clocks.perf_counter() - started),
        status=status,
        model=model,
        reductions=joined(before, counted),
        steady_reductions=counted,
    )
    if failure is not None:
        raise IntegrationError(
            status, time=failure.time, place=place, method=run.method, detail=failure.detail, partial=solution
        )
    return solution


def _refuse_void(run: Run, trajectory: Trajectory) -> None:
    """Refuse samples in which a ball is flattened as none can be, where nothing else than samples is kept of a run."""
    manifest, values, samples = run.model.manifest, run.numbers.values, trajectory.finished
    first = int(np.searchsorted(trajectory.t[:samples], run.start - trajectory.near))
    counted = slice(first if first < samples else 0, samples)
    apart = ring_distances(manifest, values, trajectory.x[counted].T)
    # far from it wherever the balls are
    near = [values[f"{bearing.path}.ball_diameter"] * FLATTENED / 2.0 for bearing in manifest.bearings]
    if not apart.size or np.all(np.max(apart, axis=1) < near):
        return
    times, states = trajectory.t[counted], trajectory.x[counted]
    found = [ball_deflections(run.model, run.numbers, time, state) for time, state in zip(times, states, strict=True)]
    for bearing, tables in zip(manifest.bearings, zip(*found, strict=True), strict=True):
        most = np.max(tables, axis=1)
        worst = int(np.argmax(most))
        if words := void_words(bearing, values, float(most[worst])):
            time, state = float(times[worst]), states[worst]
            raise RunFailed(End.VOID, time, 0.0, state, locate_failure(run.model, run.numbers, time, state), words)


def _note(trajectory: Trajectory, samples: Samples, going: RunUnderWay) -> None:
    """Note how many samples the stepper has filled."""
    trajectory.finished, trajectory.calls = samples.finished, going.calls
    trajectory.steps, trajectory.rejected = going.steps, going.rejected
    edges = trajectory.segments.times[:-1]
    trajectory.passed = max(int(np.searchsorted(edges, going.reached - trajectory.near)), 1)


def _statistics(run: Run, trajectory: Trajectory, going: RunUnderWay | None, wall_time: float) -> Statistics:
    reason = run.reason
    if going is not None and going.families:
        reason = f"{reason}; {', '.join(dict.fromkeys(going.families))} at the end"
    return Statistics(
        method=run.method,
        reason=reason,
        rtol=run.rtol,
        magnitudes=tuple(run.magnitude.tolist()),
        steps=trajectory.steps,
        rejected=trajectory.rejected,
        kinks=run.kinks if going is not None else None,
        located=going.located if going is not None and run.kinks == LOCATED else None,
        initial=tuple(run.initial.tolist()),
        begin=run.begin,
        duration=run.duration,
        segments=trajectory.passed,
        calls=trajectory.calls,
        wall_time=wall_time,
        compiled=run.model.compiled and run.method not in METHODS,
    )
