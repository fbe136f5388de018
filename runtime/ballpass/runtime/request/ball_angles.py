"""Angles of the balls at a moment of a run."""

from __future__ import annotations

import numpy as np

from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.time import timeline
from ballpass.runtime.time.turning import TURN


def ball_angles(model: LoadedModel, numbers: Numbers, time: float, state: np.ndarray) -> list[np.ndarray]:
    """Angles of the balls of each bearing from +x [rad], each of shape (balls,), Eq. (7).

    Parameters
    ----------
    time : [s]
    state : positions and velocities then, shape (states,)
    """
    return [found[0] for found in ball_angles_along(model, numbers, np.array([time]), state[None, :])]


def ball_angles_along(model: LoadedModel, numbers: Numbers, times: np.ndarray, states: np.ndarray) -> list[np.ndarray]:
    """The same at many times, each of shape (times, balls).

    Parameters
    ----------
    times : [s]
    states : positions and velocities then, shape (times, states)
    """
    if not model.manifest.bearings:
        return []
    given = {
        "t": np.zeros((1, len(times))),  # since the reference times of the inputs' phases, which are `times` themselves
        "x": states.T,
        "u": timeline.inputs_over(model.manifest, numbers.values, times, times).T,
        "p": numbers.p,
        "c": numbers.c,
    }
    signature = model.manifest.function("cages").inputs
    # a column for each time
    found = np.asarray(model.function("cages")(*(given[name] for name, _ in signature)), dtype=float)
    return [
        first[:, None] + TURN * np.arange(bearing.balls) / bearing.balls
        for bearing, first in zip(model.manifest.bearings, found, strict=True)
    ]
