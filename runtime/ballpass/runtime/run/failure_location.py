"""State of a machine when a run ended early: crank angle, most loaded ball, torque a stalled driver lacks."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ballpass.runtime.ratings.elements import element_words
from ballpass.runtime.ratings.of_bearing import contact_cosine, radial_gap
from ballpass.runtime.report.numbers import rounded
from ballpass.runtime.request.assembly import LOCKED
from ballpass.runtime.request.ball_angles import ball_angles
from ballpass.runtime.request.magnitudes import mass_matrix
from ballpass.runtime.time import timeline
from ballpass.runtime.time.turning import beside, past

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ballpass.runtime.contract.manifest import BearingInfo, Manifest
    from ballpass.runtime.contract.parameters import Numbers
    from ballpass.runtime.native.loaded_model import LoadedModel


@dataclass(frozen=True, slots=True, kw_only=True)
class FailureLocation:
    """An instant of a run.

    Attributes
    ----------
    crank_angle : angle of driver or shaft, in [0, 2 pi) [rad]
    bearing : the bearing of that ball, empty for the scene's only one
    ball : the ball with the largest deflection, counted from 1; None without a bearing or a finite state
    ball_angle : its angle, in [0, 2 pi) [rad]
    deflection : its deflection, Eq. (6); negative where no ball touches [m]
    element : kind of the rolling elements
    locked : a sentence on the dyad that locks there; empty where none does
    """

    crank_angle: float
    bearing: str
    ball: int | None
    ball_angle: float
    deflection: float
    element: str = "ball"
    locked: str = ""

    @property
    def words(self) -> str:
        """A sentence on the dyad that locks, or else on the ball; empty without either."""
        if self.ball is None or self.locked:
            return self.locked
        if self.deflection <= 0.0:
            return element_words("No ball is in contact there.", [self.element])
        angle = math.degrees(self.ball_angle)
        ball = element_words(f"ball {self.ball}", [self.element]) + (f" of {self.bearing}" if self.bearing else "")
        return f"Most deflected there: {ball} at {angle:.2f} deg, by {rounded(1e6 * self.deflection)} µm."


def locate_failure(model: LoadedModel, numbers: Numbers, time: float, state: np.ndarray) -> FailureLocation:
    """The instant of a state.

    Parameters
    ----------
    time : time of the state [s]
    state : positions and velocities, shape (states,)
    """
    manifest, values = model.manifest, numbers.values
    crank = timeline.crank_angle(manifest, values, time, state)
    found = FailureLocation(crank_angle=crank, bearing="", ball=None, ball_angle=math.nan, deflection=-math.inf)
    if not np.all(np.isfinite(state)):
        return found
    found = replace(found, locked=locked_words(model, numbers, time, state))
    at_balls = ball_angles(model, numbers, time, state)
    for bearing, turned, deflections in zip(
        manifest.bearings, at_balls, ball_deflections(model, numbers, time, state), strict=True
    ):
        angles = past(turned)
        ball = int(np.argmax(deflections))
        if deflections[ball] > found.deflection:
            found = replace(
                found,
                bearing=bearing.name,
                ball=ball + 1,
                ball_angle=float(angles[ball]),
                deflection=float(deflections[ball]),
                element=bearing.element,
            )
    return found


def locked_words(model: LoadedModel, numbers: Numbers, time: float, state: np.ndarray) -> str:
    """A sentence on the dyad that locks at a state, of shape (states,), or the range that ends; empty where neither."""
    mechanism = model.manifest.mechanism
    if mechanism is not None and mechanism.range and mechanism.angle:
        turned = float(state[model.states.index(mechanism.angle)])
        first, last = (numbers.values[name] for name in mechanism.range)
        if not first <= turned <= last:
            return f"The driver's range is from {math.degrees(first):.4f} to {math.degrees(last):.4f} deg."
    if mechanism is None or not mechanism.margins:
        return ""
    u = timeline.inputs_at(model.manifest, numbers.values, time)
    played = any(bearing.two_way for bearing in model.manifest.bearings)
    margins = model.kernel("assembly_with_play" if played else "assembly")(
        {"t": 0.0, "x": state, "u": u, "p": numbers.p, "c": numbers.c}
    )
    k = int(np.argmin(margins))
    if margins[k] > 10.0 * LOCKED:
        return ""
    info = mechanism.margins[k]
    return f"Joint {info.joint!r} locks ({info.description}: margin {margins[k]:.2g})."


def ball_deflections(model: LoadedModel, numbers: Numbers, time: float, state: np.ndarray) -> list[np.ndarray]:
    """Deflections of the balls of each bearing, Eq. (6), without what shapes of balls and raceways add [m]."""
    manifest, values = model.manifest, numbers.values
    at = {coordinate.name: k for k, coordinate in enumerate(manifest.coordinates)}
    found = []
    for bearing, angles in zip(manifest.bearings, ball_angles(model, numbers, time, state), strict=True):
        x, y = (_apart(bearing, axis, at, values, state) for axis in "xy")
        apart = x * np.cos(angles) + y * np.sin(angles) - radial_gap(bearing, values)
        found.append(contact_cosine(bearing, values) * apart)
    return found


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
        (abs(beside(state[driver], values[path])), row, path)
        for row, item in enumerate(manifest.inputs)
        if item.kind == "border"
        for window in item.windows
        for path in window
        if path in numbers.parameters  # the driver's; a spall's edges are derived
    ]
    _, row, path = min(edges)
    u = timeline.inputs_at(manifest, values, 0.0)
    u[row] = -math.inf  # open, on either side of the edge
    there = {"t": 0.0, "x": np.concatenate([state[:half], np.zeros(half)]), "u": u, "p": numbers.p, "c": numbers.c}
    acceleration = float(model.kernel("rhs")(there)[half + driver])
    inertia = 1.0 / float(np.linalg.inv(mass_matrix(model, there))[driver, driver])
    load = manifest.inputs[row].name.split(".")[1]
    return (
        f"The driver stands at {path} = {math.degrees(values[path]):.6g} deg; within that window of {load} it lacks "
        f"{abs(inertia * acceleration):.4g} N*m at rest."
    )


def ring_distances(manifest: Manifest, values: Mapping[str, float], x: np.ndarray) -> np.ndarray:
    """Distances of the rings of each bearing [m], at states of shape (states, .): shape (bearings, .).

    `values` are parameters and derived constants.
    """
    at = {coordinate.name: k for k, coordinate in enumerate(manifest.coordinates)}
    found = [np.hypot(*(_apart(bearing, axis, at, values, x) for axis in "xy")) for bearing in manifest.bearings]
    return np.array(found).reshape(len(found), *x.shape[1:])


def _apart(
    bearing: BearingInfo, axis: str, at: Mapping[str, int], values: Mapping[str, float], x: np.ndarray
) -> np.ndarray:
    """Position of the inner ring relative to the outer one along an axis [m], at states of shape (states, .)."""
    outer = at.get(f"{bearing.prefix}outer.{axis}")
    inner = sum(weight * x[at[name]] for name, weight in bearing.inner_states(axis, values).items())
    inner = inner - values.get(f"{bearing.path}.offset.{axis}", 0.0)
    return np.asarray(inner if outer is None else inner - x[outer])
