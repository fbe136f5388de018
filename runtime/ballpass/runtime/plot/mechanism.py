"""The mechanism at one moment: links, joints, frame, guide and slider block, springs, with the forces.

Forces are those on the frame, applied ones, and those of springs; an arc shows the torque of the drive.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

from ballpass.runtime.plot import shapes
from ballpass.runtime.plot.record import FRAME, Array, Record
from ballpass.runtime.plot.style import APPLIED, GREY, INK, SIGNAL, TORQUE, arrow, write
from ballpass.runtime.report.numbers import rounded

#: Positions in which the paths of moving joints are traced.
_TRACE = 72

BAR, BLOCK = "#8fa3bf", "#c9ced6"

#: Radius of the arc that shows a torque, and how far it reaches for the greatest one [deg].
_ARC, _REACH = 0.1, 250.0

_COMPASS = [np.array([np.cos(angle), np.sin(angle)]) for angle in np.radians(np.arange(0.0, 360.0, 45.0))]


@dataclass(frozen=True, slots=True, kw_only=True)
class MechanismView:
    """Scales that pictures of the mechanism at several samples share.

    Attributes
    ----------
    trace : places of the points, over a turn where one is known, else over the record
    size : larger side of the box around them [m]
    greatest : force that the longest arrow stands for [N]
    torque : of the drive that the longest arc stands for [N*m]
    left : whether the torque's words stand on the left of the driver's joint
    low, high : corners of the box around places and arrows, each (2,) [m]
    """

    trace: shapes.Points
    size: float
    greatest: float
    torque: float
    left: bool
    low: Array
    high: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class _ForceArrow:
    """A force to draw: name, place [m], components [N]; it pulls at the place or, its tip there, pushes."""

    name: str
    at: Array
    force: Array
    colour: str
    pushes: bool

    @property
    def strength(self) -> float:
        return float(np.hypot(*self.force))

    @property
    def words(self) -> str:
        return f"{self.name}\n{self.strength:.0f} N".lstrip()

    def end(self, size: float, greatest: float) -> Array:
        """The arrow's other end, where `greatest` [N] is the longest."""
        reach = (0.08 + 0.24 * self.strength / greatest) * size / self.strength
        return np.asarray(self.at + (-reach if self.pushes else reach) * self.force)


def view(record: Record, samples: Sequence[int]) -> MechanismView:
    """View that holds the mechanism and its arrows at all these samples of the record."""
    poses = [record.points(float(record.t[k]), record.state(k)) for k in samples]
    length = record.cycle_length
    whole = np.linspace(0, record.t.size - 1, _TRACE + 1).astype(int).tolist()
    turn = (
        [record.points(float(record.t[k]), record.state(k)) for k in whole]
        if length is None
        else [record.points(float(record.t[samples[0]] + length * k / _TRACE)) for k in range(_TRACE + 1)]
    )
    trace: shapes.Points = {key: np.array([pose[key] for pose in turn]) for key in turn[0]}
    everything = shapes.drawn_corners(record.mechanism, trace)
    size = max(float(np.max(np.ptp(everything, axis=0))), 1e-9)
    forces = [_forces(record, pose, k) for pose, k in zip(poses, samples, strict=True)]
    greatest = max((one.strength for now in forces for one in now), default=0.0)
    ends = [one.end(size, greatest)[None, :] for now in forces for one in _seen(now, greatest)]
    corners = np.vstack([everything, *ends])
    driver, left = _driver_joint(record), True
    if driver is not None:
        joint, middle = trace[driver][0], 0.5 * (np.min(everything[:, 0]) + np.max(everything[:, 0]))
        left = bool(joint[0] <= middle + 0.01 * size)
        corners = np.vstack([corners, joint + np.array([-0.3 if left else 0.3, 0.0]) * size])
    margin = 0.16 * size
    return MechanismView(
        trace=trace,
        size=size,
        greatest=greatest,
        left=left,
        torque=0.0 if driver is None else float(np.max(np.abs(record.values("drive_torque")))),
        low=corners.min(axis=0) - margin,
        high=corners.max(axis=0) + margin,
    )


def _driver_joint(record: Record) -> tuple[str, str] | None:
    """Body and point of the joint whose torque is drawn; None where the torque was not asked for."""
    found = (item[2:4] for item in record.mechanism.joints if item[0] == record.mechanism.driver)
    return next(found, None) if record.has("drive_torque") else None


