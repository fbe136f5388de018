"""The true peak of an output, between the samples.

Ball forces have spikes narrower than a sample interval; samples alone read them low, or show nothing of them.  Where
the peak may be is found first, as well as the run allows:

- a run of the project's own stepper is integrated once more, to the bit (`replay`): states and largest ball forces are
  reduced on line, within every step; other outputs are evaluated at several points for each step, on average;
- outputs that follow from time alone are evaluated between all samples, and on both sides of every edge, of one turn
  where they come back with it;
- all other runs are surveyed by interpolation between their samples, from states and rates (`looks`).

There, and around the largest samples, the output is evaluated on a grid; around the best of what that shows, on a
finer one, until the value stays.  A run that is met again is sampled on these grids, its steps being what they were;
others are gone on with from the sampled states.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from ballpass.runtime.ask.between_samples import Resumed, Seen, Source, Still, Window, follow_from_time, one_turn
from ballpass.runtime.ask.replay import Replay, replay
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.run import inputs as clock
from ballpass.runtime.run.casadi_integrators import GRID
from ballpass.runtime.run.segments import time_resolution

if TYPE_CHECKING:
    from ballpass.runtime.run.solution import Solution

Kind = Literal["max", "min"]

#: How a peak was looked for between the samples.
Searched = Literal["every step", "dense samples", "samples"]

#: Balls' channels of the reductions whose maximum, that of the most loaded ball, is the output's.
_OF_BALLS = ("ball.force", "ball.elastic_force", "ball.damping_force", "ball.deflection")

#: A peak whose value changes by less than this, relative to itself, from one grid to the next is settled [1].
SETTLED = 1e-9

#: Narrowest interval that is looked at, in times that count as different.
NARROWEST = 1e3

#: Intervals that a survey shows to be promising are looked at, the best first, up to so many for each candidate.
LOOKS = 16

#: Calls of the stepper in which a peak is settled: those with the largest values, less the largest by no more than
#: this [1].  Reductions meet smooth tops to 1e-9, those where a force jumps to a part of a step.
CALLS, NEARLY = 3, 1e-3

#: Features of an output that differ by less than this, relative to its largest value, are one that comes back [1].
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
    searched : where was looked for it.  ``every step``: in each step of this very run.  ``dense samples``: at several
        points for each of its steps on average, or of each interval between samples where the output follows from time
        alone.  ``samples``: where the samples and the rates there promise something; a spike that shows in neither is
        missed, which more samples rule out
    unsearched : intervals between samples that promised more than `value` and were not looked at, for there are so many
    """

    value: float
    time: float
    ball: int | None
    sampled: float
    searched: Searched = "samples"
    unsearched: int = 0


@dataclass(slots=True, kw_only=True, eq=False)
class _Search:
    """One extreme of one output.

    Attributes
    ----------
    name, kind : which
    samples : of the output, times `sign`, shape (samples, columns)
    best : highest value known, times `sign`, its time [s] and its column
    windows : to be looked into
    promises : what intervals between samples promise, times `sign`, and these intervals, the best first
    """

    name: str
    kind: Kind
    samples: np.ndarray
    best: tuple[float, float, int]
    sampled: float
    searched: Searched = "samples"
    unsearched: int = 0
    windows: list[Window] = field(default_factory=list)
    promises: list[tuple[float, int]] = field(default_factory=list)

    @property
    def sign(self) -> float:
        return 1.0 if self.kind == "max" else -1.0

    def offer(self, value: float, time: float, column: int) -> None:
        """A value that the output takes, times `sign`."""
        if value > self.best[0]:
            self.best = (value, time, column)

    def look_around(self, solution: Solution, candidates: int) -> None:
        """Windows around the largest samples; where every step was looked into, only around those that may be higher
        still by as much as they are above their neighbours."""
        largest = np.max(self.samples, axis=1)
        for k in _tops(self.samples, candidates):
            low, high = max(k - 1, 0), min(k + 1, len(solution) - 1)
            reach = largest[k] - min(largest[low], largest[high])
            if self.searched != "every step" or largest[k] + reach > self.best[0]:
                self.windows.append(_window(solution, low, high))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Top:
    """Best point of a grid: its value, and how much higher the output may be between it and its neighbours."""

    value: float
    reach: float
    around: Window


def refine_peak(
    model: LoadedModel,
    numbers: Numbers,
    solution: Solution,
    name: str,
    *,
    kind: Kind = "max",
    candidates: int = 6,
) -> Peak:
    """Peak of an output over the time between the first and the last sample of `solution` (for its steady part, give
    `Solution.steady`).

    Parameters
    ----------
    model, numbers : the model and the run's numbers
    solution : a run of this model
    name : an output
    kind : which extreme
    candidates : so many of the largest samples that top their neighbours are looked at closely, and so many at a time
        of the intervals between samples that promise more

    Raises
    ------
    RequestError
        No such output, fewer than three samples, or another `kind`.
    """
    return refine_peaks(model, numbers, solution, [(name, kind)], candidates=candidates)[0]


