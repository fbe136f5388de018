"""Check whether a linkage can be assembled: at the angles of the driver that a run reaches, and at one instant.

Where a margin sinks below zero the linkage **locks**: beyond, it cannot be assembled.  Where a margin touches zero and
rises again the linkage **branches**: the two positions of the dyad meet, and which of them it goes on with is open.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.time import timeline
from ballpass.runtime.time.turning import TURN, past

if TYPE_CHECKING:
    from ballpass.runtime.contract.manifest import Manifest, MarginInfo, MechanismInfo
    from ballpass.runtime.contract.parameters import Numbers

#: Margins up to this are no position of the linkage: the transmission angle is below 3e-5 rad, and forces grow like its
#: inverse [1].
DEAD_CENTER = 1e-9

#: Angles checked in a turn; minima below `NEAR`, and the least one, are refined by sweeps, each so many times finer
#: than the one before.
ANGLES, NEAR, SWEEPS, FINE = 720, 1e-2, 3, 128

#: A run of a driver that a torque turns has come to where its linkage locks, where a margin is below this [1].
LOCKED = 1e-6

CRANK_ANGLE = "crank angle"

#: Halvings of the interval in which a margin falls to `DEAD_CENTER`.
HALVINGS = 45


@dataclass(frozen=True, slots=True, kw_only=True)
class Position:
    """A position of the driver beyond which the linkage is not valid.

    Attributes
    ----------
    angle : up to which it is valid, past the start angle, negative where it lies before that [rad]
    place : of the dyad's position where its margin is least [rad]
    margin : the least one there [1]
    info : of the dyad; None where the scene's range of the driver ends
    branches : whether the dyad can be assembled on both sides; else it locks
    turns : of the driver after which all bodies are alike
    """

    angle: float
    place: float
    margin: float
    info: MarginInfo | None
    branches: bool
    turns: int = 1

    def words(self, start: float, what: str) -> str:
        """A sentence; `start` is the driver's angle at t = 0 [rad], `what` what that is called."""
        if self.info is None:
            return f"The driver's range ends at {what} {math.degrees(start + self.place):.2f} deg."
        does = "branches" if self.branches else "cannot be assembled"
        place = math.degrees(past(start + self.place, turns=self.turns))
        return (
            f"The linkage {does} at joint {self.info.joint!r} at {what} {place:.2f} deg "
            f"({self.info.description}: margin {self.margin:.4g})."
        )


def valid_angles(model: LoadedModel, numbers: Numbers) -> tuple[Position, Position] | None:
    """Where the range of the driver ends in which the linkage is valid, before and after its start; None: nowhere.

    Raises
    ------
    RequestError
        It cannot be assembled at the start.
    """
    mechanism = model.manifest.mechanism
    if mechanism is None or not (mechanism.margins or mechanism.range):
        return None
    key = numbers.p.tobytes()
    known: tuple[bytes, tuple[Position, Position] | None] | None = model.valid_angles
    if known is None or known[0] != key:
        ends = _valid_angles(model, numbers, mechanism) if mechanism.margins else None
        known = model.valid_angles = key, _within_range(numbers, mechanism, ends) if mechanism.range else ends
    return known[1]


def _within_range(
    numbers: Numbers, mechanism: MechanismInfo, ends: tuple[Position, Position] | None
) -> tuple[Position, Position]:
    """Ends of the scene's range of the driver, where the linkage is valid up to there."""
    first, last = (numbers.values[name] - numbers.values[mechanism.start_angle] for name in mechanism.range)
    if not first <= 0.0 <= last:
        raise RequestError(f"{mechanism.start_angle}: the driver starts outside of its range, mechanism.driver.range.")
    one, other = (
        Position(angle=angle, place=angle, margin=math.nan, info=None, branches=False) for angle in (first, last)
    )
    if ends is None:
        return one, other
    return max(one, ends[0], key=lambda end: end.angle), min(other, ends[1], key=lambda end: end.angle)


