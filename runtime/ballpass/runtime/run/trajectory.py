"""Samples of a run on the way: their times, states, and what outputs are evaluated with.

In: sample times and the segments of a run.  Out: a `Trajectory`, which an integrator fills, and the outputs at its
samples.  A sample that meets an edge shows the state there with the loads behind it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.contract.status import Status
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.stepper import Segments
from ballpass.runtime.run.segments import make_segments, segment_edges, time_resolution


@dataclass(slots=True, kw_only=True, eq=False)
class Trajectory:
    """Samples of a run, filled up to `finished`.

    Attributes
    ----------
    begin, end : of the run [s]
    turn : time of a turn, infinite where nothing turns [s]
    initial : state at its begin, shape (states,)
    t : times of the samples, increasing, shape (samples,) [s]
    even : whether they are the ends of equal intervals of the whole run
    x : states there, shape (samples, states)
    segments : of the run
    stops : first sample of each segment, and behind them the number of samples, shape (segments + 1,)
    near : times closer than this are one time [s]
    finished : samples filled
    passed : segments integrated, at least in part
    calls : calls of the integrator
    """

    begin: float
    end: float
    turn: float
    initial: np.ndarray
    t: np.ndarray
    even: bool
    x: np.ndarray
    segments: Segments
    stops: np.ndarray
    near: float
    finished: int = 0
    passed: int = 0
    calls: int = 0


@dataclass(slots=True, kw_only=True)
class Cost:
    """What an integration took.

    Attributes
    ----------
    steps, rejected : accepted and rejected steps
    kinks, located : what it did at kinks, and how many of them it located
    families : those the stepper ended with
    """

    steps: int = 0
    rejected: int = 0
    kinks: str | None = None
    located: int | None = None
    families: list[str] = field(default_factory=list)


class Interrupted(Exception):
    """The integration ended early, in `state` where that is known; the trajectory holds `finished` samples."""

    def __init__(self, status: Status, time: float, detail: str, state: np.ndarray | None = None) -> None:
        super().__init__(detail)
        self.status, self.time, self.detail, self.state = status, time, detail, state


def start_trajectory(
    model: LoadedModel,
    numbers: Numbers,
    times: np.ndarray,
    initial: np.ndarray,
    interval: tuple[float, float],
    turn: float,
    *,
    even: bool,
    start: float = 0.0,
) -> Trajectory:
    """Memory for samples, and the segments they lie in.

    Parameters
    ----------
    times : of the samples, increasing, shape (samples,) [s]
    initial : state at the start, shape (states,)
    interval : begin and end of the run [s]
    turn : time of a turn, infinite where nothing turns [s]
    even : whether the samples are the ends of equal intervals of the whole run
    start : time from which on the run counts, an edge where it lies within [s]
    """
    begin, end = interval
    near = time_resolution(begin, end, turn)
    edges = segment_edges(model, numbers, begin, end, turn)
    if begin < start < end and np.min(np.abs(edges - start)) > near:
        edges = np.sort(np.append(edges, start))
    segments = make_segments(model.manifest.inputs, numbers, edges)
    stops = np.searchsorted(times, segments.times - near)
    stops[0], stops[-1] = 0, len(times)
    return Trajectory(
        begin=begin,
        end=end,
        turn=turn,
        initial=initial,
        t=times,
        even=even,
        x=np.empty((len(times), len(initial))),
        segments=segments,
        stops=stops,
        near=near,
    )


def evaluate_outputs(
    model: LoadedModel, numbers: Numbers, trajectory: Trajectory, names: Sequence[str]
) -> dict[str, np.ndarray]:
    """Outputs of these names at the finished samples: shape (samples,), or (samples, balls)."""
    done = trajectory.finished
    states = {state.name: k for k, state in enumerate(model.manifest.states)}
    sizes = {info.name: info.size for info in model.manifest.outputs}
    computed = [name for name in names if name not in states]
    samples: dict[str, np.ndarray] = {}
    if computed:
        lengths = np.diff(np.minimum(trajectory.stops, done))
        segments = trajectory.segments
        values = {
            "t": trajectory.t[:done] - np.repeat(segments.times[:-1], lengths),
            "x": trajectory.x[:done],
            "u": np.repeat(segments.inputs, lengths, axis=0),
            "p": numbers.p,
            "c": numbers.c,
        }
        samples = model.sample_outputs(done, values, computed)
    found = {}
    for name in names:
        if name in states:  # the very numbers, not a copy that rounding might touch
            found[name] = trajectory.x[:done, states[name]].copy()
        else:
            found[name] = samples[name] if sizes[name] > 1 else samples[name][:, 0]
    return found
