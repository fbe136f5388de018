"""The true peak of an output, between the samples.

Ball forces have spikes narrower than a sample interval; samples alone read them low.  Around the largest samples the
model is integrated once more on a grid 64 times as fine, from the sampled states; around the best of what that shows,
again from there, until the value stays.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from raceway.runtime.accuracy.quasi_static import NAME as QUASI_STATIC
from raceway.runtime.errors import RequestError
from raceway.runtime.integrate import clock
from raceway.runtime.integrate.integrators import GRID
from raceway.runtime.integrate.segments import time_resolution
from raceway.runtime.integrate.simulate import fill
from raceway.runtime.integrate.stepping import Cost
from raceway.runtime.integrate.trajectory import Interrupted, evaluate_outputs, start_trajectory
from raceway.runtime.parameters import Numbers

if TYPE_CHECKING:
    from raceway.runtime.model import Model
    from raceway.runtime.solution import Solution

#: A peak whose value changes by less than this, relative to itself, from one grid to the next is settled [1].
SETTLED = 1e-9

#: Narrowest interval that is looked at, in times that count as different.
NARROWEST = 1e3


@dataclass(frozen=True, slots=True, kw_only=True)
class Peak:
    """Largest (or smallest) value of an output.

    Attributes
    ----------
    value : in the output's unit
    time : when [s]
    ball : which ball, counted from 1; None for outputs without balls
    sampled : the value that the samples alone show
    """

    value: float
    time: float
    ball: int | None
    sampled: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Top:
    """Best point of a grid.

    Attributes
    ----------
    value : of the output, times the sign of the kind
    time : [s]
    column : ball, counted from 0
    reach : how much higher the output may be between this point and its neighbours
    begin, end : the neighbours [s]
    x : state at the former
    """

    value: float
    time: float
    column: int
    reach: float
    begin: float
    end: float
    x: np.ndarray


def refine_peak(
    model: Model,
    numbers: Numbers,
    solution: Solution,
    name: str,
    *,
    kind: Literal["max", "min"] = "max",
    candidates: int = 6,
) -> Peak:
    """Peak of an output over the samples of `solution` (of its `steady` part: give that).

    Parameters
    ----------
    model, numbers : the model and the run's numbers
    solution : a run of this model
    name : an output
    kind : which extreme
    candidates : so many of the largest samples that top their neighbours are looked at closely

    Raises
    ------
    RequestError
        No such output, fewer than three samples, or another `kind`.
    """
    if kind not in ("max", "min"):
        raise RequestError(f"kind: 'max' or 'min' is expected, not {kind!r}.")
    if name not in solution.outputs:
        solution[name]  # unknown names are refused with the nearest known ones
        raise RequestError(f"{name!r} is a state but no output: add it to the scene's run.outputs.")
    if len(solution) < 3:
        raise RequestError(f"A peak needs three samples at least; the solution has {len(solution)}.")
    sign = 1.0 if kind == "max" else -1.0
    samples = sign * solution[name].reshape(len(solution), -1)
    k, column = divmod(int(np.argmax(samples)), samples.shape[1])
    best = (float(samples[k, column]), float(solution.t[k]), column)
    sampled = sign * best[0]
    near = []
    for k in _tops(samples, candidates):
        low, high = max(k - 1, 0), min(k + 1, len(solution) - 1)
        between = (float(solution.t[low]), float(solution.t[high]))
        near.append(_closely(model, numbers, solution, name, sign, solution.x[low], between, GRID * (high - low)))
    for top in sorted(near, key=lambda item: -item.value):
        found = top
        if top.value + top.reach > best[0]:
            found = _settled(model, numbers, solution, name, sign, top)
        best = max(best, (found.value, found.time, found.column))
    value, time, ball = best
    several = solution[name].ndim == 2
    return Peak(value=sign * value, time=time, ball=ball + 1 if several else None, sampled=sampled)


def _tops(samples: np.ndarray, count: int) -> list[int]:
    """Indices of the largest samples that no neighbour exceeds, each index once."""
    padded = np.pad(samples, ((1, 1), (0, 0)), constant_values=-np.inf)
    top = (samples >= padded[:-2]) & (samples >= padded[2:])
    heights = np.max(np.where(top, samples, -np.inf), axis=1)
    order = np.argsort(-heights, kind="stable")[:count]
    return [int(k) for k in order if np.isfinite(heights[k])]


def _settled(model: Model, numbers: Numbers, solution: Solution, name: str, sign: float, top: _Top) -> _Top:
    """The same peak on grids that get finer around it until its value stays, or time has no finer steps.

    No curve is laid through the points: where a load jumps or two balls change rank, none would fit.
    """
    turn = clock.period(model.manifest, numbers.values)
    while top.end - top.begin > NARROWEST * time_resolution(top.begin, top.end, turn):
        finer = _closely(model, numbers, solution, name, sign, top.x, (top.begin, top.end), 2 * GRID)
        if abs(finer.value - top.value) <= SETTLED * abs(top.value):
            return finer
        top = finer
    return top


def _closely(
    model: Model,
    numbers: Numbers,
    solution: Solution,
    name: str,
    sign: float,
    x: np.ndarray,
    between: tuple[float, float],
    count: int,
) -> _Top:
    """Largest value on a grid of `count` intervals between two times, from the state `x` at the first."""
    begin, end = between
    times = begin + (end - begin) * (np.arange(count + 1) / count)
    turn = clock.period(model.manifest, numbers.values)
    trajectory = start_trajectory(model, numbers, times, x, (begin, end), turn, even=True)
    statistics = solution.statistics
    tolerance = statistics.rtol * np.array(statistics.magnitudes)
    try:
        fill(model, numbers, statistics.method, tolerance, trajectory, Cost())
    except Interrupted as end_of_run:
        raise RequestError(
            f"The peak of {name!r} near t = {begin:g} s cannot be refined: {end_of_run.status.value} "
            "Is the solution one of this model?"
        ) from end_of_run
    at_rest = statistics.method == QUASI_STATIC
    found = evaluate_outputs(model, numbers, trajectory, (name,), lean=False, at_rest=at_rest)
    fine = sign * found[name].reshape(count + 1, -1)
    row, column = divmod(int(np.argmax(fine)), fine.shape[1])
    low, high = max(row - 1, 0), min(row + 1, count)
    value = float(fine[row, column])
    return _Top(
        value=value,
        time=float(times[row]),
        column=column,
        reach=value - float(np.min(np.max(fine[[low, high]], axis=1))),
        begin=float(times[low]),
        end=float(times[high]),
        x=trajectory.x[low],
    )