def draw_mechanism(axes: Axes, record: Record, sample: int, seen: MechanismView | None = None) -> None:
    """Draw the mechanism at a sample of the record, with the paths of its joints and the forces.

    Parameters
    ----------
    seen : view of several samples; that of this one if None
    """
    mechanism = record.mechanism
    seen = view(record, [sample]) if seen is None else seen
    now, trace, size = record.points(float(record.t[sample]), record.state(sample)), seen.trace, seen.size
    used = shapes.used_points(mechanism)
    for key in used:
        path = trace[key]
        if float(np.max(np.ptp(path, axis=0))) > 1e-9 * size:
            axes.plot(path[:, 0], path[:, 1], color="#adb5bd", linewidth=0.9, linestyle=(0, (3, 2)), zorder=1)
    words = _Words(axes, seen)
    for _, kind, first, guide, second, block in mechanism.joints:
        if kind == "prismatic":
            direction = shapes.guide_direction(now, trace, (first, guide), (second, block))
            _draw_guide(axes, trace[second, block], now[second, block], direction, size, fixed=first == FRAME)
            words.avoid(now[second, block] - 0.1 * size * direction, now[second, block] + 0.1 * size * direction, 0.1)
    for at, radius in shapes.pitch_circles(mechanism, now):
        axes.add_patch(Circle(tuple(at), float(radius), fill=False, edgecolor=GREY, linewidth=1.2, zorder=1.5))
    for _, *ends in mechanism.springs:
        one, other = (now[ends[k], ends[k + 1]] for k in (0, 2))
        _draw_spring(axes, one, other, size)
        words.avoid(one, other)
    _draw_links(axes, used, now, size)
    for _, keys in shapes.links(used, now, size):
        for k in range(len(keys)):
            words.avoid(now[keys[k - 1]], now[keys[k]])
    for _, kind, first, point, second, _ in mechanism.joints:
        at = now[first, point]
        if kind == "revolute":
            if FRAME in (first, second):
                _draw_ground(axes, at, size)
                words.avoid(at, at - np.array([0.0, 0.09 * size]))
            look: dict[str, Any] = {"facecolor": "white", "edgecolor": INK, "linewidth": 1.5, "zorder": 6}
            axes.add_patch(Circle(tuple(at), 0.017 * size, **look))
    for key in shapes.coupler_points(mechanism):
        axes.plot(*now[key], marker="o", markersize=4.5, color=INK, zorder=6)
    forces = _seen(_forces(record, now, sample), seen.greatest)
    for one_force in forces:
        words.avoid(one_force.at, one_force.end(size, seen.greatest))
    for one_force in forces:
        end = one_force.end(size, seen.greatest)
        arrow(axes, *((end, one_force.at) if one_force.pushes else (one_force.at, end)), one_force.colour)
        words.put(end, one_force.words, 0.02 * size, fontsize=9.5, color=one_force.colour)
    driver = _driver_joint(record)
    torque = float(record.values("drive_torque")[sample]) if driver is not None else 0.0
    if driver is not None and abs(torque) > 0.02 * seen.torque:
        at = now[driver]
        arc = _draw_torque(axes, at, torque / seen.torque, size)
        for k in range(3):
            words.avoid(arc[13 * k], arc[13 * k + 13], 0.05)
        side = [_COMPASS[k] for k in ((4, 3, 5) if seen.left else (0, 1, 7))]  # of a movie always the same
        words.put(at, f"drive\n{rounded(abs(torque), 3)} N·m", 1.2 * _ARC * size, side, fontsize=9.5, color=TORQUE)
    _put_names(words, record, now, size)
    axes.set_xlim(seen.low[0], seen.high[0])
    axes.set_ylim(seen.low[1], seen.high[1])
    axes.set_aspect("equal")
    axes.axis("off")