def _valid_angles(model: LoadedModel, numbers: Numbers, mechanism: MechanismInfo) -> tuple[Position, Position] | None:
    infos = mechanism.margins

    def margins(angles: np.ndarray) -> np.ndarray:
        return margins_at(model, numbers, angles)

    turns = mechanism.repeats
    angles = TURN * np.arange(ANGLES * turns) / ANGLES
    rows = margins(angles)
    least = rows.min(axis=0)
    minima = (rows < np.roll(rows, 1, axis=0)) & (rows <= np.roll(rows, -1, axis=0))  # none where a margin is constant
    minima &= (rows > DEAD_CENTER) & ((rows < NEAR) | (rows == least))
    finer = [_lowest(margins, int(row), float(angles[k])) for k, row in np.argwhere(minima)]
    # a minimum between the last angle and the first lies before the start
    places = np.unique(np.concatenate([angles, past(np.array(finer, dtype=float), turns=turns)]))
    rows = margins(places)
    bad = np.flatnonzero(rows.min(axis=1) <= DEAD_CENTER)
    if not len(bad):
        return None
    start = math.degrees(timeline.start_angle(model.manifest, numbers.values))
    if bad[0] == 0:
        row = int(np.argmax(rows[0] <= DEAD_CENTER))
        raise RequestError(
            f"The linkage cannot be assembled at joint {infos[row].joint!r} at crank angle {start:.2f} deg, where it "
            f"starts ({infos[row].description}: margin {rows[0, row]:.4g}). Change the lengths of the bodies that meet "
            f"at the joint, or {mechanism.start_angle}."
        )
    places, rows = np.append(places, TURN * turns), np.concatenate([rows, rows[:1]])
    found = []
    for k, sense in ((int(bad[-1]), -1), (int(bad[0]), 1)):  # from the start against the driver, and with it
        row = int(np.argmax(rows[k] <= DEAD_CENTER))
        last = k
        while rows[last, row] <= DEAD_CENTER:
            last += sense
        closed = slice(min(k, last), max(k, last) + 1)
        lowest = closed.start + int(np.argmin(rows[closed, row]))
        inside, outside = float(places[k - sense]), float(places[k])
        for _ in range(HALVINGS):
            middle = 0.5 * (inside + outside)
            valid = bool(margins(np.array([middle]))[0].min() > DEAD_CENTER)
            inside, outside = (middle, outside) if valid else (inside, middle)
        found.append(
            Position(
                angle=inside if sense > 0 else inside - TURN * turns,
                place=float(places[lowest]) - (0.0 if sense > 0 else TURN * turns),
                margin=float(rows[lowest, row]),
                info=infos[row],
                branches=bool(rows[lowest, row] > -DEAD_CENTER),
                turns=turns,
            )
        )
    return found[0], found[1]


def _angle_words(manifest: Manifest) -> str:
    """What turns evenly: the driver, or the phase of its swing."""
    return "phase of the swing" if manifest.mechanism is not None and manifest.mechanism.swing else CRANK_ANGLE


def may_lock(model: LoadedModel, numbers: Numbers) -> bool:
    """Whether a torque may turn the driver to where the linkage locks."""
    return timeline.is_free(model.manifest) and valid_angles(model, numbers) is not None


def _lowest(margins: Callable[[np.ndarray], np.ndarray], row: int, angle: float) -> float:
    """The angle at which a margin is least, near a minimum of the sweep [rad]."""
    reach = TURN / ANGLES
    for _ in range(SWEEPS):
        angles = angle + reach * np.linspace(-1.0, 1.0, 2 * FINE + 1)
        angle, reach = float(angles[np.argmin(margins(angles)[:, row])]), reach / FINE
    return angle


