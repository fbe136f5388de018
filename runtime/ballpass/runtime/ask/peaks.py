"""The true peak of an output, which may lie between the samples of a run.

Ball forces have spikes narrower than a sample interval; samples alone give too low a peak, or miss it.

- States, and the largest ball forces, are reduced in every step of a run of the project's own stepper
  (`Solution.reductions`): their extremes are taken from there.
- All other outputs are evaluated along nodes within those steps, as any quantity is (`ballpass.runtime.quantity`);
  those that follow from time alone without a run.
- Of the rest, the smallest force of any ball or what depends on a run of CasADi's integrators, the samples are given.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.method_registry import STEPPERS
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.quantity.grammar import quantities_of
from ballpass.runtime.quantity.quantity_run import QuantityRun
from ballpass.runtime.quantity.track import depends
from ballpass.runtime.request.locating import LOCATED, STEPPED_OVER
from ballpass.runtime.request.resolve import Run
from ballpass.runtime.run.reductions import Reduction
from ballpass.runtime.solution.solution import Solution
from ballpass.runtime.time import timeline
from ballpass.runtime.time.span import Span

Kind = Literal["max", "min"]

#: Sign that makes either extreme a largest value.
SIGNS: Mapping[Kind, float] = {"max": 1.0, "min": -1.0}

#: How a peak was searched between the samples.
Searched = Literal["every step", "dense samples", "samples"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Peak:
    """Largest (or smallest) value of an output.

    Attributes
    ----------
    value : in the output's unit
    time : when [s]
    ball : which ball, counted from 1; None for outputs without balls
    sampled : the value of the samples alone
    searched : where it was searched.  ``every step``: in each step of the run, evaluated in its quarters (those of
        ``stepper-dop853`` in eighths) or at Gauss's nodes; an event between two of them, as a brief
        contact, is missed.  ``dense samples``: on a separate grid, because the output follows from time alone.
        ``samples``: only there; more samples may give a higher peak

    Examples
    --------
    >>> solution = model.simulate(cycles=1, samples_per_cycle=90)
    >>> peak = model.refine_peak(solution, "ball.force")
    >>> peak.value > peak.sampled, peak.searched
    (True, 'every step')
    """

    value: float
    time: float
    ball: int | None
    sampled: float
    searched: Searched = "samples"


def refine_peak(model: LoadedModel, numbers: Numbers, solution: Solution, name: str, *, kind: Kind = "max") -> Peak:
    """Peak of an output over a run; for its steady part, give `Solution.steady`.

    Parameters
    ----------
    model, numbers : the model and the run's numbers
    solution : a run of this model
    name : an output
    kind : which extreme

    Raises
    ------
    RequestError
        No such output, no samples, or another `kind`.
    """
    return refine_peaks(model, numbers, solution, [(name, kind)])[0]


def refine_peaks(
    model: LoadedModel, numbers: Numbers, solution: Solution, wanted: Sequence[tuple[str, Kind]]
) -> list[Peak]:
    """Several peaks of one run; else as `refine_peak`."""
    found = [_of_samples(solution, name, kind) for name, kind in wanted]
    left = []
    for k, (name, kind) in enumerate(wanted):
        if kind == "min" and solution[name].ndim == 2:
            continue  # steps give the smallest force of the most loaded ball, not that of any
        if solution.reductions is not None and name in solution.reductions:
            found[k] = _of_steps(solution.reductions[name], kind, found[k])
        elif has_quantities(solution, name, model):
            left.append(k)
    if left and len(solution) > 1:
        quantities = quantities_of(model, [f"{kind}:{name}" for name, kind in (wanted[k] for k in left)])
        estimates = QuantityRun(model, quantities).measure(run_of(model, numbers, solution)).estimates
        for k, one in zip(left, estimates, strict=True):
            assert one.time is not None  # it is an extreme
            searched: Searched = "dense samples" if _is_of_time(model, wanted[k][0]) else "every step"
            found[k] = replace(found[k], value=one.value, time=one.time, ball=one.ball, searched=searched)
    return found


def has_quantities(solution: Solution, name: str, model: LoadedModel) -> bool:
    """Whether quantities of an output are of this same run: it follows from time, or the stepper ran."""
    return name not in model.states and (solution.statistics.method in STEPPERS or _is_of_time(model, name))


def steady_run(model: LoadedModel, numbers: Numbers, solution: Solution) -> Run | None:
    """The run that a solution is of, from the time on that counts to its end; None where the project's own stepper did
    not reduce it, or nothing turns."""
    few, runs = solution.steady_reductions, solution.statistics.steps and len(solution)
    if few is None or solution.cycle_length is None or not runs:
        return None
    run = run_of(model, numbers, solution)
    return replace(run, span=replace(run.span, start=few.start, transient=solution.transient_cycles))


def run_of(model: LoadedModel, numbers: Numbers, solution: Solution) -> Run:
    """The run that a solution is of, from its first sample to its last."""
    statistics = solution.statistics
    kinks = LOCATED if statistics.kinks == LOCATED else STEPPED_OVER
    return Run(
        model=model,
        numbers=numbers,
        span=Span(
            turning=timeline.driver(model.manifest, numbers.values),
            begin=statistics.begin,
            start=float(solution.t[0]),
            end=float(solution.t[-1]),
            transient=0.0,
        ),
        initial=np.array(statistics.initial),
        method=statistics.method if statistics.method in STEPPERS else "stepper",
        rtol=statistics.rtol,
        kinks=kinks,
        magnitude=np.array(statistics.magnitudes),
    )


def _is_of_time(model: LoadedModel, name: str) -> bool:
    return not depends(model, name, "x")


def _of_samples(solution: Solution, name: str, kind: Kind) -> Peak:
    if not (isinstance(kind, str) and kind in SIGNS):
        raise RequestError(f"kind: 'max' or 'min' is expected, not {kind!r}.")
    samples = solution[name]  # unknown names are refused with the nearest known ones
    if not len(solution):
        raise RequestError("A peak needs a sample at least; the solution has none. Run longer.")
    sign = SIGNS[kind]
    table = sign * samples.reshape(len(solution), -1)
    k, column = divmod(int(np.argmax(table)), table.shape[1])
    value = float(sign * table[k, column])
    return Peak(value=value, time=float(solution.t[k]), ball=column + 1 if samples.ndim == 2 else None, sampled=value)


def _of_steps(found: Reduction, kind: Kind, peak: Peak) -> Peak:
    """The extreme that the run's own reductions hold."""
    largest = (found.maximum, found.maximum_time, found.maximum_ball)
    value, time, ball = largest if kind == "max" else (found.minimum, found.minimum_time, found.minimum_ball)
    return replace(peak, value=value, time=time, ball=ball, searched="every step")
