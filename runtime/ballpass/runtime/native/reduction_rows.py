"""Rows of on-line reductions as the driver writes them (`driver/reductions.h`).

A row is a head and, for every channel, one number of each kind in `ROWS`.  Channels are the states, then four
quantities of the balls of each bearing, each with its value of the most loaded ball at the moment, then the powers of
each bearing's ball loads that fatigue needs, and one.  Of these the integrals alone mean something: over the angle that
the inner ring turns against the outer one, for fatigue counts passes.  Behind all stand the places of the raceways.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ballpass.runtime.contract import Manifest
from ballpass.runtime.contract.manifest import BearingInfo
from ballpass.runtime.ratings.of_bearing import rated_element

Array: TypeAlias = NDArray[np.float64]

#: Head of a row, and what follows for every channel; integrals are of the channel less its shift, and of the square
#: of that.
HEAD = ("from", "duration")
ROWS = ("wanted", "max", "max_time", "max_ball", "min", "min_time", "min_ball", "shift", "integral", "square")

#: Channels of a bearing behind those of the states, without its prefix: values of the most loaded ball.
BALL_CHANNELS = ("ball.force", "ball.elastic_force", "ball.damping_force", "ball.deflection")

#: Behind these for each bearing: means over its balls of powers of their loads, see `LoadPowers` of the readings, and
#: one, whose integral is the angle that the inner ring turned against the outer one [rad].
LOAD_POWERS = ("load.turning", "load.standing", "load.outer_damage", "load.turned")

#: The channel that shows whether a bearing can be so, and the largest share of a ball's diameter that it may be [1].
DEFLECTION, FLATTENED = "ball.deflection", 0.1

#: Places of a raceway.
SECTORS = 72


@dataclass(frozen=True)  # without slots: what is asked for some hundred times a run is kept
class ReductionRows:
    """Layout of the rows of a model.

    Attributes
    ----------
    states, balls, powers : names of the channels: states, quantities of the balls, powers of their loads
    """

    states: tuple[str, ...]
    balls: tuple[str, ...]
    powers: tuple[str, ...]

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """All channels in the driver's order."""
        return (*self.states, *self.balls, *self.powers)

    @cached_property
    def _columns(self) -> dict[tuple[str, str], int]:
        named = ((kind, channel) for kind in ROWS for channel in self.channels)
        return {entry: len(HEAD) + place for place, entry in enumerate(named)}

    @property
    def size(self) -> int:
        """Numbers of a row."""
        return self._sectors + 2 * SECTORS * (len(self.powers) // len(LOAD_POWERS))

    @property
    def _sectors(self) -> int:
        return len(HEAD) + len(ROWS) * len(self.channels)

    def raceways(self, rows: np.ndarray, prefix: str) -> np.ndarray:
        """Integrals of the first power of the ball loads at the places of both raceways of a bearing, over its angle.

        Places are hat functions at equal distances, in the ring's own coordinates, from where its x axis was at the
        start.

        Returns
        -------
        numpy.ndarray
            Outer, then inner raceway, loads in kN, shape (members, 2, SECTORS).
        """
        first = self._sectors + 2 * SECTORS * (self.powers.index(prefix + LOAD_POWERS[0]) // len(LOAD_POWERS))
        return rows[:, first : first + 2 * SECTORS].reshape(len(rows), 2, SECTORS)

    def column(self, kind: str, channel: str) -> int:
        """Place of an entry of `ROWS` in a row."""
        return self._columns[kind, channel]

    def empty(self, count: int, start: ArrayLike, channels: Collection[str]) -> np.ndarray:
        """Rows of reductions of these channels that count from `start` on [s], shape (count, size).

        Where there are any, the deflection of the balls is among them: it shows whether a bearing can be so.
        """
        rows = np.zeros((count, self.size))
        rows[:, HEAD.index("from")] = start
        for name in self.channels:
            rows[:, self.column("wanted", name)] = name in channels or (bool(channels) and name.endswith(DEFLECTION))
        return rows


def is_void(manifest: Manifest, values: Mapping[str, ArrayLike], rows: Array) -> NDArray[np.bool_]:
    """Whether runs mean nothing, by their reductions, shape (runs,).

    A ball is flattened by more than a tenth, or the rings are displaced by more than a ball.
    """
    void = np.zeros(len(rows), dtype=bool)
    for bearing, deflection in _deflections(manifest, rows):
        ball, clearance = (np.asarray(values[f"{bearing.path}.{key}"]) for key in ("ball_diameter", "clearance"))
        void |= (deflection > FLATTENED * ball) | (deflection + clearance / 2.0 > ball)
    return void


def void_words(manifest: Manifest, values: Mapping[str, float], row: Array) -> str:
    """Why a run means nothing; empty where it is not void."""
    for bearing, (deflection,) in _deflections(manifest, row[None, :]):
        words = why_void(bearing, values, deflection, deflection + values[f"{bearing.path}.clearance"] / 2.0)
        if words:
            return words
    return ""


def why_void(bearing: BearingInfo, values: Mapping[str, float], deflection: float, displaced: float) -> str:
    """Why no bearing can be so; empty where one can.

    Parameters
    ----------
    deflection, displaced : largest of a ball, and largest displacement of the rings [m]
    """
    ball, noun = values[f"{bearing.path}.ball_diameter"], rated_element(bearing).noun
    if deflection <= FLATTENED * ball and displaced <= ball:
        return ""
    what = (
        f"a {noun} is flattened by {1e3 * deflection:.4g} mm, {100.0 * deflection / ball:.3g} % of its diameter"
        if deflection > FLATTENED * ball
        else f"the rings are displaced by {1e3 * displaced:.4g} mm, more than a {noun}'s diameter"
    )
    return (
        f"{bearing.path}: {what}: these results mean nothing, for no bearing can be so. Reduce load, speed or "
        "clearance, give more damping, or check stiffness, masses and their units."
    )


def _deflections(manifest: Manifest, rows: Array) -> Iterator[tuple[BearingInfo, Array]]:
    """Of each bearing: largest deflection of a ball in each run [m]."""
    layout = reduction_rows(manifest)
    for bearing in manifest.bearings:
        yield bearing, rows[:, layout.column("max", bearing.prefix + DEFLECTION)]


def moments_of(shift: Array, integral: Array, square: Array, duration: Array) -> tuple[Array, Array]:
    """Mean and standard deviation over a time, from integrals about a shift; infinite where squares overflow."""
    apart = integral / duration
    with np.errstate(over="ignore", invalid="ignore"):
        variance = square / duration - apart**2
    return shift + apart, np.sqrt(np.where(variance >= 0.0, variance, np.where(np.isnan(variance), np.inf, 0.0)))


def rms_of(mean: Array, std: Array) -> Array:
    """Root mean square with the mean in it."""
    return np.asarray(np.hypot(mean, std))


def reduction_rows(manifest: Manifest) -> ReductionRows:
    """Layout of the rows of a model."""
    return _rows(tuple(state.name for state in manifest.states), tuple(one.prefix for one in manifest.bearings))


@lru_cache(maxsize=64)
def _rows(states: tuple[str, ...], prefixes: tuple[str, ...]) -> ReductionRows:
    return ReductionRows(
        states=states,
        balls=tuple(prefix + name for prefix in prefixes for name in BALL_CHANNELS),
        powers=tuple(prefix + name for prefix in prefixes for name in LOAD_POWERS),
    )