def refine_peaks(
    model: LoadedModel,
    numbers: Numbers,
    solution: Solution,
    wanted: Sequence[tuple[str, Kind]],
    *,
    candidates: int = 6,
) -> list[Peak]:
    """Several peaks of one run, which is integrated for all of them together; else as `refine_peak`."""
    searches = [_start(solution, name, kind) for name, kind in wanted]
    still = follow_from_time(model, [name for name, _ in wanted])
    of_time = [search for search in searches if search.name in still]
    moving = [search for search in searches if search.name not in still]
    turn = clock.period(model.manifest, numbers.values)
    if of_time:
        part = one_turn(model, numbers, solution, still)
        source = Still(model, numbers, part)
        for search in of_time:
            search.searched = "dense samples"
            search.samples = search.samples[: len(part)]
            search.look_around(part, candidates)
        _edges(source, part, of_time)
        _survey(source, part, of_time)
        _find(source, part, of_time, candidates, turn)
    if moving:
        met = replay(model, numbers, solution, [search.name for search in moving])
        surveyed = moving
        if met is not None:
            surveyed = [search for search in moving if not _reduced(met, solution, search)]
        for search in moving:
            search.look_around(solution, candidates)
        chosen = Resumed(model, numbers, solution) if met is None else met
        if surveyed:
            _survey(chosen, solution, surveyed)
        _find(chosen, solution, moving, candidates, turn)
    return [_peak(solution, search) for search in searches]


def _start(solution: Solution, name: str, kind: Kind) -> _Search:
    """A search that knows the samples."""
    if kind not in ("max", "min"):
        raise RequestError(f"kind: 'max' or 'min' is expected, not {kind!r}.")
    if name not in solution.outputs:
        solution[name]  # unknown names are refused with the nearest known ones
        raise RequestError(f"{name!r} is a state but no output: add it to the scene's run.outputs.")
    if len(solution) < 3:
        raise RequestError(
            f"A peak needs three samples at least; the solution has {len(solution)}. Run longer, or take more "
            "samples_per_cycle."
        )
    sign = 1.0 if kind == "max" else -1.0
    samples = sign * solution[name].reshape(len(solution), -1)
    k, column = divmod(int(np.argmax(samples)), samples.shape[1])
    best = (float(samples[k, column]), float(solution.t[k]), column)
    return _Search(name=name, kind=kind, samples=samples, best=best, sampled=sign * best[0])


def _window(solution: Solution, low: int, high: int) -> Window:
    """From one sample to another."""
    begin, end = float(solution.t[low]), float(solution.t[high])
    return Window(begin=begin, end=end, count=GRID * (high - low), x=solution.x[low])


def _tops(samples: np.ndarray, count: int) -> list[int]:
    """Indices of the largest samples that no neighbour exceeds, each index once; of features that come back, one."""
    padded = np.pad(samples, ((1, 1), (0, 0)), constant_values=-np.inf)
    top = (samples >= padded[:-2]) & (samples >= padded[2:])
    heights = np.max(np.where(top, samples, -np.inf), axis=1)
    largest = np.max(samples, axis=1)
    return _different(heights, largest, count)


def _different(heights: np.ndarray, shape: np.ndarray, count: int) -> list[int]:
    """Places of the largest `heights`, those with equal `shape` around them once."""
    order = np.argsort(-heights, kind="stable")
    finite = np.where(np.isfinite(shape), shape, 0.0)
    scale = ALIKE * max(float(np.max(np.abs(finite))), float(np.finfo(float).tiny) / ALIKE)
    around = np.pad(finite, 1, mode="edge")
    seen: dict[tuple[float, ...], None] = {}
    found: list[int] = []
    for k in order.tolist():
        if len(found) == count or heights[k] == -np.inf:
            break
        key = tuple(np.rint(around[k : k + 3] / scale).tolist()) if np.isfinite(heights[k]) else (k,)
        if key not in seen:
            seen[key] = None
            found.append(k)
    return found


def _reduced(met: Replay, solution: Solution, search: _Search) -> bool:
    """Windows around the extremes that the run's reductions show; whether these cover the search."""
    search.searched = "dense samples"
    if search.name not in met.model.states and (search.name not in _OF_BALLS or search.kind == "min"):
        return False
    extremes, whole = met.extremes(search.name, search.kind)
    extremes.sort(key=lambda found: -search.sign * found.value)
    t = solution.t
    for found in extremes[:CALLS]:
        if search.sign * (extremes[0].value - found.value) > NEARLY * abs(extremes[0].value):
            break
        search.offer(search.sign * found.value, found.time, found.column)
        k = int(np.clip(np.searchsorted(t, found.time, side="right") - 1, 0, len(t) - 2))
        reach = min(float(t[k + 1] - t[k]), 4.0 * met.step)
        begin, end = max(found.time - reach, float(t[0])), min(found.time + reach, float(t[-1]))
        if begin < end:
            search.windows.append(Window(begin=begin, end=end, count=2 * GRID, x=solution.x[k]))
    if whole:
        search.searched = "every step"
    return whole


