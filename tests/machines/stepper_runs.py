"""Runs of the project's own stepper by hand: segments from a model's breakpoints, one raw call, states at chosen
times."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ballpass.runtime import Model
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.stepper import Outcome, Segments
from ballpass.runtime.request.segments import TURNED, segment_edges
from ballpass.runtime.time import timeline


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """What a raw call gave: its outcome, the state at the end, the states at the output times."""

    outcome: Outcome
    end: np.ndarray
    states: np.ndarray


def segments_between(model: Model, numbers: Numbers, edges: np.ndarray, gates: np.ndarray | None = None) -> Segments:
    """Segments with the inputs that hold in them; `gates` are the edges that gates and restarts follow instead."""
    inputs = model.manifest.inputs
    middles = [0.5 * (a + b) for a, b in pairwise(edges if gates is None else gates)]
    pairs = zip(edges[:-1], middles, strict=True)
    u = np.array([timeline.inputs_at(model.manifest, numbers.values, float(a), float(middle)) for a, middle in pairs])
    u = u.reshape(len(edges) - 1, len(inputs))
    switching = [k for k, info in enumerate(inputs) if info.kind not in TURNED]
    restarts = np.concatenate([[True], np.any(np.diff(u[:, switching], axis=0) != 0.0, axis=1)])
    return Segments(times=np.array(edges, dtype=float), inputs=u, restarts=restarts)


def edges_of(model: Model, numbers: Numbers, begin: float, end: float) -> np.ndarray:
    """Breakpoints and whole turns of a run, with its begin and end [s]."""
    return segment_edges(model, numbers, begin, end, timeline.stretch(model.manifest, numbers.values))


def run(
    model: Model,
    numbers: Numbers,
    segments: Segments,
    *,
    method: str,
    tolerance: np.ndarray | float,
    start: np.ndarray | None = None,
    output_times: np.ndarray | None = None,
    **options: Any,
) -> Run:
    """One raw call; outputs at the segments' ends unless `output_times` says otherwise."""
    initial = np.array([numbers.values[name] for name in model.manifest.initial]) if start is None else start
    x = np.array(initial, dtype=float)
    times = segments.times if output_times is None else np.array(output_times, dtype=float)
    states = np.full((len(times), len(x)), np.nan)
    outcome = model.stepper.run(
        method=method,
        tolerance=np.broadcast_to(tolerance, x.shape).astype(float),
        p=numbers.p,
        c=numbers.c,
        x=x,
        segments=segments,
        output_times=times,
        output_states=states,
        **options,
    )
    return Run(outcome=outcome, end=x, states=states)