def check_assembly(model: LoadedModel, numbers: Numbers, end: float = math.inf) -> None:
    """Check that the linkage is valid at every angle that the driver reaches up to a time.

    A driver that a torque turns may reach any angle where nothing holds it: it stops where the linkage locks, and is
    refused where it branches.

    Parameters
    ----------
    end : of the time from t = 0 on; infinite for a whole turn [s]

    Raises
    ------
    RequestError
        It is not: names the joint, its crank angle, and the angles for which the linkage is valid.  A body with a
        bearing turns too fast for its angle to be followed.
    """
    manifest = model.manifest
    ends = valid_angles(model, numbers)
    start, what = timeline.start_angle(manifest, numbers.values), _angle_words(manifest)
    if ends is not None:
        low, high = _reached(model, numbers, end)
        stops = timeline.is_free(manifest) and math.isfinite(end)
        beyond = zip(ends, (low < ends[0].angle, high > ends[1].angle), strict=True)
        if refused := [one for one, reached in beyond if reached and (one.branches or not stops)]:
            first, last = (math.degrees(start + one.angle) for one in ends)
            turns = " The driver cannot make a whole turn." if high - low >= TURN and what == CRANK_ANGLE else ""
            raise RequestError(
                "\n".join(dict.fromkeys(one.words(start, what) for one in refused))
                + f"\nIt is valid from {what} {first:.4f} to {last:.4f} deg.{turns} Change the lengths of the bodies "
                "that meet at the joint, or ask for a time in which the driver stays between these angles."
            )
    for constant in () if np.isfinite(numbers.c).all() else manifest.constants:
        if constant.name.endswith(".turns") and not math.isfinite(numbers.values[constant.name]):
            body = constant.name.removeprefix("body.").removesuffix(".turns")
            raise RequestError(
                f"The angle of {body} changes by more than three eighths of a turn while the driver turns by 7.5 "
                "degrees: which way round is unknown. Change lengths so that no joint passes another so near."
            )


def _reached(model: LoadedModel, numbers: Numbers, end: float) -> tuple[float, float]:
    """Least and largest angle of the driver up to a time, past its start [rad]; where a torque drives, any."""
    if timeline.is_free(model.manifest) or math.isinf(end):
        whole = TURN * _repeats(model)
        return -whole, whole
    turning = timeline.driver(model.manifest, numbers.values)
    low, high = turning.swept(0.0, end)
    first = float(turning.at(0.0)[0])
    return low - first, high - first


def angles_reached(model: LoadedModel, numbers: Numbers, end: float) -> tuple[float, float]:
    """The same, within the turns after which all bodies are alike [rad].

    Where a torque drives, the angles for which the linkage is valid.
    """
    low, high = _reached(model, numbers, end)
    ends = valid_angles(model, numbers) if timeline.is_free(model.manifest) else None
    if ends is not None:
        return ends[0].angle, ends[1].angle
    whole = TURN * _repeats(model)
    return (low, high) if high - low < whole else (0.0, whole)


def _repeats(model: LoadedModel) -> int:
    """Turns of the driver after which all bodies are alike."""
    return 1 if model.manifest.mechanism is None else model.manifest.mechanism.repeats


def check_assembled(model: LoadedModel, numbers: Numbers, t: float, there: Mapping[str, Any]) -> None:
    """Check every margin of the linkage at one instant alone, not over the turn.

    Parameters
    ----------
    t : the instant [s]
    there : arguments of generated functions at it, by name: t, u, p, c

    Raises
    ------
    RequestError
        A dyad cannot be assembled there; names its joint and the crank angle.
    """
    mechanism = model.manifest.mechanism
    if mechanism is None or not mechanism.margins:
        return
    margins = model.kernel("assembly")(there).tolist()
    row = next((row for row, margin in enumerate(margins) if not margin > 0.0), None)  # NaN: it cannot be assembled
    if row is not None:
        angle = math.degrees(timeline.crank_angle(model.manifest, numbers.values, t))
        info = mechanism.margins[row]
        raise RequestError(
            f"The linkage cannot be assembled at joint {info.joint!r} at {t:.6g} s, crank angle {angle:.2f} deg "
            f"({info.description}: margin {margins[row]:.4g}).\nChange the lengths of the bodies that meet at the "
            "joint, or ask at an angle at which they reach each other."
        )


def margins_at(model: LoadedModel, numbers: Numbers, angles: np.ndarray) -> np.ndarray:
    """Margins at angles past the start [rad], shape (angles, margins); NaN: it cannot be assembled."""
    at = timeline.turned(model.manifest, numbers.values, angles)
    arguments = {"t": 0.0, "p": numbers.p, "c": numbers.c}
    (found,) = model.loop("assembly", tuple(at))(len(angles), {**at, **arguments}).values()
    return np.where(np.isnan(found), -np.inf, found)
