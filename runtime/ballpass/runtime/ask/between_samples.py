"""Outputs of a run between its samples, where nothing more is known than a solution.

In: a model, a solution, windows of time.  Out: outputs on fine grids within the windows.  `Still` evaluates outputs
that follow from time alone; `Resumed` integrates once more from the sampled state where a window begins.  What a
source sees of the intervals between all samples (`Source.survey`) is cheap, and tells which windows are worth a look.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ballpass.runtime.certify.quasi_static import NAME as QUASI_STATIC
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.run import inputs as clock
from ballpass.runtime.run.segments import segment_edges, time_resolution
from ballpass.runtime.run.simulate import fill
from ballpass.runtime.run.stepping import Cost
from ballpass.runtime.run.trajectory import Interrupted, Trajectory, evaluate_outputs, start_trajectory

if TYPE_CHECKING:
    from ballpass.runtime.run.solution import Solution

#: Points of a survey that are evaluated at a time: an interrupt is heard between.
POINTS = 2**17

#: What turns so many times in a turn, to this fraction, comes back with it [1].
ALIKE = 1e-9

#: Parts of an interval between samples in a survey by interpolation, and of one where outputs follow from time.
PARTS, PARTS_STILL = 8, 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Window:
    """A stretch of time to look into.

    Attributes
    ----------
    begin, end : [s]
    count : intervals of the grid
    x : state at `begin`, shape (states,)
    """

    begin: float
    end: float
    count: int
    x: np.ndarray

    @property
    def times(self) -> np.ndarray:
        """Points of the grid, shape (count + 1,) [s]."""
        return self.begin + (self.end - self.begin) * (np.arange(self.count + 1) / self.count)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Seen:
    """What a window shows.

    Attributes
    ----------
    t : points, shape (points,) [s]
    x : states there, shape (points, states)
    values : outputs by name, each of shape (points, columns)
    """

    t: np.ndarray
    x: np.ndarray
    values: dict[str, np.ndarray]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Survey:
    """Points within some of the intervals between samples.

    Attributes
    ----------
    first : the first of these intervals
    t : points, shape (intervals, points) [s]
    values : outputs by name, each of shape (intervals, points, columns)
    """

    first: int
    t: np.ndarray
    values: dict[str, np.ndarray]


class Source(Protocol):
    """A way to see a run between its samples."""

    def look(self, windows: Sequence[Window], names: Sequence[str]) -> list[Seen]:
        """Outputs on the grids of windows."""

    def survey(self, names: Sequence[str]) -> Iterator[Survey]:
        """Outputs within the intervals between all samples, some intervals at a time."""


class Still:
    """Outputs that follow from time alone.

    Parameters
    ----------
    model, numbers, solution : the model, the run's numbers, the run
    """

    def __init__(self, model: LoadedModel, numbers: Numbers, solution: Solution) -> None:
        self._model, self._numbers, self._solution = model, numbers, solution

    def look(self, windows: Sequence[Window], names: Sequence[str]) -> list[Seen]:
        """Outputs on the grids of windows."""
        found = []
        for window in windows:
            times = window.times
            x = np.zeros((len(times), self._solution.x.shape[1]))
            found.append(Seen(t=times, x=x, values=self._at(times, x, names)))
        return found

    def survey(self, names: Sequence[str]) -> Iterator[Survey]:
        """Outputs within the intervals."""
        for first, times in _points(self._solution.t, PARTS_STILL):
            x = np.zeros((times.size, self._solution.x.shape[1]))
            found = self._at(times.ravel(), x, names)
            yield Survey(
                first=first, t=times, values={name: array.reshape(*times.shape, -1) for name, array in found.items()}
            )

    def edges(self, names: Sequence[str]) -> Seen:
        """Outputs on both sides of the edges between the samples: a load may rise and fall between two of these."""
        t = self._solution.t
        turn = clock.period(self._model.manifest, self._numbers.values)
        begin, end = float(t[0]), float(t[-1])
        beside = 2.0 * time_resolution(begin, end, turn)
        edges = segment_edges(self._model, self._numbers, begin, end, turn)[1:-1]
        edges = edges[(edges > begin + beside) & (edges < end - beside)]
        times = np.unique(np.concatenate([[begin], edges - beside, edges + beside, [end]]))
        x = np.zeros((len(times), self._solution.x.shape[1]))
        return Seen(t=times, x=x, values=self._at(times, x, names))

    def _at(self, times: np.ndarray, x: np.ndarray, names: Sequence[str]) -> dict[str, np.ndarray]:
        return _outputs(self._model, self._numbers, times, x, names, at_rest=False)


class Resumed:
    """A run gone on with from its sampled states, by its own method and tolerance.

    Parameters
    ----------
    model, numbers, solution : the model, the run's numbers, the run
    """

    def __init__(self, model: LoadedModel, numbers: Numbers, solution: Solution) -> None:
        self._model, self._numbers, self._solution = model, numbers, solution
        self._turn = clock.period(model.manifest, numbers.values)
        self._at_rest = solution.statistics.method == QUASI_STATIC

    def look(self, windows: Sequence[Window], names: Sequence[str]) -> list[Seen]:
        """Outputs on the grids of windows.

        Raises
        ------
        RequestError
            The method cannot go on from there.
        """
        return [self._look(window, names) for window in windows]

    def _look(self, window: Window, names: Sequence[str]) -> Seen:
        interval = (window.begin, window.end)
        trajectory = start_trajectory(
            self._model, self._numbers, window.times, window.x, interval, self._turn, even=True
        )
        statistics = self._solution.statistics
        tolerance = statistics.rtol * np.array(statistics.magnitudes)
        try:
            fill(self._model, self._numbers, statistics.method, tolerance, trajectory, Cost())
        except Interrupted as end_of_run:
            raise RequestError(
                f"The peak of {', '.join(names)} near t = {window.begin:g} s cannot be refined: "
                f"{end_of_run.status.value} Is the solution one of this model?"
            ) from end_of_run
        return Seen(
            t=trajectory.t,
            x=trajectory.x,
            values=sampled_outputs(self._model, self._numbers, trajectory, names, self._at_rest),
        )

    def survey(self, names: Sequence[str]) -> Iterator[Survey]:
        """Outputs of states between the samples by cubic Hermite interpolation, with the rates of the samples.

        A contact that opens and closes within an interval turns the velocity round, and the cubic dips into it.
        Equilibria have no rates; their slopes are those of differences.
        """
        t, x = self._solution.t, self._solution.x
        rates = self._rates()
        part = np.arange(1, PARTS) / PARTS
        # the cubic's weights of states and rates at both ends
        weights = (
            (1.0 + 2.0 * part) * (1.0 - part) ** 2,
            part * (1.0 - part) ** 2,
            part**2 * (3.0 - 2.0 * part),
            part**2 * (part - 1.0),
        )
        for first, times in _points(t, PARTS):
            here = slice(first, first + len(times))
            there = slice(first + 1, first + 1 + len(times))
            width = (t[there] - t[here])[:, None, None]
            with np.errstate(over="ignore", invalid="ignore"):
                states = (
                    weights[0][:, None] * x[here, None]
                    + weights[1][:, None] * width * rates[here, None]
                    + weights[2][:, None] * x[there, None]
                    + weights[3][:, None] * width * rates[there, None]
                )
            found = _outputs(
                self._model, self._numbers, times.ravel(), states.reshape(times.size, -1), names, at_rest=self._at_rest
            )
            yield Survey(
                first=first, t=times, values={name: array.reshape(*times.shape, -1) for name, array in found.items()}
            )

    def _rates(self) -> np.ndarray:
        """Rates of the states at the samples, shape (samples, states)."""
        t, x = self._solution.t, self._solution.x
        if self._at_rest or not self._model.has("rhs"):
            slopes: np.ndarray = np.gradient(x, t, axis=0)
            return slopes
        trajectory = _along(self._model, self._numbers, t, x)
        segments = trajectory.segments
        lengths = np.diff(trajectory.stops)
        given = {
            "t": t - np.repeat(segments.times[:-1], lengths),
            "x": x,
            "u": np.repeat(segments.inputs, lengths, axis=0),
            "p": self._numbers.p,
            "c": self._numbers.c,
        }
        return next(iter(self._model.loop("rhs", ("t", "x", "u"))(len(t), given).values()))


def follow_from_time(model: LoadedModel, names: Sequence[str]) -> tuple[str, ...]:
    """Those of some outputs that do not depend on the states."""
    return tuple(name for name in dict.fromkeys(names) if not _depends(model, name, "x"))


def one_turn(model: LoadedModel, numbers: Numbers, solution: Solution, names: Sequence[str]) -> Solution:
    """As much of a solution as shows all of some outputs that follow from time alone: its first turn where what they
    depend on comes back with it, else the whole."""
    turn = clock.period(model.manifest, numbers.values)
    places = dict.fromkeys(k for name in names for k in _depends(model, name, "u"))
    inputs = [model.manifest.inputs[k] for k in places]
    if not all(item.kind in ("phase", "gate") for item in inputs) or not math.isfinite(turn):
        return solution
    turns = np.array([numbers.values[item.rate] * turn / clock.TURN for item in inputs])
    keep = int(np.searchsorted(solution.t, solution.t[0] + turn * (1.0 + ALIKE))) + 1
    if keep >= len(solution) or np.any(np.abs(turns - np.rint(turns)) > ALIKE):
        return solution
    outputs = {name: solution.outputs[name][:keep] for name in names}
    return replace(solution, t=solution.t[:keep], x=solution.x[:keep], outputs=outputs)


def _depends(model: LoadedModel, output: str, argument: str) -> list[int]:
    """Entries of an argument of the outputs that one of them depends on."""
    graph = model.symbolic("outputs")
    if argument not in graph.name_in():
        return []
    known = [info.name for info in model.manifest.outputs]
    sparsity = graph.jac_sparsity(known.index(output), graph.name_in().index(argument))
    return list(dict.fromkeys(sparsity.get_col()))


def sampled_outputs(
    model: LoadedModel, numbers: Numbers, trajectory: Trajectory, names: Sequence[str], at_rest: bool
) -> dict[str, np.ndarray]:
    """Outputs of a trajectory, each of shape (samples, columns); a few of them are no reason to compile."""
    found = evaluate_outputs(model, numbers, trajectory, tuple(names), lean=False, at_rest=at_rest)
    return {name: array.reshape(trajectory.finished, -1) for name, array in found.items()}


def _outputs(
    model: LoadedModel, numbers: Numbers, times: np.ndarray, x: np.ndarray, names: Sequence[str], *, at_rest: bool
) -> dict[str, np.ndarray]:
    """Outputs at increasing times and given states."""
    return sampled_outputs(model, numbers, _along(model, numbers, times, x), names, at_rest)


def _along(model: LoadedModel, numbers: Numbers, times: np.ndarray, x: np.ndarray) -> Trajectory:
    """A trajectory whose states are known."""
    turn = clock.period(model.manifest, numbers.values)
    span = (float(times[0]), float(times[-1]))
    trajectory = start_trajectory(model, numbers, times, x[0], span, turn, even=False)
    trajectory.x = x
    trajectory.finished = len(times)
    return trajectory


def _points(t: np.ndarray, parts: int) -> Iterator[tuple[int, np.ndarray]]:
    """Points within the intervals between samples, some intervals at a time: the first of them, (intervals, points)."""
    part = np.arange(1, parts) / parts
    size = max(1, POINTS // len(part))
    for first in range(0, len(t) - 1, size):
        begin, end = t[first : first + size + 1][:-1], t[first + 1 : first + 1 + size]
        yield first, begin[:, None] + (end - begin)[:, None] * part