def _edges(source: Still, solution: Solution, searches: Sequence[_Search]) -> None:
    """Windows where an output is higher beside an edge than at the samples around it."""
    seen = source.edges([search.name for search in searches])
    place = np.clip(np.searchsorted(solution.t, seen.t, side="right") - 1, 0, len(solution) - 2)
    for search in searches:
        beside = np.max(search.sign * seen.values[search.name], axis=1)
        around = np.max(np.maximum(search.samples[place], search.samples[place + 1]), axis=1)
        search.promises += [(float(beside[k]), int(place[k])) for k in np.flatnonzero(beside > around)]


def _survey(source: Source, solution: Solution, searches: Sequence[_Search]) -> None:
    """What every interval promises that goes beyond the samples at its ends; what is no number promises everything."""
    inside = {id(search): np.full(len(solution) - 1, -np.inf) for search in searches}
    for part in source.survey(list(dict.fromkeys(search.name for search in searches))):
        for search in searches:
            values = search.sign * part.values[search.name]
            highest = np.max(np.where(np.isnan(values), np.inf, values), axis=(1, 2))
            inside[id(search)][part.first : part.first + len(highest)] = highest
    for search in searches:
        highest = inside[id(search)]
        ends = np.max(search.samples, axis=1)
        beyond = highest > np.maximum(ends[:-1], ends[1:])
        search.promises += [(float(highest[k]), int(k)) for k in np.flatnonzero(beyond)]


def _find(source: Source, solution: Solution, searches: Sequence[_Search], candidates: int, turn: float) -> None:
    """Look into the windows, then into the intervals that promise more than was found, as long as there are any."""
    _settle(source, searches, turn)
    for search in searches:
        heights = np.full(len(solution) - 1, -np.inf)
        for promise, k in search.promises:
            heights[k] = max(heights[k], promise)
        order = _different(heights, heights, len(heights))
        search.promises = [(float(heights[k]), k) for k in order]
    for _ in range(LOOKS):
        for search in searches:
            search.promises = [(promise, k) for promise, k in search.promises if promise > search.best[0]]
            search.windows = [_window(solution, k, k + 1) for _, k in search.promises[:candidates]]
            del search.promises[:candidates]
        if not any(search.windows for search in searches):
            break
        _settle(source, searches, turn)
    for search in searches:
        search.unsearched = sum(promise > search.best[0] for promise, _ in search.promises)


def _settle(source: Source, searches: Sequence[_Search], turn: float) -> None:
    """Look into all windows, and around the best point of each on grids that get finer until its value stays, or time
    has no finer steps.

    No curve is laid through the points: where a load jumps or two balls change rank, none would fit.
    """
    active: list[tuple[_Search, Window, float | None]] = [
        (search, window, None) for search in searches for window in search.windows
    ]
    while active:
        names = list(dict.fromkeys(search.name for search, _, _ in active))
        seen = source.look([window for _, window, _ in active], names)
        tops = [_top(search, part) for (search, _, _), part in zip(active, seen, strict=True)]
        following: list[tuple[_Search, Window, float | None]] = []
        for (search, _, before), top in zip(active, tops, strict=True):
            if before is not None and abs(top.value - before) <= SETTLED * abs(before):
                continue
            begin, end = top.around.begin, top.around.end
            narrow = end - begin <= NARROWEST * time_resolution(begin, end, turn)
            if top.value + top.reach > search.best[0] and not narrow:
                following.append((search, top.around, top.value))
        active = following
    for search in searches:
        search.windows = []


def _top(search: _Search, seen: Seen) -> _Top:
    """Best point of a grid, offered to the search."""
    fine = search.sign * seen.values[search.name]
    row, column = divmod(int(np.argmax(fine)), fine.shape[1])
    value = float(fine[row, column])
    search.offer(value, float(seen.t[row]), column)
    low, high = max(row - 1, 0), min(row + 1, len(fine) - 1)
    return _Top(
        value=value,
        reach=value - float(np.min(np.max(fine[[low, high]], axis=1))),
        around=Window(begin=float(seen.t[low]), end=float(seen.t[high]), count=2 * GRID, x=seen.x[low]),
    )


def _peak(solution: Solution, search: _Search) -> Peak:
    value, time, column = search.best
    return Peak(
        value=search.sign * value,
        time=time,
        ball=column + 1 if solution[search.name].ndim == 2 else None,
        sampled=search.sampled,
        searched=search.searched,
        unsearched=search.unsearched,
    )
