"""The true peak of an output, which may lie between the samples of a run.

Ball forces have spikes narrower than a sample interval; samples alone read them low, or show nothing of them.

- States, and the largest ball forces, are reduced in every step of a run of the project's own stepper
  (`Solution.reductions`): their extremes are there.
- Outputs that follow from time alone are evaluated on a grid in every segment between load switches, both its ends
  included, and on finer ones around the best point.
- Of all others, the smallest force of any ball or whatever a run of CasADi's integrators gives, the samples are told.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.reduction_rows import reduction_rows
from ballpass.runtime.quantity.track import depends
from ballpass.runtime.run import inputs as clock
from ballpass.runtime.run.segments import make_segments, segment_edges
from ballpass.runtime.run.solution import Solution

Kind = Literal["max", "min"]

#: What makes either extreme a largest value.
SIGNS: Mapping[Kind, float] = {"max": 1.0, "min": -1.0}

#: How a peak was looked for between the samples.
Searched = Literal["every step", "dense samples", "samples"]

#: Points of the first grid in a turn, the fewest in a segment, and segments that are evaluated at once.
POINTS, FEWEST, TOGETHER = 512, 16, 256

#: Grids around the best point, each 32 times as fine as the one before, and the intervals of each.
ROUNDS, FINER = 3, 64

#: What turns so many times in a turn, to this fraction, comes back with it [1].
ALIKE = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Peak:
    """Largest (or smallest) value of an output.

    Attributes
    ----------
    value : in the output's unit
    time : when [s]
    ball : which ball, counted from 1; None for outputs without balls
    sampled : the value that the samples alone show
    searched : where was looked for it.  ``every step``: in each step of the run, looked at in its quarters (those of
        ``stepper-dop853`` in eighths); what begins and ends between two of them, as a brief contact, is not seen.
        ``dense samples``: on a grid of its own, for the output follows from time alone.  ``samples``: nowhere else;
        more samples may show more

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
    sampled = [_of_samples(solution, name, kind) for name, kind in wanted]
    found = [_of_steps(solution, name, kind, peak) for (name, kind), peak in zip(wanted, sampled, strict=True)]
    of_time = {
        name
        for (name, _), peak in zip(wanted, found, strict=True)
        if peak.searched == "samples" and name not in model.states and not depends(model, name, "x")
    }
    if of_time and len(solution) > 1:
        grid = _TimeGrid(model, numbers, solution, sorted(of_time))
        found = [
            grid.peak(name, kind, peak) if name in of_time else peak
            for (name, kind), peak in zip(wanted, found, strict=True)
        ]
    return found


def _of_samples(solution: Solution, name: str, kind: Kind) -> Peak:
    if kind not in SIGNS:
        raise RequestError(f"kind: 'max' or 'min' is expected, not {kind!r}.")
    samples = solution[name]  # unknown names are refused with the nearest known ones
    if not len(solution):
        raise RequestError("A peak needs a sample at least; the solution has none. Run longer.")
    sign = SIGNS[kind]
    table = sign * samples.reshape(len(solution), -1)
    k, column = divmod(int(np.argmax(table)), table.shape[1])
    value = float(sign * table[k, column])
    return Peak(value=value, time=float(solution.t[k]), ball=column + 1 if samples.ndim == 2 else None, sampled=value)


def _of_steps(solution: Solution, name: str, kind: Kind, peak: Peak) -> Peak:
    """The extreme that the run's own reductions hold, where they hold it."""
    reductions = solution.reductions
    if reductions is None or name not in reductions:
        return peak
    of_balls = name in reduction_rows(solution.manifest).balls
    if of_balls and kind == "min":
        return peak  # what is reduced is the most loaded ball's smallest, not that of any ball
    entry = reductions[name]
    value, time, ball = (
        (entry.maximum, entry.maximum_time, entry.maximum_ball)
        if kind == "max"
        else (entry.minimum, entry.minimum_time, entry.minimum_ball)
    )
    return Peak(value=value, time=time, ball=ball, sampled=peak.sampled, searched="every step")


class _TimeGrid:
    """Outputs that follow from time alone, on a grid over the samples' time that ends on both sides of every edge."""

    def __init__(self, model: LoadedModel, numbers: Numbers, solution: Solution, names: Sequence[str]) -> None:
        self._model, self._numbers, self._names = model, numbers, names
        begin, end = float(solution.t[0]), float(solution.t[-1])
        turn = clock.period(model.manifest, numbers.values)
        if _comes_back(model, numbers, names, turn):
            end = min(end, begin + turn)
        self._segments = make_segments(model.manifest.inputs, numbers, segment_edges(model, numbers, begin, end, turn))
        self._lengths = np.diff(self._segments.times)
        self._counts = np.maximum(FEWEST, np.ceil(POINTS * self._lengths / min(turn, end - begin))).astype(int)
        #: Value, segment, time since its start and column of the best point of each output.
        self._best: dict[tuple[str, Kind], tuple[float, int, float, int]] = {}
        for first in range(0, len(self._lengths), TOGETHER):
            some = range(first, min(first + TOGETHER, len(self._lengths)))
            segment = np.repeat(some, self._counts[some] + 1)
            self._look(segment, np.concatenate([np.linspace(0.0, self._lengths[k], self._counts[k] + 1) for k in some]))

    def peak(self, name: str, kind: Kind, sampled: Peak) -> Peak:
        """The extreme of one output, closely."""
        _, segment, _, _ = self._best[name, kind]
        length, width = self._lengths[segment], self._lengths[segment] / self._counts[segment]
        for _ in range(ROUNDS):
            middle = self._best[name, kind][2]
            around = np.clip(np.linspace(middle - width, middle + width, FINER + 1), 0.0, length)
            self._look(np.full(len(around), segment), around)
            width *= 2.0 / FINER
        value, _, local, column = self._best[name, kind]
        return Peak(
            value=value,
            time=float(self._segments.times[segment]) + local,
            ball=None if sampled.ball is None else column + 1,
            sampled=sampled.sampled,
            searched="dense samples",
        )

    def _look(self, segment: np.ndarray, local: np.ndarray) -> None:
        """Evaluate the outputs at times within segments, and keep the best point of each."""
        given = {
            "t": local,
            "x": np.zeros((len(local), len(self._model.states))),
            "u": self._segments.inputs[segment],
            "p": self._numbers.p,
            "c": self._numbers.c,
        }
        found = self._model.sample_outputs(len(local), given, list(self._names))
        for name in self._names:
            for kind, sign in SIGNS.items():
                k, column = divmod(int(np.argmax(sign * found[name])), found[name].shape[1])
                value, known = float(found[name][k, column]), self._best.get((name, kind))
                if known is None or sign * value > sign * known[0]:
                    self._best[name, kind] = (value, int(segment[k]), float(local[k]), column)


def _comes_back(model: LoadedModel, numbers: Numbers, names: Sequence[str], turn: float) -> bool:
    """Whether what these outputs depend on comes back with each turn."""
    places = dict.fromkeys(k for name in names for k in depends(model, name, "u"))
    inputs = [model.manifest.inputs[k] for k in places]
    if not math.isfinite(turn) or not all(item.rate for item in inputs):
        return False
    turns = np.array([numbers.values[item.rate] * turn / clock.TURN for item in inputs])
    return bool(np.all(np.abs(turns - np.rint(turns)) <= ALIKE))
