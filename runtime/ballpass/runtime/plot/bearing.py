"""The loaded bearing at one moment: rings, balls, ball forces and the load, with displacements exaggerated.

Radii are true to scale; clearance and the displacement of the inner ring against the outer one, a thousandth of them,
are multiplied with one factor, which the caption states.  A ball that overlaps the raceways is deflected.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.patches import Annulus, Circle

from ballpass.runtime.plot.record import Array, Record
from ballpass.runtime.plot.shapes import exaggeration
from ballpass.runtime.plot.style import INK, SIGNAL, arrow, write

#: White for unloaded, dark for the highest load: the order survives greyscale.
LOAD_COLOURS = LinearSegmentedColormap.from_list("load", ("#ffffff", "#b4c6df", "#4a6fa5", "#0d1b33"))

RING = "#ced4da"


def draw_bearing(axes: Axes, record: Record, sample: int, samples: Sequence[int] = ()) -> float:
    """Draw the bearing at a sample of the record.

    Parameters
    ----------
    samples : of a moving picture, whose colours and displacements have one scale; none: of this sample alone

    Returns
    -------
    the factor by which clearance and displacement are exaggerated [1]
    """
    pitch = record.parameter("bearing.pitch_diameter")
    ball = record.parameter("bearing.ball_diameter")
    _, forces = record.ball_force()
    shown = list(samples) or [sample]
    force, offsets = forces[sample], record.centres("inner") - record.centres("outer")
    offset, furthest = offsets[sample], float(np.max(np.hypot(*offsets[shown].T)))
    factor = exaggeration(0.25 * ball, max(abs(record.radial_gap), furthest))
    inner, outer, gap = factor * offset, np.zeros(2), factor * record.radial_gap / 2.0

    wall = 0.42 * ball
    inner_raceway, outer_raceway = (pitch - ball) / 2.0 - gap, (pitch + ball) / 2.0 + gap
    look: dict[str, Any] = {"facecolor": RING, "edgecolor": INK, "linewidth": 1.2}
    axes.add_patch(Annulus((0.0, 0.0), outer_raceway + wall, wall, **look))
    axes.add_patch(Annulus((float(inner[0]), float(inner[1])), inner_raceway, wall, **look))
    axes.add_patch(Circle(tuple(inner), inner_raceway - wall, facecolor="#f8f9fa", edgecolor="none"))

    highest = max(float(np.max(forces[shown])), 1e-12)
    scale = Normalize(0.0, highest)
    (angles,) = record.ball_angles(np.array([sample]))
    for number, (angle, load) in enumerate(zip(angles, force, strict=True), start=1):
        direction = np.array([np.cos(angle), np.sin(angle)])
        # a ball touches both raceways where it is loaded: half-way between them
        radius = (_reach(inner, inner_raceway, direction) + _reach(outer, outer_raceway, direction)) / 2.0
        centre = radius * direction
        colour = LOAD_COLOURS(float(scale(max(load, 0.0))))
        axes.add_patch(Circle(tuple(centre), ball / 2.0, facecolor=colour, edgecolor="black", linewidth=0.9, zorder=3))
        bright = float(np.dot(colour[:3], (0.2126, 0.7152, 0.0722))) > 0.45
        contrast = "black" if bright else "white"
        write(axes, centre, str(number), fontsize=8.5, color=contrast, zorder=4)
        if load > 0.02 * highest:
            # beside the ring, above or below it: the text begins, ends or has its middle there
            side = "center" if abs(direction[0]) < 0.5 else "left" if direction[0] > 0.0 else "right"
            place = (outer_raceway + wall + (0.42 if side == "center" else 0.12) * ball) * direction + outer
            write(axes, place, f"{load:.0f} N", fontsize=8, color="#212529", ha=side)
    _draw_load(axes, record, sample, shown, inner, 0.92 * (inner_raceway - wall))
    reach = outer_raceway + wall + 0.85 * ball
    factor_words = f"clearance and displacement between the rings ×{factor:g}"
    write(axes, np.array([0.0, -1.04 * reach]), factor_words, fontsize=8, color="#495057", va="top")
    axes.set_xlim(-1.1 * reach, 1.1 * reach)
    axes.set_ylim(-1.12 * reach, reach)
    axes.set_aspect("equal")
    axes.axis("off")
    assert axes.figure is not None  # the axes were made by a figure
    colours = ScalarMappable(scale, LOAD_COLOURS)
    bar = axes.figure.colorbar(colours, ax=axes, shrink=0.6, pad=0.01, aspect=25, panchor=False)
    bar.set_label("contact load [N]", fontsize=9)
    return factor


def _reach(centre: Array, radius: float, direction: Array) -> float:
    """Distance from the origin along `direction` to the circle."""
    along = float(np.dot(centre, direction))
    return along + float(np.sqrt(max(radius**2 - float(np.dot(centre, centre)) + along**2, 0.0)))


def _draw_load(axes: Axes, record: Record, sample: int, shown: list[int], centre: Array, length: float) -> None:
    loads = record.ring_load()
    if loads is None:
        return
    load = loads[sample]
    size, greatest = float(np.hypot(*load)), float(np.max(np.hypot(*loads[shown].T)))
    if size <= 0.02 * greatest:
        return
    way = 0.9 * length * load / greatest
    arrow(axes, centre - way, centre + way, SIGNAL, width=3.0)
    # beside the arrow, clear of it by the text's half width and half height
    normal = np.array([load[1], -load[0]]) / size
    normal = normal if normal[0] > 0.0 else -normal
    place = centre + (0.6 * abs(normal[0]) + 0.22 * abs(normal[1]) + 0.04) * length * normal
    write(axes, place, f"load\n{size:.0f} N", fontsize=8, color=SIGNAL, fontweight="bold")
