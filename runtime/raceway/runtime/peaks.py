"""The true peak of an output, between the samples.

Ball forces have spikes narrower than a sample interval; samples alone read them low.  Around the largest samples the
model is integrated once more on a grid 64 times as fine, from the sampled states.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from raceway.runtime import clock
from raceway.runtime.errors import RequestError
from raceway.runtime.integrators import GRID
from raceway.runtime.parameters import Numbers
from raceway.runtime.quasi_static import NAME as QUASI_STATIC
from raceway.runtime.simulate import fill
from raceway.runtime.stepping import Cost
from raceway.runtime.trajectory import Interrupted, evaluate_outputs, start_trajectory

if TYPE_CHECKING:
    from raceway.runtime.model import Model
    from raceway.runtime.solution import Solution


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
    for k in _tops(samples, candidates):
        best = max(best, _closely(model, numbers, solution, name, sign, k))
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


def _closely(
    model: Model, numbers: Numbers, solution: Solution, name: str, sign: float, k: int
) -> tuple[float, float, int]:
    """Largest value between the neighbours of sample `k`: value (times sign), time, column."""
    low, high = max(k - 1, 0), min(k + 1, len(solution) - 1)
    begin, end = float(solution.t[low]), float(solution.t[high])
    count = GRID * (high - low)
    times = begin + (end - begin) * (np.arange(count + 1) / count)
    turn = clock.period(model.manifest, numbers.values)
    trajectory = start_trajectory(model, numbers, times, solution.x[low], (begin, end), turn, even=True)
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
    return float(fine[row, column]), float(times[row]), column
