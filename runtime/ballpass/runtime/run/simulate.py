"""Integrate a model from breakpoint to breakpoint and sample it.

In: a model, numbers, a request.  Out: a `Solution`.

1. The request is checked, and what it leaves open taken from the scene (`request`).
2. The run is split where a load switches and at every whole turn (`segments`).
3. A method is chosen; tolerances are relative to the magnitudes of the states (`magnitudes`).
4. The method fills the samples (`stepping`: the project's own; `pieces`: CasADi's).
5. The outputs asked for are evaluated at all samples at once (`trajectory`).
"""

from __future__ import annotations

import math
import time as clocks
import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.extras import INSTALL_COMPILER
from ballpass.runtime.contract.parameters import Numbers, unknown_name
from ballpass.runtime.contract.status import Status
from ballpass.runtime.native.casadi_integrators import METHODS
from ballpass.runtime.native.loaded_model import LoadedModel, NoKernelsWarning
from ballpass.runtime.native.reduction_rows import reduction_rows
from ballpass.runtime.native.stepper import METHODS as STEPPERS
from ballpass.runtime.run.failure_location import whereabouts
from ballpass.runtime.run.integration_error import IntegrationError
from ballpass.runtime.run.locating import choose_kinks, kinks_with_derivatives
from ballpass.runtime.run.magnitudes import model_scales, stepper_magnitudes
from ballpass.runtime.run.pieces import integrate
from ballpass.runtime.run.reductions import joined, reduced_channels, reductions_of
from ballpass.runtime.run.request import Plan, Request, make_plan
from ballpass.runtime.run.solution import Solution, Statistics
from ballpass.runtime.run.stall import stall_words
from ballpass.runtime.run.stepping import step_through
from ballpass.runtime.run.trajectory import Cost, Interrupted, Trajectory, evaluate_outputs, start_trajectory

if TYPE_CHECKING:
    from ballpass.runtime.run.directions import Directions

#: Linearly implicit steps suit above this ratio of fastest decay to fastest natural frequency.  Measured on a press
#: with four degrees of freedom and eight balls at rtol 1e-6: explicit steps take the same time at a ratio of 2, twice
#: as long at 7, because they are bounded by 3.3 / decay while a linearly implicit one costs three of them.
STIFF_RATIO = 3.0


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
    plan = make_plan(model, numbers, request)
    # derivatives first: what would not fit into memory is told before there is memory for the rest
    directions = prepare(len(plan.times)) if prepare is not None else None
    interval = (plan.begin, plan.end)
    start = max(plan.begin, plan.transient_cycles * plan.turn if plan.transient_cycles > 0.0 else 0.0)
    trajectory = start_trajectory(
        model, numbers, plan.times, plan.initial, interval, plan.turn, even=plan.even, start=start
    )
    method, reason, magnitude = _choose(model, numbers, request.method, plan, trajectory)
    kinks = (
        choose_kinks(request.kinks, method, model.manifest, plan.rtol)
        if prepare is None
        else kinks_with_derivatives(request.kinks, model.manifest)
    )
    channels = reduced_channels(model.manifest, plan.outputs)
    # the edge at the start may lie a rounding before it
    rows = reduction_rows(model.manifest).empty(2, [start - trajectory.near, 0.0], channels)
    failure = None
    cost = Cost()
    try:
        if directions is not None and plan.sensitivity_rtol is not None:
            directions.control(plan.sensitivity_rtol, magnitude)
        if method in STEPPERS:
            step_through(
                *(model, numbers, STEPPERS[method], plan.rtol * magnitude, trajectory, cost),
                progress=request.progress,
                directions=directions,
                kinks=kinks,
                reductions=rows if channels and directions is None else None,
            )
        else:
            integrator = METHODS[method](model.virtual_integrator) if method != "none" else None
            integrate(numbers, integrator, plan.rtol * magnitude, trajectory, cost, request.progress)
    except Interrupted as end:
        failure = end
    if cost.families:
        reason = f"{reason}; {', '.join(dict.fromkeys(cost.families))} at the end"

    done = trajectory.finished
    counted, before = (
        reductions_of(
            model.manifest,
            row,
            channels,
            end=trajectory.x[max(done - 1, 0)] if len(trajectory.x) else trajectory.initial,
            steps=cost.steps,
            rejected=cost.rejected,
            turn=trajectory.turn,
        )
        for row in rows
    )
    solution = Solution(
        t=trajectory.t[:done],
        x=trajectory.x[:done],
        outputs=evaluate_outputs(model, numbers, trajectory, plan.outputs),
        parameters=numbers.parameters,
        constants={info.name: numbers.values[info.name] for info in model.manifest.constants},
        cycle_length=plan.turn if math.isfinite(plan.turn) else None,
        transient_cycles=plan.transient_cycles,
        manifest=model.manifest,
        statistics=Statistics(
            method=method,
            reason=reason,
            rtol=plan.rtol,
            magnitudes=tuple(magnitude.tolist()),
            steps=cost.steps,
            rejected=cost.rejected,
            kinks=cost.kinks,
            located=cost.located,
            initial=tuple(plan.initial.tolist()),
            begin=plan.begin,
            duration=plan.duration,
            segments=trajectory.passed,
            calls=trajectory.calls,
            wall_time=clocks.perf_counter() - started,
            compiled=model.compiled and method not in METHODS,
        ),
        status=Status.DONE if failure is None else failure.status,
        model=model,
        reductions=joined(before, counted),
        steady_reductions=counted,
    )
    if failure is not None:
        state = trajectory.x[max(done - 1, 0)] if failure.state is None else failure.state
        place = whereabouts(model, numbers, failure.time, state)
        if failure.status is Status.STALLED:
            failure.detail += f" {stall_words(model, numbers, state)}"
        raise IntegrationError(
            failure.status, time=failure.time, place=place, method=method, detail=failure.detail, partial=solution
        )
    return solution


