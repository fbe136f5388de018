"""Integrate a model from breakpoint to breakpoint and sample it.

In: a model, numbers, a request.  Out: a `Solution`.

The run is split where a load switches and at every whole turn.  Within such a segment gates and slopes are constant,
the phases are taken anew at its start, and the integrator lands exactly on its end.  Samples lie on one uniform grid;
one that meets a breakpoint shows the state there with the loads behind it.
"""

from __future__ import annotations

import math
import time as clocks
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from raceway.runtime import clock
from raceway.runtime.errors import RequestError
from raceway.runtime.integrators import METHODS, Frozen, Integrator, available_methods
from raceway.runtime.kernel import EvaluationError
from raceway.runtime.parameters import Parameters, unknown_name
from raceway.runtime.scales import Scales, find_scales
from raceway.runtime.solution import Solution, Statistics
from raceway.runtime.status import IntegrationError, Status
from raceway.runtime.stepper import METHODS as STEPPERS
from raceway.runtime.stepper import End, Family, Segments

if TYPE_CHECKING:
    from raceway.runtime.model import Model
    from raceway.runtime.sensitivity import Directions

#: `auto` takes ``rosenbrock`` above this ratio of fastest decay to fastest natural frequency.  Measured on a press with
#: four degrees of freedom and eight balls at rtol 1e-6: both take equal time at a ratio of 2, ``erk`` twice as long at
#: 7, because its steps are bounded by 3.3 / decay while each of ``rosenbrock`` costs three of its steps.
STIFF_RATIO = 3.0

#: Segments that one call of the stepper takes: progress is shown, and an interrupt heard, between calls.
SEGMENTS_A_CALL = 600

#: Most numbers that the samples of a run may hold: 4 GiB.
MAX_NUMBERS = 2**29

#: Smallest and largest relative tolerance [1].
TOLERANCES = (1e-13, 1e-1)

#: Moments of the run that are looked at for magnitudes: so many between breakpoints, and so many evenly spread.
MOMENTS = 32


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """What to simulate; None takes the scene's run settings.

    Attributes
    ----------
    cycles, duration : turns of the driver or shaft, or time [s]; one of them
    method : a name of `METHODS`, or "auto"
    rtol : relative tolerance [1]
    samples_per_cycle : samples in a turn; in the whole run where nothing turns
    initial : state at the start, shape (states,)
    transient_cycles : turns at the start that `Solution.steady` leaves out
    progress : called with the finished fraction of the run
    """

    cycles: float | None = None
    duration: float | None = None
    method: str | None = None
    rtol: float | None = None
    samples_per_cycle: int | None = None
    initial: np.ndarray | None = None
    transient_cycles: float | None = None
    progress: Callable[[float], None] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Numbers:
    """The numbers of one run: parameters and constants, as vectors and by name."""

    parameters: Parameters
    p: np.ndarray
    c: np.ndarray
    values: dict[str, float]


@dataclass(slots=True, kw_only=True)
class Trajectory:
    """Samples on the way: times, states, and the reference time and inputs each sample is evaluated with."""

    t: np.ndarray
    x: np.ndarray
    reference: np.ndarray
    u: np.ndarray
    segments: int = 0
    calls: int = 0
    finished: int = 0


class Interrupted(Exception):
    """The integration ended early; the trajectory holds `finished` samples."""

    def __init__(self, status: Status, time: float, detail: str) -> None:
        super().__init__(detail)
        self.status, self.time, self.detail = status, time, detail


