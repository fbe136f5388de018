"""Angles of the balls at a moment of a run."""

from __future__ import annotations

import numpy as np

from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.run import driver_angle


def ball_angles(model: LoadedModel, numbers: Numbers, time: float, state: np.ndarray) -> list[np.ndarray]:
    """Angles of the balls of each bearing from +x [rad], each of shape (balls,), Eq. (7).

    Parameters
    ----------
    time : [s]
    state : positions and velocities then, shape (states,)
    """
    if not model.manifest.bearings:
        return []
    given = {
        "t": 0.0,  # since the reference time of the inputs' phases, which is `time` itself
        "x": state,
        "u": driver_angle.inputs_at(model.manifest.inputs, numbers.values, time),
        "p": numbers.p,
        "c": numbers.c,
    }
    signature = model.manifest.function("cages").inputs
    first = np.asarray(model.function("cages")(*(given[name] for name, _ in signature)), dtype=float).ravel()
    return [
        angle + driver_angle.TURN * np.arange(bearing.balls) / bearing.balls
        for bearing, angle in zip(model.manifest.bearings, first.tolist(), strict=True)
    ]
