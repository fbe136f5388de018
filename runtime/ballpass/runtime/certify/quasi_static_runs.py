"""Whole runs of the quasi-static model: samples on a grid, and on-line reductions.

In: a model, numbers, the run's grid or span.  Out: the samples filled in, or the reduction added to.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ballpass.runtime.certify.quasi_static import STATUS_OF_END, End
from ballpass.runtime.contract.errors import SimulationError
from ballpass.runtime.contract.status import Status
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.run import inputs as clock
from ballpass.runtime.run.segments import edge_windows, make_segments
from ballpass.runtime.run.stepping import Cost
from ballpass.runtime.run.trajectory import Interrupted, Trajectory

if TYPE_CHECKING:
    from ballpass.runtime.contract.parameters import Numbers


def fill_quasi_static(
    model: LoadedModel,
    numbers: Numbers,
    tolerance: np.ndarray,
    trajectory: Trajectory,
    cost: Cost,
    progress: Callable[[float], None] | None = None,
) -> None:
    """Fill the samples of `trajectory` with equilibria; the search starts at its initial state.

    Raises
    ------
    Interrupted
        There is no equilibrium at some instant, or it is not the only one.
    """
    edges = trajectory.segments.times
    reference = np.repeat(edges[:-1], np.diff(trajectory.stops))
    # a sample that rounding puts before the edge it lies on belongs behind it, where the loads have switched
    wanted = np.clip(np.maximum(trajectory.t, reference), edges[0], edges[-1])
    outcome = model.quasi_static.run(
        tolerance=tolerance,
        p=numbers.p,
        c=numbers.c,
        x=trajectory.initial.copy(),
        segments=make_segments(model.manifest.inputs, numbers, edges),
        output_times=wanted,
        output_states=trajectory.x,
    )
    cost.steps, cost.rejected = outcome.steps, outcome.rejected
    trajectory.passed = len(edges) - 1
    trajectory.calls += 1
    trajectory.finished = outcome.written
    if outcome.end is not End.DONE:
        raise Interrupted(STATUS_OF_END[outcome.end], outcome.time, "")
    if progress is not None:
        progress(1.0)


def reduce_quasi_static(
    model: LoadedModel,
    numbers: Numbers,
    tolerance: np.ndarray,
    state: np.ndarray,
    row: np.ndarray,
    span: tuple[float, float, float],
) -> tuple[int, int]:
    """Follow one run, adding to a reduction; `state` is where the search starts, and is brought to the end.

    Parameters
    ----------
    span : duration, time of a turn, time from which on is reduced [s].  What lies before is left out: an equilibrium
        has no transient

    Returns
    -------
    steps, rejected steps

    Raises
    ------
    QuasiStaticFailed
        There is no equilibrium at some instant, or it is not the only one.
    """
    duration, turn, start = span
    steps = rejected = 0
    for edges in edge_windows(model, numbers, duration, turn, start):
        kept = edges[edges >= start]
        if len(kept) < 2:
            continue
        outcome = model.quasi_static.run(
            tolerance=tolerance,
            p=numbers.p,
            c=numbers.c,
            x=state,
            segments=make_segments(model.manifest.inputs, numbers, kept),
            output_times=np.zeros(0),
            output_states=None,
            reduction=row,
        )
        steps, rejected = steps + outcome.steps, rejected + outcome.rejected
        if outcome.end is not End.DONE:
            angle = clock.crank_angle(model.manifest, numbers.values, outcome.time)
            raise QuasiStaticFailed(STATUS_OF_END[outcome.end], outcome.time, angle)
    return steps, rejected


class QuasiStaticFailed(SimulationError):
    """The quasi-static model has no answer at an instant.

    Attributes
    ----------
    status : why
    time : when [s]
    """

    def __init__(self, status: Status, time: float, crank_angle: float) -> None:
        self.status, self.time = status, time
        super().__init__(f"{status.value}\nt = {time:.9g} s, crank angle {math.degrees(crank_angle):.4f} deg.")
