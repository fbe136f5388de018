"""The mechanism at one moment: links, joints, frame, guide and slider block, forces on the frame and applied ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

from ballpass.runtime.plot.record import FRAME, Array, Record
from ballpass.runtime.plot.shapes import Points, guide_direction, links, used_points
from ballpass.runtime.plot.style import GREY, INK, SAND, SIGNAL, arrow, write

#: Positions in which the paths of moving joints are traced.
_TRACE = 72

BAR = "#8fa3bf"


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """What pictures of the mechanism at several samples share.

    Attributes
    ----------
    trace : places of the points, over a turn where one is known, else at the samples
    size : larger side of the box around them [m]
    greatest : force that the longest arrow stands for [N]
    low, high : corners of the box around places and arrows, each (2,) [m]
    """

    trace: Points
    size: float
    greatest: float
    low: Array
    high: Array


def view(record: Record, samples: Sequence[int]) -> View:
    """View that holds the mechanism and its arrows at all these samples of the record."""
    poses = [record.points(float(record.t[k]), record.state(k)) for k in samples]
    length = record.cycle_length
    turn = (
        poses
        if length is None
        else [record.points(float(record.t[samples[0]] + length * k / _TRACE)) for k in range(_TRACE + 1)]
    )
    trace: Points = {key: np.array([pose[key] for pose in turn]) for key in turn[0]}
    everything = np.vstack([trace[key] for key in used_points(record.mechanism)])
    size = max(float(np.max(np.ptp(everything, axis=0))), 1e-9)
    forces = [_forces(record, pose, k) for pose, k in zip(poses, samples, strict=True)]
    greatest = max((float(np.hypot(*force)) for now in forces for _, _, force, _ in now), default=0.0)
    ends = [end[None, :] for now in forces for _, _, end, _, _ in _arrows(now, size, greatest)]
    corners = np.vstack([everything, *ends])
    margin = 0.16 * size
    return View(
        trace=trace, size=size, greatest=greatest, low=corners.min(axis=0) - margin, high=corners.max(axis=0) + margin
    )


def draw_mechanism(axes: Axes, record: Record, sample: int, seen: View | None = None) -> None:
    """Draw the mechanism at a sample of the record, with the paths of its joints and the forces.

    Parameters
    ----------
    seen : view of several samples; that of this one if None
    """
    mechanism = record.mechanism
    seen = view(record, [sample]) if seen is None else seen
    now, trace, size = record.points(float(record.t[sample]), record.state(sample)), seen.trace, seen.size
    used = used_points(mechanism)
    for key in used:
        path = trace[key]
        if float(np.max(np.ptp(path, axis=0))) > 1e-9 * size:
            axes.plot(path[:, 0], path[:, 1], color="#adb5bd", linewidth=0.9, linestyle=(0, (3, 2)), zorder=1)
    busy: list[tuple[Array, Array]] = []  # a place, and a way from there along which something is drawn
    for _, kind, first, guide, second, block in mechanism.joints:
        if kind == "prismatic":
            direction = guide_direction(now, trace, (first, guide), (second, block))
            _draw_guide(axes, trace[second, block], now[second, block], direction, size, fixed=first == FRAME)
            busy += [(now[second, block], direction * size), (now[second, block], -direction * size)]
    _draw_links(axes, used, now, size)
    for _, kind, first, point, second, _ in mechanism.joints:
        if kind == "revolute":
            if FRAME in (first, second):
                _draw_ground(axes, now[first, point], size)
            look: dict[str, Any] = {"facecolor": "white", "edgecolor": INK, "linewidth": 1.5, "zorder": 6}
            axes.add_patch(Circle(tuple(now[first, point]), 0.017 * size, **look))
    arrows = _draw_forces(axes, _arrows(_forces(record, now, sample), size, seen.greatest), size)
    _draw_names(axes, record, now, busy + arrows, size)
    axes.set_xlim(seen.low[0], seen.high[0])
    axes.set_ylim(seen.low[1], seen.high[1])
    axes.set_aspect("equal")
    axes.axis("off")


def _draw_links(axes: Axes, used: list[tuple[str, str]], now: Points, size: float) -> None:
    """Each moving body: a bar between two joints, a plate between more."""
    for body, keys in links(used, now, size):
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
    depth = 0.022 * size * outward
    corners = [start, end, end + depth, start + depth]
    axes.add_patch(Polygon(corners, facecolor="white", edgecolor=GREY, hatch="/////", linewidth=0.0, zorder=0.8))
    axes.plot(*np.array([start, end]).T, color=INK, linewidth=1.5, zorder=2)


def _draw_guide(axes: Axes, path: Array, at: Array, direction: Array, size: float, *, fixed: bool) -> None:
    """Slider block between the two walls of its guide."""
    normal = np.array([-direction[1], direction[0]])
    half_length, half_width = 0.085 * size, 0.055 * size
    signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    corners = [at + a * half_length * direction + b * half_width * normal for a, b in signs]
    axes.add_patch(Polygon(corners, facecolor=SAND, edgecolor=INK, linewidth=1.5, alpha=1.0, zorder=2.5))
    if not fixed:
        ends = np.array([at - 3.0 * half_length * direction, at + 3.0 * half_length * direction])
        axes.plot(*ends.T, color=INK, linewidth=1.2, zorder=2)
        return
    along = (path - at) @ direction
    first, last = at + (along.min() - 1.5 * half_length) * direction, at + (along.max() + 1.5 * half_length) * direction
    for side in (-1.0, 1.0):
        shift = 1.08 * side * half_width * normal
        _hatched_wall(axes, first + shift, last + shift, side * normal, size)


def _draw_names(axes: Axes, record: Record, now: Points, busy: list[tuple[Array, Array]], size: float) -> None:
    """Names of the joints, those at one place together, on the side where fewest links and forces leave the place."""
    mechanism = record.mechanism
    places: list[tuple[Array, list[str]]] = []
    for name, _, _, _, body, point in mechanism.joints:
        at = now[body, point]
        shared = next((names for place, names in places if np.hypot(*(place - at)) < 0.01 * size), None)
        if shared is None:
            places.append((at, [name]))
        else:
            shared.append(name)
    ends = {key for item in mechanism.joints for key in (item[2:4], item[4:6])}
    links = {key: place for key, place in now.items() if key in ends or key[1] == "center_of_mass"}
    blocks = [now[item[4], item[5]] for item in mechanism.joints if item[1] == "prismatic"]
    compass = [np.array([np.cos(angle), np.sin(angle)]) for angle in np.radians(np.arange(0.0, 360.0, 45.0))]
    for at, names in places:
        bodies = {key[0] for key, place in links.items() if np.hypot(*(place - at)) < 0.01 * size}
        ways = [place - at for (body, _), place in links.items() if body in bodies - {FRAME}]
        ways += [way for foot, way in busy if np.hypot(*(foot - at)) < 0.01 * size]
        ways += [np.array([0.0, -size])] if FRAME in bodies else []  # its base or guide
        taken = [way / np.hypot(*way) for way in ways if np.hypot(*way) > 1e-6 * size]
        # the direction whose nearest neighbour is farthest; the first of equals
        free = min(compass, key=lambda way: round(max((float(way @ other) for other in taken), default=0.0), 6))
        distance = 0.15 if any(np.hypot(*(block - at)) < 0.01 * size for block in blocks) else 0.052
        place = at + distance * size * free
        write(axes, place, ", ".join(names), fontsize=10, fontweight="bold", color="#212529", zorder=8)


def _forces(record: Record, now: Points, sample: int) -> list[tuple[str, Array, Array, float]]:
    """Reactions on the frame and applied forces that act: name, place [m], force [N], side of the arrow.

    A reaction pulls at its place, side 1; an applied force pushes, side -1: its tip is where it acts.
    """
    applied = [(name, now[key], force) for name, key, force in record.applied_forces(float(record.t[sample]))]
    forces = [("", at, force, 1.0) for at, force in _reactions(record, now, sample)]
    return forces + [(f"{name}\n", at, force, -1.0) for name, at, force in applied]


def _arrows(
    forces: list[tuple[str, Array, Array, float]], size: float, greatest: float
) -> list[tuple[str, Array, Array, Array, float]]:
    """Arrows of forces that are seen, all to one scale: name, place [m], its other end [m], force [N], side."""
    found = []
    for name, at, force, side in forces:
        strength = float(np.hypot(*force))
        if strength > 0.02 * greatest:
            end = at + side * (0.08 + 0.24 * strength / greatest) * size * force / strength
            found.append((name, at, end, force, side))
    return found


def _draw_forces(
    axes: Axes, arrows: list[tuple[str, Array, Array, Array, float]], size: float
) -> list[tuple[Array, Array]]:
    """Arrows with their forces in words.

    Returns
    -------
    where an arrow is: pairs of the place the force acts at and the way from there to the arrow's other end [m]
    """
    for name, at, end, force, side in arrows:
        colour = SIGNAL if side > 0.0 else INK
        arrow(axes, *((at, end) if side > 0.0 else (end, at)), colour)
        right = side * force[0] >= 0.0
        place = end + np.array([0.02 * size if right else -0.02 * size, 0.0])
        look: dict[str, Any] = {"color": colour, "fontweight": "bold", "fontsize": 9.5, "zorder": 8}
        write(axes, place, f"{name}{np.hypot(*force):.0f} N", ha="left" if right else "right", **look)
    return [(at, end - at) for _, at, end, _, _ in arrows]


def _reactions(record: Record, now: Points, sample: int) -> list[tuple[Array, Array]]:
    """Places of the frame's revolute joints whose reaction is an output [m], and the forces on the frame there [N]."""
    mechanism = record.mechanism
    found: list[tuple[Array, Array]] = []
    for name, kind, first, point, second, _ in mechanism.joints:
        outputs = [f"reaction.{name}.{axis}" for axis in "xy"]
        if kind == "revolute" and FRAME in (first, second) and record.has(*outputs):
            # the reaction is the force of the second body on the first
            sign = 1.0 if first == FRAME else -1.0
            found.append((now[first, point], sign * np.array([record.values(one)[sample] for one in outputs])))
    return found
