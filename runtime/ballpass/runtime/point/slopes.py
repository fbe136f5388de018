"""Derivatives at one time and state, also where balls rest on the corner of a one-sided law.

In: a model, numbers, a point.  Out: dense arrays.

A one-sided law damps a ball's approach and not its release: its force has a corner where the deflection's rate is zero.
The generated code takes the side of release for every ball there.  A sum over balls may have a derivative all the same:
with an even number of balls one of two opposite balls approaches in either direction of motion, and both together are a
linear dashpot.  So the sum is differentiated, not one ball after the other: where a direction moves the rate of a ball
at rest, the derivative along it is taken at a small distance on either side, where each ball is on one side of its law.
The law is piecewise linear in the rate, so that both are the one-sided slopes.  Where they agree there is a derivative;
where they do not, their mean is given, which is the damping of a harmonic motion about the point, and both are
reported.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.contract.errors import BallpassWarning
from ballpass.runtime.contract.manifest import BearingInfo
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.point.evaluate import checked_time, point
from ballpass.runtime.point.jacobian import RHS, STATES, JacobianDirections, Rows, contract, directions_of, rows_of
from ballpass.runtime.ratings.of_bearing import bearing_words

Array = NDArray[np.float64]

#: Arguments of generated functions at a point, by name.
Point = Mapping[str, float | Array]

#: A ball whose deflection or rate is below this fraction of the rings' motion stands on the kink.
ON_THE_KINK = 1e-9

#: Slopes on both sides that differ by less are one: of the larger of both, and of the largest beside them [1].
ALIKE, ALIKE_BESIDE = 1e-6, 1e-9

#: Part of an argument by which it is moved to see the rates of deflection change [1].
STEP = 1e-6


class KinkWarning(BallpassWarning):
    """There is no derivative, as where a law has a corner or two peaks are equal; the warning names the value given."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Slopes:
    """Derivatives of rows along directions, from both sides.

    Attributes
    ----------
    value : the derivative, or the mean of both sides where there is none, shape (rows, directions)
    below, above : along the direction towards the point, and away from it, same shape
    resting : for each bearing whose law has a corner at rest, the balls on it, counted from 0
    """

    value: Array
    below: Array
    above: Array
    resting: tuple[tuple[BearingInfo, tuple[int, ...]], ...]

    @property
    def differ(self) -> NDArray[np.bool_]:
        """Where the sides differ: there is no derivative there."""
        size = np.maximum(np.abs(self.below), np.abs(self.above))
        beside = np.max(size, axis=0, initial=0.0)
        found: NDArray[np.bool_] = np.abs(self.above - self.below) > ALIKE * size + ALIKE_BESIDE * beside
        return found

    def notes(self) -> tuple[str, ...]:
        """Why the sides differ, in words; empty where they agree."""
        if not np.any(self.differ):
            return ()
        return tuple(
            f"the law {bearing.damping.law} has a kink where the deflection's rate is zero, as at "
            f"{named(bearing, balls)}, and not every derivative exists: the mean of both sides is given. Give "
            f"{bearing.path}.damping.smoothing, and there is one derivative."
            for bearing, balls in self.resting
            if balls
        )


def jacobian(
    model: LoadedModel,
    numbers: Numbers,
    of: str | Sequence[str],
    wrt: str | Sequence[str],
    *,
    t: float,
    x: Sequence[float] | np.ndarray | None,
) -> Array:
    """Derivatives at one time and state; see `ballpass.runtime.Model.jacobian`."""
    time = checked_time(t)
    rows = rows_of(model, of)
    directions = directions_of(model, numbers, wrt, time)
    found = slopes(model, rows, directions, point(model, numbers, time, x))
    for note in found.notes():
        warnings.warn(f"jacobian: {note}", KinkWarning, stacklevel=3)
    dense = found.value
    if isinstance(of, str) and of != RHS and sum(len(part.labels) for part in rows) == 1:
        dense = dense[0]
    if isinstance(wrt, str) and wrt != STATES:
        dense = dense[..., 0]
    return np.asarray(dense, dtype=float)


def slopes(model: LoadedModel, parts: Sequence[Rows], directions: JacobianDirections, there: Point) -> Slopes:
    """Derivatives of rows along directions at a point, from both sides."""

    def along(one: JacobianDirections, at: Point) -> Array:
        return np.concatenate([contract(model, part, one, at) for part in parts])

    value = along(directions, there)
    below, above = value.copy(), value.copy()
    resting = []
    for bearing in model.manifest.bearings:
        if not bearing.damping.corner_at_rest:
            continue
        deflections = Deflections(model, bearing, there)
        balls = deflections.at_rest()
        resting.append((bearing, tuple(balls)))
        for column in range(len(directions.labels)) if balls else ():
            one = _column(directions, column)
            reach = deflections.reach(one, balls)
            if reach == 0.0:
                continue
            # each bearing adds its own corners
            above[:, column] += along(one, _moved(there, one, reach))[:, 0] - value[:, column]
            below[:, column] += along(one, _moved(there, one, -reach))[:, 0] - value[:, column]
    return Slopes(value=0.5 * (below + above), below=below, above=above, resting=tuple(resting))


