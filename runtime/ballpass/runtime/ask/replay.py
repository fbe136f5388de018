"""A run of the project's own stepper once more, to the bit, and what its steps show between its samples.

In: a model and a solution.  Out: a `Replay`, or None where the run was not met again: another method, other numbers of
another machine, derivatives that took part in the choice of steps.

The stepper's steps do not depend on where a run is sampled, and each of its calls starts from a state alone.  So the
run is integrated once, with reductions that look into every step; the state where each call begins is kept, and the
call with a peak is integrated again with samples where the peak is.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from ballpass.runtime.ask.between_samples import POINTS, Seen, Survey, Window, sampled_outputs
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.ensemble_driver import BALL_CHANNELS, HEAD, ROWS
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.stepper import METHODS as STEPPERS
from ballpass.runtime.native.stepper import Family, Segments
from ballpass.runtime.run import inputs as clock
from ballpass.runtime.run.locating import LOCATED, STEPPED_OVER, Kinks
from ballpass.runtime.run.segments import part_of
from ballpass.runtime.run.stepping import Cost, step_through
from ballpass.runtime.run.trajectory import Interrupted, Trajectory, start_trajectory

if TYPE_CHECKING:
    from ballpass.runtime.run.solution import Solution

#: Points for each step, on average, where outputs that the driver does not reduce are looked at; fewest and most points
#: between two samples.
POINTS_A_STEP, FEWEST, MOST = 8, 4, 256


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Call:
    """A call of the stepper.

    Attributes
    ----------
    first, last : its segments, the last one excluded
    state : where it begins, shape (states,)
    row : its reductions
    """

    first: int
    last: int
    state: np.ndarray
    row: np.ndarray


@dataclass(frozen=True, slots=True, kw_only=True)
class Extreme:
    """Extreme of a channel within a call: its value, when [s], and its column (ball), counted from 0."""

    value: float
    time: float
    column: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Replay:
    """A run that was met again.

    Attributes
    ----------
    model, numbers, solution : the model, the run's numbers, the run
    family, tolerance, kinks : how the stepper was called
    segments : of the run
    turn : time of a turn [s]
    near : times closer than this are one time [s]
    calls : of the stepper
    steps : accepted, of the whole run
    """

    model: LoadedModel
    numbers: Numbers
    solution: Solution
    family: Family
    tolerance: np.ndarray
    kinks: Kinks
    segments: Segments
    turn: float
    near: float
    calls: tuple[Call, ...]
    steps: int

    @property
    def step(self) -> float:
        """Mean step [s]."""
        return float(self.segments.times[-1] - self.segments.times[0]) / max(self.steps, 1)

    def extremes(self, channel: str, kind: Literal["max", "min"]) -> tuple[list[Extreme], bool]:
        """Extremes of a channel, one of each call, and whether they cover all time between the solution's samples."""
        channels = (*self.model.states, *BALL_CHANNELS)
        t, edges = self.solution.t, self.segments.times
        reduced = edges[int(np.searchsorted(edges, t[0] - self.near)) :]
        whole = bool(len(reduced)) and reduced[0] <= t[0] + self.near
        found = []
        for call in self.calls:
            if not call.row[HEAD.index("duration")] > 0.0:
                continue
            value, time, ball = (
                float(call.row[len(HEAD) + ROWS.index(row) * len(channels) + channels.index(channel)])
                for row in (kind, f"{kind}_time", f"{kind}_ball")
            )
            if time <= t[-1] + self.near:
                found.append(Extreme(value=value, time=time, column=max(int(ball) - 1, 0)))
            else:  # it may hide a lower one before the last sample
                whole = False
        return found, whole

    def look(self, windows: Sequence[Window], names: Sequence[str]) -> list[Seen]:
        """Outputs on the grids of windows, of the very steps of the run."""
        grids = [window.times for window in windows]
        times = np.unique(np.concatenate(grids))
        x, values = self._at(times, names)
        found = []
        for grid in grids:
            places = np.searchsorted(times, grid)
            found.append(Seen(t=grid, x=x[places], values={name: array[places] for name, array in values.items()}))
        return found

    def survey(self, names: Sequence[str]) -> Iterator[Survey]:
        """Outputs within the intervals between samples, several points for each step."""
        t = self.solution.t
        parts = POINTS_A_STEP * (float(t[-1]) - float(t[0])) / (self.step * (len(t) - 1))
        count = int(np.clip(np.ceil(parts), FEWEST, MOST))
        part = np.arange(1, count) / count
        size = max(1, POINTS // count)
        for first in range(0, len(t) - 1, size):
            begin, end = t[first : first + size + 1][:-1], t[first + 1 : first + 1 + size]
            times = begin[:, None] + (end - begin)[:, None] * part
            _, values = self._at(times.ravel(), names)
            shaped = {name: array.reshape(*times.shape, -1) for name, array in values.items()}
            yield Survey(first=first, t=times, values=shaped)

    def _at(self, times: np.ndarray, names: Sequence[str]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """States and outputs at increasing times, shapes (times, states) and (times, columns)."""
        edges = self.segments.times
        starts = np.array([edges[call.first] for call in self.calls[1:]])
        owner = np.searchsorted(starts, times + self.near, side="right")
        states, outputs = [], []
        for k in np.unique(owner):
            trajectory = self._filled(self.calls[int(k)], times[owner == k])
            states.append(trajectory.x)
            outputs.append(sampled_outputs(self.model, self.numbers, trajectory, names, False))
        return np.concatenate(states), {name: np.concatenate([found[name] for found in outputs]) for name in names}

    def _filled(self, call: Call, times: np.ndarray) -> Trajectory:
        """A call integrated again as far as `times`, and sampled there."""
        edges = self.segments.times[call.first : call.last]
        last = call.first + max(int(np.searchsorted(edges, times[-1] + self.near, side="right")), 1)
        segments = part_of(self.segments, call.first, last)
        stops = np.searchsorted(times, segments.times - self.near)
        stops[0], stops[-1] = 0, len(times)
        trajectory = Trajectory(
            begin=float(segments.times[0]),
            end=float(segments.times[-1]),
            turn=self.turn,
            initial=call.state,
            t=times,
            even=False,
            x=np.empty((len(times), len(call.state))),
            segments=segments,
            stops=stops,
            near=self.near,
        )
        try:
            step_through(*(self.model, self.numbers, self.family, self.tolerance, trajectory, Cost()), kinks=self.kinks)
        except Interrupted:  # a run that failed fails again, behind its last sample
            if trajectory.finished < len(times):
                raise
        return trajectory


def replay(model: LoadedModel, numbers: Numbers, solution: Solution, channels: Collection[str]) -> Replay | None:
    """Integrate a run of the stepper once more, reducing `channels`; None where it is not met to the bit.

    Parameters
    ----------
    channels : states, or channels of the balls
    """
    statistics = solution.statistics
    if statistics.method not in STEPPERS or not model.has_stepper or solution.states != model.states:
        return None
    family, kinks = STEPPERS[statistics.method], LOCATED if statistics.kinks == LOCATED else STEPPED_OVER
    tolerance = statistics.rtol * np.array(statistics.magnitudes)
    turn = clock.period(model.manifest, numbers.values)
    # solutions of earlier versions do not tell
    initial = [numbers.values[name] for name in model.manifest.initial]
    initial = list(statistics.initial) if statistics.initial is not None else initial
    duration = statistics.duration if statistics.duration is not None else float(solution.t[-1])
    trajectory = start_trajectory(
        model, numbers, solution.t, np.array(initial, dtype=float), (0.0, duration), turn, even=False
    )
    known = (*model.states, *BALL_CHANNELS)
    wanted = sum(2**k for k, name in enumerate(known) if name in channels)
    calls: list[Call] = []

    def reduced(first: int, last: int, state: np.ndarray) -> np.ndarray:
        row = np.zeros(len(HEAD) + len(ROWS) * len(known))
        row[HEAD.index("from")] = float(solution.t[0]) - trajectory.near
        row[HEAD.index("wanted")] = wanted
        calls.append(Call(first=first, last=last, state=state.copy(), row=row))
        return row

    cost = Cost()
    with suppress(Interrupted):  # where the run failed before; if not there, samples are missing
        step_through(model, numbers, family, tolerance, trajectory, cost, kinks=kinks, reduced=reduced)
    if trajectory.finished < len(solution.t) or not np.array_equal(trajectory.x, solution.x):
        return None
    return Replay(
        model=model,
        numbers=numbers,
        solution=solution,
        family=family,
        tolerance=tolerance,
        kinks=kinks,
        segments=trajectory.segments,
        turn=turn,
        near=trajectory.near,
        calls=tuple(calls),
        steps=cost.steps or 1,
    )
