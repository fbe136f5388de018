"""Content of a moving picture of a run: linkage, bearings and signals at samples of its last turns.

In: records of the bearings of one run.  Out: `Frames`, and the same as plain numbers for the page of `html_page`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.plot import shapes
from ballpass.runtime.plot.record import FRAME, Array, Record

if TYPE_CHECKING:
    from ballpass.runtime.contract.manifest import MechanismInfo

#: Samples of a page, at most: a turn in steps of a third of a degree.
FRAMES = 1000

#: Digits of a page's numbers behind the first one of the largest of their kind.
DIGITS = 4

#: Decimals of a page's times [s] and angles [deg].
TIME, ANGLE = 7, 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Frames:
    """The samples that a moving picture shows.

    Attributes
    ----------
    records : of every bearing; of a scene without bearings one
    samples : indices into the steady part, increasing, shape (frames,)
    turning : whether driver or shaft turns on without turning back
    """

    records: tuple[Record, ...]
    samples: np.ndarray
    turning: bool

    @property
    def peak(self) -> int:
        """Frame of the highest ball force; without it of the greatest drive torque; else the first."""
        drawn = [record for record in self.records if record.bearing is not None and record.has_ball_force]
        if drawn:
            return int(np.argmax(np.max([record.highest_ball_force()[self.samples] for record in drawn], axis=0)))
        if self.records[0].has("drive_torque"):
            return int(np.argmax(np.abs(self.records[0].values("drive_torque")[self.samples])))
        return 0


def choose_frames(records: Sequence[Record], turns: float = 1.0, pictures: int | None = None) -> Frames:
    """Samples of the last turns.

    Parameters
    ----------
    turns : of driver or shaft; where nothing turns on, all samples are taken from
    pictures : of a movie that begins anew at its end; None: up to 1000 samples evenly, that of the highest ball force,
        and the last one

    Raises
    ------
    RequestError
        The record is shorter than these turns.
    """
    check_turns(turns)
    angle = records[0].crank_angle()
    way = np.diff(angle)
    turning = bool(len(way) and (np.all(way > 0.0) or np.all(way < 0.0)))
    first = 0
    if turning:
        back = np.abs(angle - angle[-1]) / (2.0 * math.pi)
        if back[0] < turns * (1.0 - 1e-9):
            raise RequestError(
                f"The steady part of the run is {back[0]:.4g} turns long, and {turns:g} were asked for. Simulate more "
                "turns, or show fewer."
            )
        first = int(np.nonzero(back >= turns * (1.0 - 1e-9))[0][-1])
    count = len(angle) - first
    if pictures is not None:
        chosen = set((first + np.arange(pictures) * (count - 1) // pictures).tolist())
    else:
        chosen = {*range(first, len(angle), -(-(count - 1) // FRAMES)), len(angle) - 1}
        for one in records:
            if one.bearing is not None and one.has_ball_force:
                chosen.add(first + int(np.argmax(one.highest_ball_force()[first:])))
    return Frames(records=tuple(records), samples=np.array(sorted(chosen)), turning=turning)


def check_turns(turns: float) -> None:
    """Refuse turns that are no number above 0 with a `RequestError`."""
    if not 0.0 < turns < math.inf:
        raise RequestError(f"{turns!r} turns were asked for. Allowed: more than 0. Give 1 for the last turn.")


def to_plain(frames: Frames) -> dict[str, Any]:
    """All numbers of a page, as JSON has them; signals as whole multiples of a step."""
    record, samples = frames.records[0], frames.samples
    manifest, angle = record.manifest, np.degrees(record.crank_angle()[samples])
    return {
        "title": manifest.title,
        "driver": "crank" if manifest.mechanism is not None else "shaft",
        "time": _signal(record.t[samples], TIME),
        "angle": _signal(_from_first_turn(angle), ANGLE) if np.ptp(angle) > 0.0 else None,
        "turning": frames.turning,
        "windows": np.round(np.degrees(record.load_windows()), 4).tolist() if frames.turning else [],
        "peak": frames.peak,
        "torque": _columns(record.values("drive_torque")[samples, None])[0] if record.has("drive_torque") else None,
        "linkage": _linkage(record, samples) if manifest.mechanism is not None else None,
        "bearings": [_bearing(one, samples) for one in frames.records if one.can_draw_bearing],
    }


def _from_first_turn(angle: Array) -> Array:
    """Angles [deg] less whole turns, so that the lowest is in [0, 360)."""
    return angle - 360.0 * math.floor(float(np.min(angle)) / 360.0 + 1e-9)


def _decimals(values: Array) -> int:
    """Decimals that give the largest of the values five digits."""
    greatest = float(np.max(np.abs(values), initial=0.0))
    return DIGITS - math.floor(math.log10(greatest)) if greatest > 0.0 else 0


def _columns(values: Array) -> list[dict[str, Any]]:
    """Signals of one kind, shape (frames, signals), with the same decimals."""
    return [_signal(column, _decimals(values)) for column in values.T]


def _signal(values: Array, decimals: int) -> dict[str, Any]:
    """Values as whole multiples of a power of ten."""
    return {"decimals": decimals, "values": np.rint(values * 10.0**decimals).astype(int).tolist()}


def _linkage(record: Record, samples: np.ndarray) -> dict[str, Any]:
    mechanism = record.mechanism
    poses = [record.points(float(record.t[k]), record.state(int(k))) for k in samples]
    paths = {key: np.array([pose[key] for pose in poses]) for key in poses[0]}  # (frames, 2) [m]
    used = shapes.used_points(mechanism)
    corners = shapes.drawn_corners(mechanism, paths)
    low, high = corners.min(axis=0), corners.max(axis=0)
    shown = shown_points(mechanism)
    joints = [(name, kind, (b, p), (c, q)) for name, kind, b, p, c, q in mechanism.joints]
    guides = [
        {
            "guide": shown.index(one),
            "block": shown.index(other),
            "direction": shapes.guide_direction(poses[0], paths, one, other).tolist() if one[0] == FRAME else None,
        }
        for _, kind, one, other in joints
        if kind == "prismatic"
    ]
    size = float(np.max(high - low))
    names: dict[int, list[str]] = {}  # joints that stay together share a place
    for name, _, _, at in joints:
        near = (k for k in names if float(np.max(np.abs(paths[shown[k]] - paths[at]))) < 0.01 * size)
        names.setdefault(next(near, shown.index(at)), []).append(name)
    return {
        "low": low.tolist(),
        "high": high.tolist(),
        "points": [_columns(paths[key]) for key in shown],
        "bodies": [
            {"name": body, "points": [shown.index(key) for key in keys]}
            for body, keys in shapes.links(used, poses[0], size)
        ],
        "pins": [
            {"at": shown.index(at), "fixed": FRAME in (one[0], at[0])}
            for _, kind, one, at in joints
            if kind == "revolute"
        ],
        "guides": guides,
        "wheels": [[shown.index((b, p)), shown.index((c, q)), share] for b, p, c, q, share in mechanism.wheels],
        "springs": [[shown.index((b, p)), shown.index((c, q))] for _, b, p, c, q in mechanism.springs],
        "driver": next((shown.index(at) for name, *_, at in joints if name == mechanism.driver), None),
        "masses": [shown.index(key) for key in shown if key[1] == "center_of_mass"],
        "tracers": [shown.index(key) for key in shapes.coupler_points(mechanism)],
        "names": [
            *({"at": at, "text": ", ".join(words)} for at, words in names.items()),
            *({"at": shown.index(key), "text": key[1]} for key in shapes.coupler_points(mechanism)),
        ],
        "forces": [_force(one, shown) for one in shapes.drawn_forces(record, samples, paths)],
    }


def shown_points(mechanism: MechanismInfo) -> list[tuple[str, str]]:
    """Points of a page's linkage, in its order: those that are used, then the centres of mass."""
    used = shapes.used_points(mechanism)
    every = [(info.body, info.point) for info in mechanism.points]
    return [*used, *(key for key in every if key[1] == "center_of_mass" and key not in used)]