class Deflections:
    """Deflections of a bearing's balls at a point, and their rates.

    Attributes
    ----------
    value : deflection of each ball [m]
    rate : its rate [m/s]
    by_positions : derivative of each by the coordinates, shape (balls, coordinates) [1]
    speed : largest speed in it [m/s]
    """

    def __init__(self, model: LoadedModel, bearing: BearingInfo, there: Point) -> None:
        self._model, self._there = model, there
        (self._rows,) = rows_of(model, f"{bearing.prefix}ball.deflection")
        self._jumps = bearing.damping.in_deflection == "discontinuous"
        self.value = model.kernel(self._rows.function)(there)[self._rows.indices]
        self.rate, self.by_positions, by_time = self._rates(there)
        half = len(model.states) // 2
        self.speed = max(float(np.max(np.abs(np.asarray(there["x"])[half:]))), float(np.max(np.abs(by_time))), 1e-12)

    def at_onset(self) -> list[int]:
        """Balls at the onset of contact, counted from 0."""
        length = max(float(np.max(np.abs(self.value))), 1e-12)
        return np.flatnonzero(np.abs(self.value) <= ON_THE_KINK * length).tolist()

    def at_rest(self) -> list[int]:
        """Balls at rest, counted from 0; of a law that acts in contact only, those in contact."""
        resting = np.abs(self.rate) <= ON_THE_KINK * self.speed
        return np.flatnonzero(resting & (self.value > 0.0) if self._jumps else resting).tolist()

    def reach(self, direction: JacobianDirections, balls: Sequence[int]) -> float:
        """Step along a direction that moves these balls away from rest; 0 where it does not move them."""
        sizes = [
            float(np.max(np.abs(np.asarray(self._there[name])[moved]) / np.abs(along[moved])))
            for name, along in _arguments(direction)
            if np.any(moved := along != 0.0) and name != "t"
        ]
        step = STEP * (max(sizes, default=0.0) or 1.0)
        further, back = (self._rates(_moved(self._there, direction, s * step))[0] for s in (1.0, -1.0))
        change = np.abs(further - back)[list(balls)] / (2.0 * step)
        fastest = float(np.max(change))
        # rounding of the difference is no motion
        least = 1e-6 * ON_THE_KINK * self.speed / step
        return 2.0 * ON_THE_KINK * self.speed / fastest if fastest > least else 0.0

    def _rates(self, there: Point) -> tuple[Array, Array, Array]:
        """Rate of each deflection, its derivative by the coordinates, and the part that is due to time alone."""
        rows, x = self._rows, np.asarray(there["x"])
        half = len(x) // 2
        by_states = self._model.kernel(f"{rows.function}_jac_x")(there).reshape(-1, len(x))[rows.indices]
        name = f"{rows.function}_jac_t"  # none where nothing depends on time but through the state
        by_time = np.zeros(len(rows.indices))
        if self._model.has(name):
            by_time = self._model.kernel(name)(there)[rows.indices]
        return np.asarray(by_states[:, :half] @ x[half:] + by_time), by_states[:, :half], by_time


def named(bearing: BearingInfo, balls: Sequence[int]) -> str:
    """Names of balls, counted from 1."""
    return bearing_words("ball ", [bearing]) + ", ".join(str(k + 1) for k in balls)


def _arguments(direction: JacobianDirections) -> list[tuple[str, Array]]:
    """How each argument moves along the only direction."""
    return [(name, direction.of(name)[:, 0]) for name in ("t", "x", "u", "p", "c")]


def _column(directions: JacobianDirections, k: int) -> JacobianDirections:
    """One of the directions."""
    blocks = {name: directions.of(name)[:, k : k + 1] for name in ("t", "x", "u", "p", "c")}
    return JacobianDirections(labels=directions.labels[k : k + 1], units=directions.units[k : k + 1], **blocks)


def _moved(there: Point, direction: JacobianDirections, reach: float) -> dict[str, float | Array]:
    """The point moved along the only direction."""
    moved = {name: np.asarray(there[name]) + reach * along for name, along in _arguments(direction)}
    return {**moved, "t": float(moved["t"][0])}
