"""The mechanism at one moment: links, joints, frame, guide and slider block, forces on the frame and applied ones."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

from ballpass.runtime.app.figures.canvas import GREY, INK, SAND, SIGNAL
from ballpass.runtime.app.figures.record import FRAME, Array, Record

#: Positions in which the paths of moving joints are traced.
_TRACE = 72

_Points = dict[tuple[str, str], Array]


def draw_mechanism(axes: Axes, record: Record, sample: int) -> None:
    """Draw the mechanism at a sample of the record, with the paths of its joints and the forces."""
    mechanism = record.manifest.mechanism
    assert mechanism is not None  # drawn of scenes with a mechanism only
    now = record.points(float(record.t[sample]))
    trace = _traces(record, sample)
    used = list(
        dict.fromkeys((body, point) for _, _, b, p, c, q in mechanism.joints for body, point in ((b, p), (c, q)))
    )
    everything = np.vstack([trace[key] for key in used])
    low, high = everything.min(axis=0), everything.max(axis=0)
    size = max(float(np.max(high - low)), 1e-9)

    for key in used:
        path = trace[key]
        if float(np.max(np.ptp(path, axis=0))) > 1e-9 * size:
            axes.plot(path[:, 0], path[:, 1], color="#adb5bd", linewidth=0.9, linestyle=(0, (3, 2)), zorder=1)
    for _, kind, first, guide, second, block in mechanism.joints:
        if kind == "prismatic":
            direction = _guide_direction(record, now, trace, (first, guide), (second, block))
            _draw_guide(axes, trace[second, block], now[second, block], direction, size, fixed=first == FRAME)
    _draw_links(axes, used, now, size)
    for _, kind, first, point, second, _ in mechanism.joints:
        if kind == "revolute":
            if FRAME in (first, second):
                _draw_ground(axes, now[first, point], size)
            axes.add_patch(
                Circle(
                    tuple(now[first, point]), 0.017 * size, facecolor="white", edgecolor=INK, linewidth=1.5, zorder=6
                )
            )
    arrows = _draw_forces(axes, record, now, sample, size)
    _draw_names(axes, record, now, _busy(record, used, now, trace, size) + arrows, size)
    corners = np.vstack([everything, *((at + way)[None, :] for at, way in arrows)])
    margin = 0.16 * size
    axes.set_xlim(corners[:, 0].min() - margin, corners[:, 0].max() + margin)
    axes.set_ylim(corners[:, 1].min() - margin, corners[:, 1].max() + margin)
    axes.set_aspect("equal")
    axes.axis("off")


def _traces(record: Record, sample: int) -> _Points:
    """Positions of every point through a turn: (body, point) -> (_TRACE + 1, 2) [m]."""
    length = record.cycle_length
    times = (
        [float(record.t[sample])]
        if length is None
        else [float(t) for t in record.t[sample] + np.linspace(0.0, length, _TRACE + 1)]
    )
    poses = [record.points(t) for t in times]
    return {key: np.array([pose[key] for pose in poses]) for key in poses[0]}


def _draw_links(axes: Axes, used: list[tuple[str, str]], now: _Points, size: float) -> None:
    """Each moving body: a bar between two joints, a plate between more."""
    for body in dict.fromkeys(name for name, _ in used if name != FRAME):
        joints: list[Array] = []
        for key in used:
            if key[0] == body and all(np.hypot(*(now[key] - other)) > 1e-6 * size for other in joints):
                joints.append(now[key])
        corners = np.array(joints)
        if len(joints) == 2:
            axes.plot(corners[:, 0], corners[:, 1], color=INK, linewidth=8, solid_capstyle="round", zorder=3)
            axes.plot(corners[:, 0], corners[:, 1], color="#8fa3bf", linewidth=5.4, solid_capstyle="round", zorder=3)
        elif len(joints) > 2:
            centre = corners.mean(axis=0)
            order = np.argsort(np.arctan2(*(corners - centre).T[::-1]))
            axes.add_patch(
                Polygon(corners[order], facecolor="#8fa3bf", edgecolor=INK, linewidth=1.6, joinstyle="round", zorder=3)
            )
        center = now.get((body, "center_of_mass"))
        if center is not None:
            axes.plot(*center, marker="o", markersize=6, color="white", markeredgecolor=INK, zorder=4)
            axes.plot(*center, marker="+", markersize=6, color=INK, zorder=4)


def _draw_ground(axes: Axes, at: Array, size: float) -> None:
    """Pin on a hatched base."""
    half, height = 0.05 * size, 0.07 * size
    base = at[1] - height
    axes.add_patch(
        Polygon(
            np.array([at, (at[0] - half, base), (at[0] + half, base)]),
            facecolor="#e9ecef",
            edgecolor=INK,
            linewidth=1.3,
            zorder=2,
        )
    )
    _hatched_wall(
        axes, np.array([at[0] - 1.5 * half, base]), np.array([at[0] + 1.5 * half, base]), np.array([0.0, -1.0]), size
    )


def _hatched_wall(axes: Axes, start: Array, end: Array, outward: Array, size: float) -> None:
    depth = 0.022 * size * outward
    axes.add_patch(
        Polygon(
            [start, end, end + depth, start + depth],
            facecolor="white",
            edgecolor=GREY,
            hatch="/////",
            linewidth=0.0,
            zorder=0.8,
        )
    )
    axes.plot(*np.array([start, end]).T, color=INK, linewidth=1.5, zorder=2)


def _guide_direction(
    record: Record, now: _Points, trace: _Points, guide: tuple[str, str], block: tuple[str, str]
) -> Array:
    """Unit vector along the guide.

    The slider's point stays on the line through the guide's point: one to the other.  On the frame, along the path.
    """
    ways = (trace[block] - trace[block][0]) if guide[0] == FRAME else (now[block] - now[guide])[None, :]
    longest = ways[int(np.argmax(np.hypot(*ways.T)))]
    length = float(np.hypot(*longest))
    return longest / length if length > 0.0 else np.array([1.0, 0.0])


def _draw_guide(axes: Axes, path: Array, at: Array, direction: Array, size: float, *, fixed: bool) -> None:
    """Slider block between the two walls of its guide."""
    normal = np.array([-direction[1], direction[0]])
    half_length, half_width = 0.085 * size, 0.055 * size
    corners = [
        at + a * half_length * direction + b * half_width * normal for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
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


def _draw_names(axes: Axes, record: Record, now: _Points, busy: list[tuple[Array, Array]], size: float) -> None:
    """Names of the joints, those at one place together, where the drawing is empty.

    `busy` : pairs of a place and a direction in which something is drawn from it.
    """
    mechanism = record.manifest.mechanism
    assert mechanism is not None
    places: list[tuple[Array, list[str]]] = []
    for name, _, _, _, body, point in mechanism.joints:
        at = now[body, point]
        shared = [names for place, names in places if _close(place, at, size)]
        if shared:
            shared[0].append(name)
        else:
            places.append((at, [name]))
    blocks = [now[item[4], item[5]] for item in mechanism.joints if item[1] == "prismatic"]
    compass = [np.array([np.cos(angle), np.sin(angle)]) for angle in np.radians(np.arange(0.0, 360.0, 45.0))]
    for place, names in places:
        taken = [way / np.hypot(*way) for at, way in busy if _close(at, place, size) and np.hypot(*way) > 0.0]
        # the direction whose nearest neighbour is farthest; the first of equals
        free = min(compass, key=lambda way: round(max((float(way @ other) for other in taken), default=0.0), 9))
        distance = 0.15 if any(_close(block, place, size) for block in blocks) else 0.052
        axes.text(
            place[0] + distance * size * free[0],
            place[1] + distance * size * free[1],
            ", ".join(names),
            ha="center",
            va="center",
            fontsize=10,
            fontweight="bold",
            color="#212529",
            zorder=8,
        )


def _close(one: Array, other: Array, size: float) -> bool:
    return float(np.hypot(*(one - other))) < 0.01 * size


def _busy(
    record: Record, used: list[tuple[str, str]], now: _Points, trace: _Points, size: float
) -> list[tuple[Array, Array]]:
    """Where links, bases and guides run: pairs of a place and a direction."""
    mechanism = record.manifest.mechanism
    assert mechanism is not None
    busy = [
        (now[key], now[other] - now[key])
        for key in used
        for other in used
        if key[0] == other[0] != FRAME and key != other
    ]
    # a centre of mass is in the way where it lies beside a joint
    marks = [(now[key], now[key[0], "center_of_mass"] - now[key]) for key in used if (key[0], "center_of_mass") in now]
    busy += [(at, way) for at, way in marks if float(np.hypot(*way)) < 0.08 * size]
    for _, kind, first, point, second, block in mechanism.joints:
        if kind == "prismatic":
            direction = _guide_direction(record, now, trace, (first, point), (second, block))
            busy += [(now[second, block], direction), (now[second, block], -direction)]
        elif FRAME in (first, second):
            busy.append((now[first, point], np.array([0.0, -1.0])))
    return busy


def _draw_forces(axes: Axes, record: Record, now: _Points, sample: int, size: float) -> list[tuple[Array, Array]]:
    """Arrows of the reactions on the frame and of the applied forces that act, all to one scale.

    Returns
    -------
    where an arrow is: pairs of the place the force acts at and the way from there to the arrow's other end [m]
    """
    reactions = _reactions(record, now, sample)
    applied = [(name, now[key], force) for name, key, force in record.applied_forces(float(record.t[sample]))]
    everything = [force for _, force in reactions] + [force for _, _, force in applied]
    greatest = max((float(np.hypot(*force)) for force in everything), default=0.0)
    drawn: list[tuple[Array, Array]] = []
    for at, force in reactions:
        strength = float(np.hypot(*force))
        if strength <= 0.02 * greatest:
            continue
        tip = at + _arrow_length(strength / greatest, size) * force / strength
        _draw_arrow(axes, at, tip, SIGNAL)
        _write_force(axes, tip, force[0] >= 0.0, f"{strength:.0f} N", SIGNAL, size)
        drawn.append((at, tip - at))
    for name, at, force in applied:
        strength = float(np.hypot(*force))
        if strength <= 0.02 * greatest:
            continue
        # it pushes: its tip is where it acts
        foot = at - _arrow_length(strength / greatest, size) * force / strength
        _draw_arrow(axes, foot, at, INK)
        _write_force(axes, foot, force[0] <= 0.0, f"{name}\n{strength:.0f} N", INK, size)
        drawn.append((at, foot - at))
    return drawn


def _reactions(record: Record, now: _Points, sample: int) -> list[tuple[Array, Array]]:
    """Places of the frame's revolute joints whose reaction is an output [m], and the forces on the frame there [N]."""
    mechanism = record.manifest.mechanism
    assert mechanism is not None
    found: list[tuple[Array, Array]] = []
    for name, kind, first, point, second, _ in mechanism.joints:
        if (
            kind != "revolute"
            or FRAME not in (first, second)
            or not record.has(f"reaction.{name}.x", f"reaction.{name}.y")
        ):
            continue
        # the reaction is the force of the second body on the first
        sign = 1.0 if first == FRAME else -1.0
        force = sign * np.array([record.values(f"reaction.{name}.{axis}")[sample] for axis in "xy"])
        found.append((now[first, point], force))
    return found


def _arrow_length(share: float, size: float) -> float:
    """Length of the arrow of a force [m], for its share of the greatest one."""
    return (0.08 + 0.24 * share) * size


def _draw_arrow(axes: Axes, foot: Array, tip: Array, colour: str) -> None:
    axes.annotate(
        "",
        xy=tuple(tip),
        xytext=tuple(foot),
        arrowprops={
            "arrowstyle": "-|>",
            "color": colour,
            "linewidth": 2.6,
            "mutation_scale": 17,
            "shrinkA": 0.0,
            "shrinkB": 0.0,
        },
        zorder=7,
    )


def _write_force(axes: Axes, at: Array, right: bool, words: str, colour: str, size: float) -> None:
    axes.text(
        at[0] + (0.02 if right else -0.02) * size,
        at[1],
        words,
        ha="left" if right else "right",
        va="center",
        color=colour,
        fontweight="bold",
        fontsize=9.5,
        zorder=8,
    )