class _Words:
    """Texts of a picture, each placed where it covers least."""

    def __init__(self, axes: Axes, seen: MechanismView) -> None:
        assert axes.figure is not None  # the axes were made by a figure
        panel, inch = axes.get_window_extent(), axes.figure.dpi
        extent = (seen.high - seen.low) / np.array([panel.width, panel.height]) * inch
        self._axes, self._seen, self._point = axes, seen, float(np.max(extent)) / 72.0  # [m] of a printer's point
        self._full: list[tuple[Array, Array, float]] = []  # centre and half the sides of a box, weight

    def avoid(self, one: Array, other: Array, weight: float = 0.2) -> None:
        """Keep texts off the line between two places."""
        half = np.full(2, 3.0 * self._point)
        count = max(9, int(np.ceil(np.max(np.abs(other - one)) / half[0])))
        self._full += [(place, half, weight) for place in np.linspace(one, other, count)]

    def put(
        self,
        at: Array,
        words: str,
        gap: float,
        ways: Sequence[Array] = _COMPASS,
        *,
        places: int = 4,
        fontsize: float,
        color: str = "#212529",
    ) -> None:
        """Write beside a place, in one of these directions, at a distance or, where that is covered, further."""
        lines = words.splitlines()
        half = 0.5 * fontsize * self._point * np.array([0.68 * max(map(len, lines)), 1.3 * len(lines)])

        def place(way: Array, further: int) -> Array:
            return np.asarray(at + (gap + further * fontsize * self._point) * way + np.sign(np.round(way, 6)) * half)

        def cost(way: Array, further: int) -> float:
            middle = place(way, further)
            inside = np.all(middle - half > self._seen.low) and np.all(middle + half < self._seen.high)
            covered = (w for centre, room, w in self._full if np.all(np.abs(middle - centre) < half + room))
            return sum(covered, (0.0 if inside else 10.0) + 0.1 * further)

        best = place(*min(product(ways, range(places)), key=lambda one: cost(*one)))
        self._full.append((best, half, 20.0))  # words over words: worse than outside of the view
        write(self._axes, best, words, fontsize=fontsize, fontweight="bold", color=color, zorder=8)


def _draw_links(axes: Axes, used: list[tuple[str, str]], now: shapes.Points, size: float) -> None:
    """Each moving body: a bar between two joints, a plate between more."""
    for body, keys in shapes.links(used, now, size):
        corners = np.array([now[key] for key in keys])
        if len(keys) == 2:
            axes.plot(corners[:, 0], corners[:, 1], color=INK, linewidth=8, solid_capstyle="round", zorder=3)
            axes.plot(corners[:, 0], corners[:, 1], color=BAR, linewidth=5.4, solid_capstyle="round", zorder=3)
        elif len(keys) > 2:
            look: dict[str, Any] = {"facecolor": BAR, "edgecolor": INK, "linewidth": 1.6, "joinstyle": "round"}
            axes.add_patch(Polygon(corners, zorder=3, **look))
        center = now.get((body, "center_of_mass"))
        if center is not None:
            axes.plot(*center, marker="o", markersize=6, color="white", markeredgecolor=INK, zorder=4)
            axes.plot(*center, marker="+", markersize=6, color=INK, zorder=4)


def _draw_ground(axes: Axes, at: Array, size: float) -> None:
    """Pin on a hatched base."""
    half, base = 0.05 * size, at - np.array([0.0, 0.07 * size])
    across = np.array([half, 0.0])
    triangle = np.array([at, base - across, base + across])
    axes.add_patch(Polygon(triangle, facecolor="#e9ecef", edgecolor=INK, linewidth=1.3, zorder=2))
    _hatched_wall(axes, base - 1.5 * across, base + 1.5 * across, np.array([0.0, -1.0]), size)


def _hatched_wall(axes: Axes, start: Array, end: Array, outward: Array, size: float) -> None:
    depth = 0.022 * size
    along = (end - start) / max(float(np.hypot(*(end - start))), 1e-12)
    feet = start + np.arange(0.0, float((end - start) @ along), 0.7 * depth)[:, None] * along
    # strokes of our own: those of matplotlib have one direction on the paper, and are lost along a wall of 45°
    for foot in feet:
        axes.plot(*np.array([foot, foot + depth * (outward + along)]).T, color=GREY, linewidth=0.7, zorder=0.8)
    axes.plot(*np.array([start, end]).T, color=INK, linewidth=1.5, zorder=2)


