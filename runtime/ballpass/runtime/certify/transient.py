"""The transient of a scene that states no run: turns until the start has no effect on the motion.

In: a model, or a `Run`.  Out: run settings, or what a moved start still changes.

The balls meet the load elsewhere in each turn, so that other turns have other peaks, steady or not.  The same turns
from two starts have the balls at the same places: what differs is of the start.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ballpass.runtime.certify.growth import Growth, by_moved_start
from ballpass.runtime.contract.errors import RequestError, SimulationError
from ballpass.runtime.contract.manifest import RunInfo
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.request.request import Request
from ballpass.runtime.request.resolve import Run, resolve
from ballpass.runtime.time.repetition import Repetition

#: How far the rings are moved at the start, in their magnitudes [1]: what a start at rest is off by.
MOVED = 0.1

#: Change of an extreme or rms by a moved start, over the largest, that counts as none [1]: other turns differ by more.
FORGOTTEN = 2e-3

#: Steps that the search may take: about a second.
SEARCH = 400_000


def find_transient(model: LoadedModel) -> RunInfo:
    """Run settings of a scene that states none: its turns, behind as many as the motion takes to forget its start.

    The transient is doubled until that is so at the scene's own numbers; runs of other numbers are as long, so that
    neighbours are alike.  Where `SEARCH` steps do not suffice it is as it was; `still_changes` has what that leaves.
    """
    given = model.manifest.run
    numbers = model.numbers()
    if given.cycles is None or not (model.has_stepper and model.states):
        return given
    repetition = Repetition.of(model.manifest, numbers.values)
    if not repetition.holds(repetition.driver.after(given.transient_cycles)):
        return given
    transient, length, left = given.transient_cycles, given.cycles - given.transient_cycles, SEARCH
    try:
        while left > 0:
            run = resolve(model, numbers, Request(cycles=transient + length, transient_cycles=transient))
            found = still_changes(run)
            if not remembered(found):
                return replace(given, cycles=transient + length, transient_cycles=transient)
            transient *= 2.0
            left -= 2 * found.steps
    except (RequestError, SimulationError):
        pass  # the run that is asked for says what is wrong
    return given


def remembered(found: Growth) -> list[str]:
    """Channels that have not forgotten the start."""
    return [name for name in found.uncertain if found.changes[name] > FORGOTTEN]


def still_changes(run: Run) -> Growth:
    """What rings that start elsewhere change in the turns that count.

    Raises
    ------
    SimulationError
        The computation failed.
    """
    moved = MOVED * run.magnitude[: len(run.magnitude) // 2]
    mechanism = run.model.manifest.mechanism
    if mechanism is not None and mechanism.angle:
        # a driver that starts elsewhere stays elsewhere
        moved[np.array(run.model.states[: len(moved)]) == mechanism.angle] = 0.0
    return replace(by_moved_start(run, moved, SEARCH), moved=MOVED)
