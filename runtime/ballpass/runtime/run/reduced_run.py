"""A run of the project's own stepper that keeps reductions only, in bounded memory.

In: a `Run`.  Out: `Reductions`.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from ballpass.runtime.native.reduction_rows import reduction_rows
from ballpass.runtime.request.resolve import Run
from ballpass.runtime.run.loop import ReductionRow, RunUnderWay, start_run
from ballpass.runtime.run.reductions import Reductions, channel_names, reductions_of


def reduced(run: Run) -> Reductions:
    """Reductions of the steady turns of a run.

    Raises
    ------
    RequestError
        The run ends within its transient.
    SimulationError
        The computation failed.
    """
    going = start_reducing(run, channel_names(run.model.manifest))
    going.go_on()
    return going.reductions()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReducedRun:
    """A run that keeps reductions, up to the time reached.

    Attributes
    ----------
    going : the run
    row : the reductions so far
    channels : that are reduced
    """

    going: RunUnderWay
    row: np.ndarray
    channels: Sequence[str]

    def go_on(self, until: float | None = None) -> None:
        """Integrate to the end, or to another time [s]; SimulationError where that fails."""
        self.going.go_on(until)

    @property
    def run(self) -> Run:
        """What runs."""
        return self.going.run

    def take(self) -> Reductions:
        """Those since the last time that they were taken."""
        found = self.reductions()
        layout = reduction_rows(self.run.model.manifest)
        self.row[:] = layout.empty(1, self.going.time, layout.all_of(self.channels), self.run.rtol)[0]
        return found

    def reductions(self) -> Reductions:
        """Those so far."""
        going = self.going
        found = reductions_of(
            going.run.model.manifest,
            self.row,
            self.channels,
            end=going.state,
            steps=going.steps,
            rejected=going.rejected,
            turn=going.run.span.turning.turn,
        )
        assert found is not None  # `check_steady` leaves some time
        return found


def start_reducing(run: Run, channels: Collection[str]) -> ReducedRun:
    """A run that reduces these channels, before its first step.

    Raises
    ------
    RequestError
        The run ends within its transient.
    """
    layout = reduction_rows(run.model.manifest)
    row = layout.empty(1, run.check_steady().start, layout.all_of(channels), run.rtol)[0]
    sink = ReductionRow(row=row, before=layout.empty(1, 0.0, ())[0])
    return ReducedRun(going=start_run(run, [sink]), row=row, channels=tuple(channels))