def _draw_guide(axes: Axes, path: Array, at: Array, direction: Array, size: float, *, fixed: bool) -> None:
    """Slider block between the two walls of its guide."""
    normal = np.array([-direction[1], direction[0]])
    half_length, half_width = 0.085 * size, 0.055 * size
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    corners = [at + a * half_length * direction + b * half_width * normal for a, b in signs]
    axes.add_patch(Polygon(corners, facecolor=BLOCK, edgecolor=INK, linewidth=1.5, alpha=1.0, zorder=2.5))
    if not fixed:
        ends = np.array([at - 3.0 * half_length * direction, at + 3.0 * half_length * direction])
        axes.plot(*ends.T, color=INK, linewidth=1.2, zorder=2)
        return
    along = (path - at) @ direction
    first, last = at + (along.min() - 1.5 * half_length) * direction, at + (along.max() + 1.5 * half_length) * direction
    for side in (-1.0, 1.0):
        shift = 1.08 * side * half_width * normal
        _hatched_wall(axes, first + shift, last + shift, side * normal, size)


def _draw_spring(axes: Axes, one: Array, other: Array, size: float) -> None:
    """A zigzag between two points, and dots there."""
    way = other - one
    length = float(np.hypot(*way))
    if length < 1e-6 * size:
        return
    along, across = way / length, np.array([-way[1], way[0]]) / length
    places = np.linspace(0.2, 0.8, 12)
    sides = np.array([0.0, *np.resize([1.0, -1.0], 10), 0.0])
    bends = one + np.outer(places * length, along) + np.outer(sides * 0.02 * size, across)
    axes.plot(*np.vstack([one, bends, other]).T, color=GREY, linewidth=1.3, zorder=2.6)
    axes.plot(*np.vstack([one, other]).T, "o", color=GREY, markersize=3.5, zorder=6)


def _put_names(words: _Words, record: Record, now: shapes.Points, size: float) -> None:
    """Names of the joints, those at one place together, and of coupler points."""
    names: dict[tuple[str, str], list[str]] = {}
    for name, *_, body, point in record.mechanism.joints:
        near = (key for key in names if np.hypot(*(now[key] - now[body, point])) < 0.01 * size)
        names.setdefault(next(near, (body, point)), []).append(name)
    names |= {key: [key[1]] for key in shapes.coupler_points(record.mechanism)}
    for key in names:
        words.avoid(now[key], now[key], 0.1)
    blocks = [now[item[4], item[5]] for item in record.mechanism.joints if item[1] == "prismatic"]
    for key, some in names.items():
        block = any(np.hypot(*(place - now[key])) < 0.01 * size for place in blocks)
        words.put(now[key], ", ".join(some), (0.08 if block else 0.025) * size, places=1, fontsize=10)


def _forces(record: Record, now: shapes.Points, sample: int) -> list[_ForceArrow]:
    """Reactions on the frame, applied forces that act, and those of springs on moving bodies."""
    joints = record.mechanism.joints
    hinges = {item[0]: item[2:4] for item in joints if item[1] == "revolute" and FRAME in (item[2], item[4])}
    found = []
    for one in shapes.drawn_forces(record, np.array([sample]), {key: place[None, :] for key, place in now.items()}):
        kind, name, *_ = one.name.split(".")
        if kind != "reaction":
            found.append(_ForceArrow(name=name, at=now[one.at], force=one.force[0], colour=APPLIED, pushes=one.pushes))
        elif name in hinges:
            found.append(
                _ForceArrow(name="", at=now[hinges[name]], force=one.force[0], colour=SIGNAL, pushes=one.pushes)
            )
    return found


def _seen(forces: list[_ForceArrow], greatest: float) -> list[_ForceArrow]:
    """Forces whose arrows are long enough to be seen."""
    return [one for one in forces if one.strength > 0.02 * greatest]


def _draw_torque(axes: Axes, at: Array, share: float, size: float) -> Array:
    """An arc around the driver's joint in the sense of the torque on the driven body; its places, (40, 2) [m]."""
    half = np.radians(20.0 + 0.5 * (_REACH - 40.0) * abs(share)) * np.sign(share)

    def around(angle: Any, radius: float = _ARC) -> Array:
        turned = np.radians(90.0) + angle
        return np.asarray(at + radius * size * np.stack((np.cos(turned), np.sin(turned)), axis=-1))

    neck = half - 0.25 * np.sign(share)
    arc = around(np.linspace(-half, neck, 40))
    axes.plot(*arc.T, color=TORQUE, linewidth=2.6, solid_capstyle="butt", zorder=6.5)
    head = np.array([around(half + 0.15 * np.sign(share)), around(neck, 1.25 * _ARC), around(neck, 0.75 * _ARC)])
    axes.add_patch(Polygon(head, facecolor=TORQUE, edgecolor="none", zorder=6.5))
    return arc
