"""Where a driver that a torque turns comes to the end of the angles for which its linkage is valid.

A driver turns back where its linkage locks, with a smooth motion: the dyad passes into its other position, while the
equations go on with the first one.  Steps may pass over that moment, so the places where the driver turns back are
examined behind a run.
"""

from __future__ import annotations

import numpy as np

from ballpass.runtime.native.stepper import Stepper
from ballpass.runtime.request.assembly import LOCKED, margins_at, may_lock, valid_angles
from ballpass.runtime.request.resolve import Run

#: Parts of a step in which a reversal is sought, those in which the moment is sought, and how often.
PARTS, FINE, REFINED = 4, 64, 4


def driver_stop(run: Run, stepper: Stepper, kept: np.ndarray) -> tuple[float, np.ndarray] | None:
    """Time [s] and state, shape (states,), at which the linkage locks or the driver's range ends; None where neither.

    Parameters
    ----------
    kept : accepted steps of the run so far, see `loop.KeptSteps`
    """
    mechanism = run.model.manifest.mechanism
    limits = valid_angles(run.model, run.numbers)
    if mechanism is None or limits is None or not may_lock(run.model, run.numbers) or not len(kept):
        return None
    angle, rate = (run.model.states.index(name) for name in (mechanism.angle, mechanism.rate))

    def beyond(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """States, and which of them the linkage or the range does not have."""
        states = stepper.read(kept, times)
        turned = states[:, angle] - run.numbers.values[mechanism.start_angle]
        outside = ~((turned >= limits[0].angle) & (turned <= limits[1].angle))
        if mechanism.margins:
            outside |= ~(margins_at(run.model, run.numbers, turned).min(axis=1) > LOCKED)
        return states, outside

    ends = np.concatenate([[run.begin], kept[:, 0]])
    times = np.append((ends[:-1, None] + np.diff(ends)[:, None] * np.arange(PARTS) / PARTS).ravel(), ends[-1])
    states, outside = beyond(times)
    back = np.flatnonzero(states[:-1, rate] * states[1:, rate] <= 0.0)
    times = np.unique(np.concatenate([times, *(np.linspace(times[k], times[k + 1], FINE) for k in back.tolist())]))
    for _ in range(REFINED):
        states, outside = beyond(times)
        if not np.any(outside):
            return None
        first = int(np.argmax(outside))
        times = np.linspace(times[max(first - 1, 0)], times[first], FINE)
    return float(times[-1]), beyond(times[-1:])[0][0]