def simulate(
    model: Model, numbers: Numbers, request: Request, prepare: Callable[[int], Directions] | None = None
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
    run = model.manifest.run
    turn = clock.period(model.manifest, numbers.values)
    duration = run_length(model, request, turn)
    per_cycle = _whole("samples_per_cycle", request.samples_per_cycle, run.samples_per_cycle)
    count = max(1, round(per_cycle * duration / turn)) if math.isfinite(turn) else per_cycle
    transient = run.transient_cycles if request.transient_cycles is None else float(request.transient_cycles)
    if not 0.0 <= transient < math.inf:
        raise RequestError(f"transient: a number of cycles from 0 on is expected, not {transient!r}.")
    rtol = run.rtol if request.rtol is None else float(request.rtol)
    if not TOLERANCES[0] <= rtol <= TOLERANCES[1]:
        raise RequestError(f"rtol: a number from {TOLERANCES[0]:g} to {TOLERANCES[1]:g} is expected, not {rtol!r}.")
    initial = start_state(model, numbers, request.initial)

    if len(initial):
        scales = model_scales(model, numbers, initial, duration, turn)
        magnitude = scales.magnitude
        method, reason = choose_method(model, request.method or run.method, scales)
    else:
        magnitude = np.zeros(0)
        method, reason = "none", "the model has no states: its outputs follow from time alone"

    columns = len(initial) + sum(info.size for info in model.manifest.outputs) + len(model.manifest.inputs)
    if count * columns > MAX_NUMBERS:
        raise RequestError(
            f"{count} samples of {columns} numbers would not fit into memory. Take fewer samples a cycle or a shorter "
            "run, or keep extremes and means only: `Model.reduce` runs any number of cycles without samples."
        )
    times = duration * (np.arange(count + 1) / count)
    trajectory = start_trajectory(times, initial, len(model.manifest.inputs))
    failure = None
    cost = Cost()
    try:
        directions = prepare(len(times)) if prepare is not None else None
        fill(model, numbers, method, rtol * magnitude, trajectory, turn, cost, request.progress, directions)
    except Interrupted as end:
        failure = end
    if cost.families:
        reason = f"{reason}; {', '.join(dict.fromkeys(cost.families))} at the end"

    outputs = evaluate_outputs(model, numbers, trajectory)
    done = trajectory.finished
    solution = Solution(
        t=trajectory.t[:done],
        x=trajectory.x[:done],
        outputs=outputs,
        parameters=dict(numbers.parameters),
        constants={info.name: numbers.values[info.name] for info in model.manifest.constants},
        cycle_length=turn if math.isfinite(turn) else None,
        transient_cycles=transient,
        manifest=model.manifest,
        statistics=Statistics(
            method=method,
            reason=reason,
            rtol=rtol,
            magnitudes=tuple(float(value) for value in magnitude),
            steps=cost.steps,
            rejected=cost.rejected,
            segments=trajectory.segments,
            calls=trajectory.calls,
            wall_time=clocks.perf_counter() - started,
            compiled=model.compiled and method != "cvodes",
        ),
        status=Status.DONE if failure is None else failure.status,
    )
    if failure is not None:
        raise IntegrationError(
            failure.status,
            time=failure.time,
            crank_angle=clock.crank_angle(model.manifest, numbers.values, failure.time),
            method=method,
            detail=failure.detail,
            partial=solution,
        )
    return solution


@dataclass(slots=True, kw_only=True)
class Cost:
    """What an integration took: steps where the method tells, and the families the stepper ended with."""

    steps: int | None = 0
    rejected: int | None = 0
    families: list[str] = field(default_factory=list)


def fill(
    model: Model,
    numbers: Numbers,
    method: str,
    tolerance: np.ndarray,
    trajectory: Trajectory,
    turn: float,
    cost: Cost,
    progress: Callable[[float], None] | None = None,
    directions: Directions | None = None,
) -> None:
    """Fill the samples of `trajectory` by a method of that name ("none" for a model without states); notes the cost.

    Raises
    ------
    Interrupted
        The method could not reach the end.
    """
    if method in STEPPERS:
        step_through(model, numbers, STEPPERS[method], tolerance, trajectory, turn, cost, progress, directions)
        return
    integrator = METHODS[method].make(model) if method != "none" else None
    try:
        integrate(model, numbers, integrator, tolerance, trajectory, turn, progress)
    finally:
        if integrator is not None:
            cost.steps, cost.rejected = integrator.steps, integrator.rejected


def start_trajectory(times: np.ndarray, initial: np.ndarray, inputs: int) -> Trajectory:
    """Memory for samples at `times`, with the first state in place."""
    x = np.empty((len(times), len(initial)))
    x[0] = initial
    return Trajectory(t=times, x=x, reference=np.empty(len(times)), u=np.empty((len(times), inputs)))


def integrate(
    model: Model,
    numbers: Numbers,
    integrator: Integrator | None,
    scale: np.ndarray,
    trajectory: Trajectory,
    turn: float,
    progress: Callable[[float], None] | None = None,
) -> None:
    """Fill the samples of `trajectory`, whose times are uniform; without integrator only references and inputs."""
    times = trajectory.t
    begin, end = float(times[0]), float(times[-1])
    near = 1e-9 * (times[1] - times[0])
    inputs = model.manifest.inputs
    edges = segment_edges(model, numbers, begin, end, turn)
    state = trajectory.x[0].copy()
    first = 0
    for left, right in pairwise(edges):
        last = right >= end
        stop = len(times) if last else int(np.searchsorted(times, right - near))
        u = clock.inputs_at(inputs, numbers.values, left, 0.5 * (left + right))
        trajectory.reference[first:stop] = left
        trajectory.u[first:stop] = u
        trajectory.segments += 1
        if integrator is None:
            trajectory.finished = stop
        else:
            frozen = Frozen(scale=scale, u=u, p=numbers.p, c=numbers.c)
            state = _segment(integrator, frozen, trajectory, state, (left, right), (first, stop), near)
        first = stop
        if progress is not None:
            progress((right - begin) / (end - begin))


def step_through(
    model: Model,
    numbers: Numbers,
    family: Family,
    tolerance: np.ndarray,
    trajectory: Trajectory,
    turn: float,
    cost: Cost,
    progress: Callable[[float], None] | None = None,
    directions: Directions | None = None,
) -> None:
    """Fill the samples of `trajectory` by the project's own stepper, many segments a call."""
    times = trajectory.t
    begin, end = float(times[0]), float(times[-1])
    near = 1e-9 * (times[1] - times[0])
    edges = segment_edges(model, numbers, begin, end, turn)
    inputs = model.manifest.inputs
    gates = [k for k, info in enumerate(inputs) if info.kind != "phase"]
    stepper = model.stepper if directions is None else model.differentiating_stepper
    state = trajectory.x[0].copy()
    before: np.ndarray | None = None
    for first in range(0, len(edges) - 1, SEGMENTS_A_CALL):
        part = edges[first : first + SEGMENTS_A_CALL + 1]
        u = np.array([clock.inputs_at(inputs, numbers.values, a, 0.5 * (a + b)) for a, b in pairwise(part)]).reshape(
            len(part) - 1, len(inputs)
        )
        stops = np.searchsorted(times, part - near)
        stops[-1] = len(times) if part[-1] >= end else stops[-1]
        if first == 0:
            stops[0] = 0
        lengths = np.diff(stops)
        begun = slice(stops[0], stops[-1])
        trajectory.reference[begun] = np.repeat(part[:-1], lengths)
        trajectory.u[begun] = np.repeat(u, lengths, axis=0)
        switched = np.array([before is None or not np.array_equal(before, u[0, gates])])
        restarts = np.concatenate([switched, np.any(np.diff(u[:, gates], axis=0) != 0.0, axis=1)])
        before = u[-1, gates]
        segments = Segments(times=part, inputs=np.ascontiguousarray(u), restarts=restarts)
        states = np.empty((stops[-1] - stops[0], len(state)))
        # a sample that rounding puts beside an edge lies on it
        wanted = np.clip(times[begun], part[0], part[-1])
        outcome = stepper.run(
            family=family,
            tolerance=tolerance,
            p=numbers.p,
            c=numbers.c,
            x=state,
            segments=segments,
            output_times=wanted,
            output_states=states,
            tangents=directions.tangents(segments, int(stops[0]), len(states)) if directions is not None else None,
        )
        cost.steps = (cost.steps or 0) + outcome.steps
        cost.rejected = (cost.rejected or 0) + outcome.rejected
        if family is Family.AUTO:
            cost.families.append(outcome.family.name.lower())
        trajectory.x[stops[0] : stops[0] + outcome.written] = states[: outcome.written]
        trajectory.segments += len(part) - 1
        trajectory.calls += 1
        trajectory.finished = int(stops[0]) + outcome.written
        if outcome.end is not End.DONE:
            name = model.states[outcome.state] if outcome.state >= 0 else ""
            detail = f"Step size {outcome.step:.3g} s" + (f", worst state {name}." if name else ".")
            raise Interrupted(STATUS_OF_END[outcome.end], outcome.time, detail)
        if progress is not None:
            progress((float(part[-1]) - begin) / (end - begin))


#: What the ways of the stepper to end mean to people.
STATUS_OF_END = {
    End.TOO_MANY_STEPS: Status.TOO_MANY_STEPS,
    End.STEP_TOO_SMALL: Status.STEP_TOO_SMALL,
    End.NOT_FINITE: Status.NOT_FINITE,
    End.BAD_ARGUMENT: Status.INTEGRATOR_FAILED,
}


def _segment(
    integrator: Integrator,
    frozen: Frozen,
    trajectory: Trajectory,
    state: np.ndarray,
    interval: tuple[float, float],
    samples: tuple[int, int],
    near: float,
) -> np.ndarray:
    """Integrate over one segment; the state at its end."""
    left, right = interval
    k, stop = samples
    times = trajectory.t
    now = left

    def go(until: float, intervals: int) -> np.ndarray:
        nonlocal now, state
        trajectory.calls += 1
        try:
            block = integrator.advance(state, now - left, until - now, intervals, frozen)
        except EvaluationError as fault:
            raise Interrupted(Status.INTEGRATOR_FAILED, now, str(fault)) from fault
        finite = np.isfinite(block).all(axis=1)
        if not finite.all():
            trajectory.finished = k
            raise Interrupted(Status.NOT_FINITE, now, "")
        now, state = until, block[-1]
        return block

    if k < stop:
        if times[k] > now + near:
            go(float(times[k]), 1)
        trajectory.x[k] = state
        k += 1
        trajectory.finished = k
        for size in integrator.pieces(stop - k):
            trajectory.x[k : k + size] = go(float(times[k + size - 1]), size)
            k += size
            trajectory.finished = k
    if right > now + near:
        go(right, 1)
    return state


def segment_edges(model: Model, numbers: Numbers, begin: float, end: float, turn: float) -> np.ndarray:
    """Begin, breakpoints, whole turns and end, increasing, none twice [s]."""
    cuts = clock.breakpoints(model.manifest.inputs, numbers.values, begin, end)
    if math.isfinite(turn):
        near = clock.TIME_RESOLUTION * max(abs(begin), abs(end), turn)
        whole = turn * np.arange(math.floor(begin / turn) + 1, math.ceil(end / turn))
        whole = whole[(begin + near < whole) & (whole < end - near)]
        # a turn that meets a breakpoint is that breakpoint
        fenced = np.concatenate([[-math.inf], cuts, [math.inf]])
        right = np.searchsorted(fenced, whole)
        free = (fenced[right] - whole > near) & (whole - fenced[right - 1] > near)
        cuts = np.sort(np.concatenate([cuts, whole[free]]))
    return np.concatenate([[begin], cuts, [end]])


def evaluate_outputs(model: Model, numbers: Numbers, trajectory: Trajectory) -> dict[str, np.ndarray]:
    """Outputs at the finished samples: shape (samples,), or (samples, balls)."""
    infos = model.manifest.outputs
    done = trajectory.finished
    if not infos:
        return {}
    values = {
        "t": trajectory.t[:done] - trajectory.reference[:done],
        "x": trajectory.x[:done],
        "u": trajectory.u[:done],
        "p": numbers.p,
        "c": numbers.c,
    }
    results = model.loop("outputs", ("t", "x", "u"))(done, values)
    samples = {}
    states = [state.name for state in model.manifest.states]
    for info, columns in zip(infos, results.values(), strict=True):
        if info.name in states:  # the very numbers, not a copy that rounding might touch
            columns = trajectory.x[:done, [states.index(info.name)]]
        samples[info.name] = columns if info.size > 1 else np.ascontiguousarray(columns[:, 0])
    return samples


def model_scales(model: Model, numbers: Numbers, initial: np.ndarray, duration: float, turn: float) -> Scales:
    """Magnitudes and stiffness of a run, from its most loaded moments (see `scales`)."""
    horizon = min(duration, turn)
    edges = segment_edges(model, numbers, 0.0, duration, turn)
    middles = 0.5 * (edges[:-1] + edges[1:])
    picked = middles[np.unique(np.linspace(0, len(middles) - 1, MOMENTS).astype(int))]
    moments = np.concatenate([picked, horizon * (np.arange(MOMENTS) + 0.5) / MOMENTS])
    inputs = [clock.inputs_at(model.manifest.inputs, numbers.values, float(t)) for t in moments]
    fixed = {"t": 0.0, "p": numbers.p, "c": numbers.c}
    rhs, jacobian = model.kernel("rhs"), model.kernel("rhs_jac_x")
    return find_scales(
        lambda u, x: rhs({**fixed, "u": u, "x": x}),
        lambda u, x: jacobian({**fixed, "u": u, "x": x}).reshape(len(x), len(x)),
        inputs,
        initial,
        horizon,
    )


def choose_method(model: Model, asked: str, scales: Scales) -> tuple[str, str]:
    """Name of the method and the reason for it.

    Raises
    ------
    RequestError
        No such method, or the model was generated without it.
    """
    available = available_methods(model)
    if asked == "auto" and model.has_stepper:
        return "stepper", "the fastest method that a compiler allows"
    if asked in STEPPERS and model.has_stepper:
        return asked, "asked for"
    if asked == "auto":
        ratio = f"fastest decay {scales.decay:.3g} 1/s, fastest natural frequency {scales.frequency:.3g} rad/s"
        name, why = ("rosenbrock", "stiff") if scales.stiffness > STIFF_RATIO else ("erk", "not stiff")
        if name in available:
            return name, f"{why}: {ratio}"
        if available:
            return available[-1], f"{why}: {ratio}; the model was generated without {name}"
        raise RequestError("The model has no right-hand side to integrate. Generate it again with `raceway derive`.")
    if asked in STEPPERS:
        missing = (
            "the generated folder has no kernels for it; write it again with `raceway derive`"
            if model.compiled
            else "it needs a C compiler, and none was found; install gcc or clang, or `pip install ziglang`"
        )
        raise RequestError(f"method {asked}: {missing}. Or take one of {', '.join(('auto', *available))}.")
    if asked not in available:
        raise RequestError(unknown_name("method", asked, ("auto", *model.methods)))
    return asked, "asked for"


def run_length(model: Model, request: Request, turn: float) -> float:
    """Length of the run that is asked for [s]."""
    run = model.manifest.run
    cycles, duration = request.cycles, request.duration
    if cycles is not None and duration is not None:
        raise RequestError(f"cycles = {cycles!r} and duration = {duration!r} were both given: give one of them.")
    if cycles is None and duration is None:
        cycles, duration = run.cycles, run.duration
    if cycles is not None:
        if not 0.0 < cycles < math.inf:
            raise RequestError(f"cycles: a number above 0 is expected, not {cycles!r}.")
        if not math.isfinite(turn):
            raise RequestError("cycles: nothing turns in this model (its speed is zero). Give duration in seconds.")
        return float(cycles) * turn
    if duration is None or not 0.0 < duration < math.inf:
        raise RequestError(f"duration: a time above 0 s is expected, not {duration!r}.")
    return float(duration)


def start_state(model: Model, numbers: Numbers, given: np.ndarray | None) -> np.ndarray:
    """State at the start: as given, else from the parameters."""
    if given is None:
        return np.array([numbers.values[name] for name in model.manifest.initial], dtype=float)
    names = [state.name for state in model.manifest.states]
    initial = np.array(given, dtype=float)
    if initial.shape != (len(names),) or not np.all(np.isfinite(initial)):
        raise RequestError(
            f"initial: {len(names)} finite numbers are expected ({', '.join(names)}), "
            f"not an array of shape {initial.shape}{'' if np.all(np.isfinite(initial)) else ' with NaN or inf'}."
        )
    return initial


def _whole(name: str, given: int | None, default: int) -> int:
    value = default if given is None else given
    if isinstance(value, bool) or int(value) != value or value < 1:
        raise RequestError(f"{name}: a whole number from 1 on is expected, not {value!r}.")
    return int(value)