def _force(one: shapes.DrawnForce, shown: list[tuple[str, str]]) -> dict[str, Any]:
    x, y = _columns(one.force)
    return {
        "name": one.name,
        "words": one.words,
        "at": shown.index(one.at),
        "pushes": one.pushes,
        "x": x,
        "y": y,
    }


def _bearing(record: Record, samples: np.ndarray) -> dict[str, Any]:
    bearing = record.bearing
    assert bearing is not None  # of those only
    gap, ball = record.radial_gap, record.parameter("bearing.ball_diameter")
    inner, outer = record.centres("inner")[samples], record.centres("outer")[samples]
    moved = inner - outer
    words, force = record.ball_force()
    load = record.ring_load()
    furthest = float(np.max(np.hypot(moved[:, 0], moved[:, 1])))
    return {
        "name": bearing.name or "",
        "noun": record.noun,
        "words": words,
        "balls": bearing.balls,
        "pitch": record.parameter("bearing.pitch_diameter"),
        "ball": ball,
        "gap": gap,
        "factor": shapes.exaggeration(0.25 * ball, max(abs(gap), furthest)),
        "ball_angle": _signal(_from_first_turn(np.degrees(record.ball_angles(samples)[:, 0])), ANGLE),
        "force": _columns(force[samples]),
        "inner": _columns(1e6 * moved),
        "outer": _columns(1e6 * outer) if np.any(outer) else None,
        "load": _columns(load[samples]) if load is not None else None,
        "settings": record.settings(),
    }
