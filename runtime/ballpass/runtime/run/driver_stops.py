"""Where a driver that a torque turns comes to the end of the angles for which its linkage is valid.

A driver turns back where its linkage locks, with a smooth motion: the dyad passes into its other position, while the
equations go on with the first one.  Steps may pass over that moment, so the places where the driver turns back are
examined behind a run.
"""

from __future__ import annotations

import numpy as np

from ballpass.runtime.native.stepper import Stepper
from ballpass.runtime.request.assembly import LOCKED, margins_at, may_lock
from ballpass.runtime.request.resolve import Run

#: Parts of a step in which a reversal is sought, and in which it is refined.
PARTS, FINE = 4, 64


def driver_stop(run: Run, stepper: Stepper, kept: np.ndarray) -> tuple[float, np.ndarray] | None:
    """Time [s] and state, shape (states,), at which the linkage locks; None where it does not.

    Parameters
    ----------
    kept : accepted steps of the run so far, see `loop.KeptSteps`
    """
    mechanism = run.model.manifest.mechanism
    if mechanism is None or not may_lock(run.model, run.numbers) or not len(kept):
        return None
    angle, rate = (run.model.states.index(name) for name in (mechanism.angle, mechanism.rate))

    def margins(states: np.ndarray) -> np.ndarray:
        turned = states[:, angle] - run.numbers.values[mechanism.start_angle]
        return np.asarray(margins_at(run.model, run.numbers, turned).min(axis=1))

    ends = np.concatenate([[run.begin], kept[:, 0]])
    times = np.append((ends[:-1, None] + np.diff(ends)[:, None] * np.arange(PARTS) / PARTS).ravel(), ends[-1])
    states = stepper.read(kept, times)
    states = states[: np.argmin([*np.all(np.isfinite(states), axis=1), False])]
    back = np.flatnonzero(states[:-1, rate] * states[1:, rate] <= 0.0)
    near = [stepper.read(kept, np.linspace(times[k], times[k + 1], FINE)) for k in back.tolist()]
    finer = [np.linspace(times[k], times[k + 1], FINE) for k in back.tolist()]
    times, states = np.concatenate([times[: len(states)], *finer]), np.concatenate([states, *near])
    closed = np.flatnonzero(~(margins(states) > LOCKED))
    if not len(closed):
        return None
    first = closed[np.argmin(times[closed])]
    return float(times[first]), states[first]
