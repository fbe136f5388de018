"""The message for a driver that has stalled: its angle and the missing torque."""

from __future__ import annotations

import math

import numpy as np

from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.run import driver_angle
from ballpass.runtime.run.magnitudes import mass_matrix


def stall_words(model: LoadedModel, numbers: Numbers, state: np.ndarray) -> str:
    """The window at whose edge the driver stands, and the torque that would hold it within that window, at rest.

    Parameters
    ----------
    state : where the run ended, shape (states,)
    """
    manifest, values = model.manifest, numbers.values
    assert manifest.mechanism is not None  # it has the driver
    names, half = [info.name for info in manifest.states], len(manifest.states) // 2
    driver = names.index(manifest.mechanism.angle)
    edges = [
        (abs(math.remainder(state[driver] - values[path], driver_angle.TURN)), row, path)
        for row, item in enumerate(manifest.inputs)
        if item.kind == "border"
        for window in item.windows
        for path in window
        if path in numbers.parameters  # the driver's; a spall's edges are derived
    ]
    _, row, path = min(edges)
    u = driver_angle.inputs_at(manifest.inputs, values, 0.0)
    u[row] = -math.inf  # open, on either side of the edge
    there = {"t": 0.0, "x": np.concatenate([state[:half], np.zeros(half)]), "u": u, "p": numbers.p, "c": numbers.c}
    acceleration = float(model.kernel("rhs")(there)[half + driver])
    inertia = 1.0 / float(np.linalg.inv(mass_matrix(model, there))[driver, driver])
    load = manifest.inputs[row].name.split(".")[1]
    return (
        f"The driver stands at {path} = {math.degrees(values[path]):.6g} deg; within that window of {load} it lacks "
        f"{abs(inertia * acceleration):.4g} N*m at rest."
    )
