"""Magnitudes of the states of a run, from its most loaded moments (see `ballpass.runtime.run.scales`).

In: a model, numbers, the length of a run.  Out: one magnitude for each state, which tolerances are relative to.  Where
the stepper runs, its own C finds them; elsewhere Python does, and with them the rates that show whether a model is
stiff.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ballpass.runtime.contract import Manifest
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.member_schedule import MOMENTS
from ballpass.runtime.native.stepper import Stepper
from ballpass.runtime.run import driver_angle
from ballpass.runtime.run.scales import Groups, Scales, find_scales
from ballpass.runtime.run.segments import segment_edges


def stepper_magnitudes(
    model: LoadedModel,
    stepper: Stepper,
    numbers: Numbers,
    initial: np.ndarray,
    duration: float,
    turn: float,
    begin: float = 0.0,
    edges: np.ndarray | None = None,
) -> np.ndarray:
    """Magnitudes as the stepper finds them, shape (states,).

    Parameters
    ----------
    stepper : one of the model's
    initial : state at the start, shape (states,)
    duration, turn, begin : of the run, of a turn, and time at the start [s]
    edges : of the run's segments, where they are known [s]
    """
    inputs, horizon = _moments(model, numbers, duration, turn, begin, edges)
    return stepper.magnitudes(numbers.p, numbers.c, initial, inputs, horizon)


def model_scales(
    model: LoadedModel, numbers: Numbers, initial: np.ndarray, duration: float, turn: float, begin: float = 0.0
) -> Scales:
    """Magnitudes and stiffness of a run, by Python.

    Parameters
    ----------
    initial : state at the start, shape (states,)
    duration, turn, begin : of the run, of a turn, infinite where nothing turns, and time at the start [s]
    """
    inputs, horizon = _moments(model, numbers, duration, turn, begin)
    fixed = {"t": 0.0, "p": numbers.p, "c": numbers.c}
    rhs, jacobian = model.kernel("rhs"), model.kernel("rhs_jac_x")
    return find_scales(
        lambda u, x: rhs({**fixed, "u": u, "x": x}),
        lambda u, x: jacobian({**fixed, "u": u, "x": x}).reshape(len(x), len(x)),
        list(inputs),
        initial,
        horizon,
        _groups(model.manifest),
        np.diag(mass_matrix(model, {**fixed, "u": inputs[0], "x": initial})).tolist()
        if model.manifest.bearings
        else None,
    )


def _groups(manifest: Manifest) -> Groups:
    names = [info.name for info in manifest.coordinates]
    kinds = np.array([info.group for info in manifest.coordinates])
    return Groups(
        {str(group): np.flatnonzero(kinds == group) for group in dict.fromkeys(kinds)},
        np.array([names.index(info.partner) if info.partner else -1 for info in manifest.coordinates]),
        np.array([info.kind == "angle" for info in manifest.coordinates]),
    )


def mass_matrix(model: LoadedModel, there: Mapping[str, object]) -> np.ndarray:
    """Mass matrix where t, x, u, p and c are those given, shape (coordinates, coordinates)."""
    size = len(model.states) // 2
    return np.asarray(model.kernel("mass_matrix")(there)).reshape(size, size)


def _moments(
    model: LoadedModel,
    numbers: Numbers,
    duration: float,
    turn: float,
    begin: float,
    edges: np.ndarray | None = None,
) -> tuple[np.ndarray, float]:
    """Inputs at the moments, shape (moments, inputs), and the time that bounds travel [s]."""
    horizon = min(duration, turn)
    if edges is None:
        edges = segment_edges(model, numbers, begin, begin + duration, turn)
    middles = 0.5 * (edges[:-1] + edges[1:])
    picked = middles[np.linspace(0, len(middles) - 1, min(MOMENTS, len(middles))).astype(int)]
    moments = np.concatenate([picked, begin + horizon * (np.arange(MOMENTS) + 0.5) / MOMENTS])
    return driver_angle.inputs_over(model.manifest.inputs, numbers.values, moments, moments), horizon
