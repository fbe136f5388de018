"""Load curve (Fig. 4 of the paper) and contact load of every ball (Fig. 8)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ballpass.runtime.plot import PAPER
from ballpass.runtime.plot.record import Array, Record
from ballpass.runtime.plot.style import (
    FIRST,
    GREY,
    INK,
    SECOND,
    frame,
    legend_above,
    mark_angles,
    new_figure,
    shade_windows,
    styled,
)
from ballpass.runtime.time.turning import past

#: Part of the turns in the enlarged panel of ball loads, and part of the time below which high loads are rare.
CLOSER, RARE = 1.0 / 16.0, 0.2


def reaction_joints(record: Record) -> tuple[str, ...]:
    """Joints to show in the load curve: the bearing's; without a bearing all whose reactions are outputs."""
    mechanism, bearing = record.manifest.mechanism, record.bearing
    if mechanism is None:
        return ()
    names = tuple(joint[0] for joint in mechanism.joints)
    if bearing is not None:
        names = tuple(name for name in names if name == bearing.joint)
    return tuple(name for name in names if record.has(f"reaction.{name}.x", f"reaction.{name}.y"))


@styled
def load_curve(record: Record) -> Figure:
    """Joint reactions, load on the inner ring and drive torque over the crank angle of the last turn or cycle."""
    joints = reaction_joints(record)
    ring_load = record.ring_load()
    with_torque = record.has("drive_torque")
    if not joints:
        joints = ("",)  # only the load on the ring was asked for
    rows = len(joints) + with_torque
    figure = new_figure(1.3 + 1.9 * rows, layout=None)
    grid = figure.add_gridspec(rows, 2)
    turns = min(record.cycle_turns, len(record.turns))
    angle, order = _last_turns(record, turns)
    bodies = {item[0]: (item[2], item[4]) for item in record.mechanism.joints}
    panels: list[Axes] = []
    for row, joint in enumerate(joints):
        for column, axis in enumerate("xy"):
            axes = figure.add_subplot(grid[row, column])
            title = axis
            if joint:
                first, second = bodies[joint]
                title = f"{axis} at {joint}: {second} on {first}"
                values = record.values(f"reaction.{joint}.{axis}")[order]
                _curve(axes, angle, values, FIRST, "reaction of the joint", turns)
            if ring_load is not None and row == 0:
                _curve(axes, angle, ring_load[order, column], SECOND, "load on the inner ring", turns)
            axes.set_title(title)
            axes.set_ylabel(f"force along {axis} [N]")
            panels.append(axes)
    if with_torque:
        axes = figure.add_subplot(grid[rows - 1, :])
        _curve(axes, angle, record.values("drive_torque")[order], FIRST, "", turns)
        axes.set_title("torque of the drive on the driven body")
        axes.set_ylabel("torque [N·m]")
        panels.append(axes)
    _flatten_noise(panels[: 2 * len(joints)])
    windows = record.load_windows()
    for axes in panels:
        axes.set_xlim(0.0, 360.0 * turns)
        axes.set_xticks(np.linspace(0.0, 360.0 * turns, 7 if turns < 3 else 2 * turns + 1))
        axes.axhline(0.0, color=GREY, linewidth=0.6)
        shade_windows(axes, windows, range(-1, turns))
        low, high = axes.get_ylim()
        axes.set_ylim(low, high + 0.05 * (high - low))
    for axes in panels[-1:] if with_torque else panels[-2:]:
        axes.set_xlabel(f"{record.manifest.angle_words} [°]")
    handles, labels = panels[0].get_legend_handles_labels()
    legend_above(figure, handles, labels)
    shaded = " Shaded: an applied load acts." if windows else ""
    shown = "One turn" if turns == 1 else f"{turns} turns"
    frame(
        figure,
        record.title(
            "Load curve of the inner ring" if record.bearing is not None else "Joint reactions and drive torque"
        ),
        f"{shown}; x and y have their own scales.{shaded} Counter-clockwise torque is positive. {record.settings()}.",
        left=0.85,
        wspace=0.3,
        hspace=0.5,
    )
    return figure


def _flatten_noise(panels: list[Axes]) -> None:
    """A component that is zero except for rounding gets an axis on which it looks like zero."""
    heights = [max(float(np.max(np.abs(line.get_ydata()))) for line in axes.get_lines()) for axes in panels]
    for axes, height in zip(panels, heights, strict=True):
        if height < 1e-9 * max(heights):
            axes.set_ylim(-0.01 * max(heights), 0.01 * max(heights))


