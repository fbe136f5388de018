"""The shaft along its axis, with what its bearings and joints bear on it, at the moment of the highest bearing load."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ballpass.runtime.plot.record import Array, Record
from ballpass.runtime.plot.style import APPLIED, GREY, SIGNAL, frame, new_figure, styled


def has_shaft(record: Record) -> bool:
    """Whether every bearing has a place along the shaft and a force among the outputs; drawn once, of the first."""
    bearings = record.manifest.bearings
    return bool(bearings) and record.bearing is bearings[0] and all(_carried(record))


def _carried(record: Record) -> Iterator[tuple[str, float, Array] | None]:
    """Name, place [m] and force on the shaft [N] of each bearing; None where the force is no output."""
    for bearing in record.manifest.bearings:
        own, position = replace(record, bearing=bearing), f"{bearing.path}.position"
        force = "ring_force" if bearing.axis else "load"  # of a shaft that does not tilt: by levers
        known = position in record.solution.parameters and own.has(f"{force}.x", f"{force}.y")
        yield (bearing.name, record.parameter(position), -_pair(own, force)) if known else None


def _pair(record: Record, name: str) -> Array:
    return np.column_stack([record.values(f"{name}.{axis}") for axis in "xy"])


def _applied(record: Record, sample: int) -> Iterator[tuple[str, float, Array]]:
    """Name, place and force at a sample, of joints and loads of the driven body whose points have a place."""
    mechanism = record.manifest.mechanism
    if mechanism is None:
        return
    bodies = {item[0]: (item[2], item[3], item[4], item[5]) for item in mechanism.joints}
    driven = next(body for body in bodies[mechanism.driver][::2] if body != "frame")
    found = list(record.applied_forces(float(record.t[sample])))
    for name, (first, first_point, second, second_point) in bodies.items():
        if record.has(f"reaction.{name}.x", f"reaction.{name}.y"):
            reaction = _pair(record, f"reaction.{name}")[sample]
            found += [(name, (first, first_point), reaction), (name, (second, second_point), -reaction)]
    for name, (body, point), force in found:
        place = f"mechanism.bodies.{driven}.positions.{point}"
        if body == driven and place in record.solution.parameters:
            yield name, record.parameter(place), force


@styled
def shaft_loads(record: Record) -> Figure:
    """Forces on the shaft over the place along it, x and y, at the sample of the highest force of any bearing."""
    carried = [found for found in _carried(record) if found is not None]
    sample = int(np.argmax(np.max([np.hypot(*force.T) for _, _, force in carried], axis=0)))
    applied = list(_applied(record, sample))
    figure = new_figure(5.4, layout=None)
    grid = figure.subplots(2, 1, sharex=True, sharey=True)
    for column, axes in enumerate(grid):
        _draw(axes, [(n, z, float(f[sample, column])) for n, z, f in carried], SIGNAL)
        _draw(axes, [(n, z, float(f[column])) for n, z, f in applied], APPLIED)
        axes.set_ylabel(f"force along {'xy'[column]} [N]")
        axes.margins(0.08, 0.25)
    places = [1e3 * place for _, place, _ in (*carried, *applied)]
    for axes in grid:
        axes.plot([min(places), max(places)], [0.0, 0.0], color=GREY, linewidth=3, solid_capstyle="round", zorder=1)
    grid[1].set_xlabel("place along the shaft [mm]")
    text = f"{record.when(sample)}: forces on the shaft, of its bearings (red)"
    text += ", and of joints and loads that have a place along it (brown)" * bool(applied)
    whole = replace(record, bearing=None)  # the figure is of all bearings
    title = whole.title("The shaft at the highest force of a bearing")
    frame(figure, title, f"{text}. {whole.settings()}.", left=0.9, hspace=0.15)
    return figure


def _draw(axes: Axes, forces: list[tuple[str, float, float]], color: str) -> None:
    """An arrow for each force, with its name at the tip."""
    for name, place, force in forces:
        look = {"arrowstyle": "-|>", "color": color, "linewidth": 1.6, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", xy=(1e3 * place, force), xytext=(1e3 * place, 0.0), arrowprops=look)
        axes.plot([1e3 * place], [force], linestyle="none")  # for the limits
        axes.annotate(
            f"{name}\n{force:z.0f}",
            xy=(1e3 * place, force),
            xytext=(0, 3 if force >= 0 else -3),
            textcoords="offset points",
            ha="center",
            va="bottom" if force >= 0 else "top",
            fontsize=8,
            color=color,
        )
