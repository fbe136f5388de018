"""Samples of a run: their times and states, and the arguments of their outputs.

In: sample times and the segments of a run.  Out: a `Trajectory`, which an integrator fills, and the outputs at its
samples.  A sample on an edge has the loads that act after it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.contract.status import Status
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.stepper import Segments
from ballpass.runtime.request.resolve import Run
from ballpass.runtime.request.sampling import Sampling
from ballpass.runtime.request.segments import check_count, time_resolution
from ballpass.runtime.run.loop import segments_of


@dataclass(slots=True, kw_only=True, eq=False)
class Trajectory:
    """Samples of a run, filled up to `finished`.

    Attributes
    ----------
    t : times of the samples, increasing, shape (samples,) [s]
    even : whether they are the ends of equal intervals of the whole run
    x : states there, shape (samples, states)
    segments : of the run
    stops : first sample of each segment, and behind them the number of samples, shape (segments + 1,)
    near : times closer than this are one time [s]
    finished : samples filled
    passed : segments integrated, at least in part
    calls : calls of the integrator
    steps, rejected : of the integration
    """

    t: np.ndarray
    even: bool
    x: np.ndarray
    segments: Segments
    stops: np.ndarray
    near: float
    finished: int = 0
    passed: int = 0
    calls: int = 0
    steps: int = 0
    rejected: int = 0


class Interrupted(Exception):
    """The integration ended early; the trajectory holds `finished` samples."""

    def __init__(self, status: Status, time: float, detail: str) -> None:
        super().__init__(detail)
        self.status, self.time, self.detail = status, time, detail


def start_trajectory(run: Run, sampling: Sampling) -> Trajectory:
    """Memory for the samples of a run, and the segments they lie in."""
    near = time_resolution(run.begin, run.end, run.stretch)
    check_count(run.model.manifest, run.numbers, run.duration, run.stretch)
    segments = segments_of(run)
    stops = np.searchsorted(sampling.times, segments.times - near)
    stops[0], stops[-1] = 0, len(sampling.times)
    return Trajectory(
        t=sampling.times,
        even=sampling.even,
        x=np.empty((len(sampling.times), len(run.initial))),
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