def _last_turns(record: Record, turns: int) -> tuple[Array, Array]:
    """Crank angles of the last turns, increasing, within these [deg], and the samples' indices in that order."""
    window = record.last_turns(turns)
    # the last sample repeats the first one's angle
    index = np.arange(window.start, window.stop - 1)
    angle = np.degrees(past(record.crank_angle()[index], turns=turns))
    order = np.argsort(angle, kind="stable")
    return angle[order], index[order]


def _curve(axes: Axes, angle: Array, values: Array, look: dict[str, object], label: str, turns: int) -> None:
    # close the turns: the curve starts and ends at the frame of the axes
    closed_angle = np.concatenate((angle[-1:] - 360.0 * turns, angle, angle[:1] + 360.0 * turns))
    closed = np.concatenate((values[-1:], values, values[:1]))
    axes.plot(closed_angle, closed, label=label, **look)  # type: ignore[arg-type]


@styled
def ball_loads(record: Record) -> Figure:
    """Contact load of every ball over the last two turns, one strip per ball, all at one scale."""
    words, force = record.ball_force()
    window = record.last_turns(2)
    force = force[window]
    balls = force.shape[1]
    along, label = record.along(window)
    windows = record.load_windows() if record.turns else ()
    top = max(float(np.max(force)), 1e-12)
    bottom = min(float(np.min(force)), 0.0)
    figure = new_figure(1.5 + max(0.5 * balls, 2.0), layout=None)
    moment, closer = _around_peak(along, force)
    ratios = (2.2, 1.0) if closer else (1.0,)
    grid = figure.subplots(balls, len(ratios), sharex="col", sharey=True, squeeze=False, width_ratios=ratios)
    for number, axes in ((number, axes) for number, row in enumerate(grid, start=1) for axes in row):
        axes.fill_between(along, 0.0, force[:, number - 1], color=INK, alpha=0.35, linewidth=0, rasterized=True)
        axes.plot(along, force[:, number - 1], color=INK, linewidth=0.9)
        shade_windows(axes, windows, range(-1, int(along.max() // 360.0) + 1))
        axes.set_ylim(min(1.1 * bottom, 0.0), 1.1 * top)
        axes.set_yticks([0.0, _round_below(0.7 * top)])  # so low that no number touches that of the next strip
    for number, axes in enumerate(grid[:, -1], start=1):
        axes.text(1.02, 0.4, f"{record.noun} {number}", transform=axes.transAxes, fontsize=9, va="center")
    first = grid[-1, 0]
    first.set_xlim(float(along.min()), float(along.max()))
    if record.turns:
        mark_angles(first, along, 6 if closer else 12)
    first.set_xlabel(label)
    if closer:
        grid[-1, 1].set_xlim(*moment)
        grid[-1, 1].set_xlabel(label)
    figure.supylabel("contact load [N]", fontsize=9.5, **({"x": 0.008} if PAPER.get()[0] is None else {}))
    shown = "last two turns" if len(record.turns) >= 2 else "last turn" if record.turns else "the whole record"
    shaded = " Shaded: an applied load acts." if windows else ""
    right = " Right: around the highest load." if closer else ""
    frame(
        figure,
        record.title(f"Contact load of every {record.noun}"),
        f"{words.capitalize()}, {shown}; all strips at one scale, highest sample {top:.4g} N.{right}{shaded} "
        f"{record.settings()}.",
        left=0.9,
        right=0.8,
        hspace=0.15,
        wspace=0.06,
    )
    return figure


def _round_below(value: float) -> float:
    """Largest of 1, 2, 2.5, 5, 10, 20 ... up to a value."""
    decade = 10.0 ** np.floor(np.log10(value))
    return float(max(digit * decade for digit in (1.0, 2.0, 2.5, 5.0) if digit * decade <= value))


def _around_peak(along: Array, force: Array) -> tuple[tuple[float, float], bool]:
    """Part of the axis around the highest load, and whether high loads are so rare that it shows more."""
    highest = np.max(force, axis=1)
    peak, span = float(along[int(np.argmax(highest))]), float(np.ptp(along)) * CLOSER
    rare = float(np.mean(highest > 0.5 * np.max(highest))) < RARE
    return (max(peak - 0.25 * span, float(along.min())), min(peak + 0.75 * span, float(along.max()))), rare