def _choose(
    model: LoadedModel, numbers: Numbers, asked: str | None, plan: Plan, trajectory: Trajectory
) -> tuple[str, str, np.ndarray]:
    """Method, the reason for it, and the magnitudes of the states."""
    if not len(plan.initial):
        return "none", "the model has no states: its outputs follow from time alone", np.zeros(0)
    name = asked or model.manifest.run.method
    method, reason = choose_method(model, name)
    if method not in STEPPERS:
        scales = model_scales(model, numbers, plan.initial, plan.duration, plan.turn, plan.begin)
        return method, reason, scales.magnitude
    edges = trajectory.segments.times
    magnitude = stepper_magnitudes(
        model, model.stepper, numbers, plan.initial, plan.duration, plan.turn, plan.begin, edges
    )
    return method, reason, magnitude


def method_names(model: LoadedModel) -> tuple[str, ...]:
    """Integration methods of a model, besides ``auto``."""
    return (*(STEPPERS if model.has_stepper else ()), *(METHODS if model.has("rhs") else ()))


def choose_method(model: LoadedModel, asked: str) -> tuple[str, str]:
    """Name of the method and the reason for it.

    Raises
    ------
    RequestError
        No such method, or the model was generated without it.
    """
    if asked == "auto" and model.has_stepper:
        return "stepper", "the fastest method that a compiler allows"
    if asked in STEPPERS and model.has_stepper:
        return asked, "asked for"
    if asked == "auto" and model.compiled:
        reason = f" ({model.manifest.unfit})" if model.manifest.unfit else ""
        warnings.warn(
            f"{model.manifest.scene}: the generated folder has no kernels for the project's own stepper, which does "
            f"not take such a scene{reason}. CasADi's functions and integrators run instead: results are the same "
            "within the tolerance, a simulation takes some ten times as long, and there are no ensembles, reductions "
            "and derivatives of runs. Name the method to run it without this warning.",
            NoKernelsWarning,
            stacklevel=4,
        )
    available = ("auto", *method_names(model))
    if asked == "auto":
        if "cvodes" in available:
            return "cvodes", "the method that runs without the project's own stepper"
        raise RequestError("The model has no right-hand side to integrate. Generate it again with `ballpass derive`.")
    if asked in STEPPERS:
        missing = (
            "the generated folder has no kernels for it; write it again with `ballpass derive`"
            if model.compiled
            else f"it needs a C compiler, and none was found. {INSTALL_COMPILER}"
        )
        raise RequestError(f"method {asked}: {missing}. Or take one of {', '.join(available)}.")
    if asked not in available:
        raise RequestError(unknown_name("method", asked, available))
    return asked, "asked for"
