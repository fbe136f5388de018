"""Figures of a life report: damage around both raceways, pressure over a turn, life against clearance.

In: records of `ballpass.runtime.ask`, arrays.  Out: figures.
"""

from __future__ import annotations

import math

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, StrMethodFormatter
from numpy.typing import NDArray

from ballpass.runtime.life.records import BearingStrength
from ballpass.runtime.plot.style import INK, PALE, SAND, SIGNAL, caption, new_figure, styled
from ballpass.runtime.plot.sweep import LUMINANCE
from ballpass.runtime.ratings.elements import RATED
from ballpass.runtime.ratings.life import MILLION

Array = NDArray[np.float64]


@styled
def damage(title: str, bearing: BearingStrength) -> Figure:
    """Share of every place of both raceways in the damage of the bearing."""
    figure = new_figure(5.2)
    rings = (("inner raceway", bearing.inner, INK), ("outer raceway", bearing.outer, SIGNAL))
    for k, (name, ring, colour) in enumerate(rings):
        panel = figure.add_subplot(1, 2, k + 1, projection="polar")
        share = 100.0 * np.asarray(ring.damage)
        width = 2.0 * math.pi / len(share)
        panel.bar(width * np.arange(len(share)), share, width=width, color=colour, edgecolor="white", linewidth=0.3)
        panel.set_title(f"{name}: {share.sum():.0f} % of the damage", loc="center", pad=12)
        panel.yaxis.set_major_locator(MaxNLocator(4))
        panel.yaxis.set_major_formatter(StrMethodFormatter("{x:g} %"))
        panel.tick_params(labelsize=8)
    element = RATED[bearing.element]
    words = (
        f"Share of each of {len(bearing.inner.damage)} places in the damage of both raceways [%], by the power "
        f"{element.life.turning} of the {element.noun} loads that pass it, with the exponent {element.life.weibull} of "
        "Weibull's law. Angles are in each ring's own "
        "coordinates, from where its x axis was at the start."
    )
    caption(figure, f"{_titled(title, bearing)}: where the raceways tire", words)
    return figure


@styled
def pressure(title: str, bearing: BearingStrength, across: Array, found: Array, ring: str, turns: int | None) -> Figure:
    """Peak pressure of every ball's contact over a turn, over several of an engine's cycle, or over a run.

    Parameters
    ----------
    across : angles of driver or shaft, increasing over the turns [rad], or times [s], shape (samples,)
    found : shape (samples, balls) [Pa]
    turns : None over a run
    """
    figure = new_figure(4.4)
    panel = figure.add_subplot()
    balls, element = found.shape[1], RATED[bearing.element]
    edges = np.append(across, 2.0 * across[-1] - across[-2])
    edges = edges if turns is None else np.degrees(edges)
    mesh = panel.pcolormesh(
        edges, np.arange(balls + 1) + 0.5, found.T / 1e6, cmap=LUMINANCE.reversed(), rasterized=True
    )
    figure.colorbar(mesh, ax=panel, label="peak pressure [MPa]")
    xlabel = "time [s]" if turns is None else "angle of driver or shaft [°]"
    panel.set(xlabel=xlabel, ylabel=element.noun, yticks=range(1, balls + 1))
    panel.grid(visible=False)
    name = "the run" if turns is None else "a turn" if turns == 1 else f"{turns} turns"
    shown = name if turns is None else f"the first {name.removeprefix('a ')} after the transient"
    words = (
        f"Peak pressure between each {element.noun} and the {ring} ring in {shown}; dark "
        f"is high. The static limit of ISO 76 is {element.static_pressure / 1e6:.0f} MPa; the highest pressure of all "
        f"turns is {bearing.inner.peak_pressure / 1e6:.0f} MPa at the inner and "
        f"{bearing.outer.peak_pressure / 1e6:.0f} MPa at the outer ring."
    )
    caption(figure, f"{_titled(title, bearing)}: pressure over {name}", words)
    return figure


@styled
def life_of_clearance(
    title: str,
    bearing: BearingStrength,
    clearances: Array,
    lives: Array,
    present: float,
    group: tuple[str, float, float] | None,
    turns: float | None,
) -> Figure:
    """Life against the clearance.

    Parameters
    ----------
    clearances : shape (points,) [m]
    lives : shape (points,) [turns]
    present : clearance of the scene [m]
    group : name and range of the bearing's group of clearance [m]; None where the scene names none
    turns : steady turns of each point; None: as long as the scene says
    """
    figure = new_figure(4.4)
    panel = figure.add_subplot()
    if group is not None:
        name, least, most = group
        panel.axvspan(1e6 * least, 1e6 * most, color=PALE, linewidth=0, zorder=0, label=f"clearance {name}")
    panel.plot(1e6 * clearances, lives / MILLION, color=SAND, linewidth=2.4)
    panel.axvline(1e6 * present, color="#6c757d", linewidth=1.0, linestyle=":")
    panel.set(xlabel="diametral clearance in operation [µm]", ylabel="rating life $L_{10r}$ [million turns]")
    panel.margins(x=0.0)
    if group is not None:
        panel.legend(
            loc="best", frameon=True, facecolor="white", edgecolor="none", framealpha=1.0
        )  # it may lie on the group
    shaded = f" Shaded: group {group[0]} in operation." if group is not None else ""
    length = "the scene's length" if turns is None else f"{turns:.4g} steady turns"
    words = f"{len(clearances)} runs of {length}. Dotted: the scene's clearance.{shaded}"
    caption(figure, f"{_titled(title, bearing)}: life against clearance", words)
    return figure


def _titled(title: str, bearing: BearingStrength) -> str:
    return f"{title}, {bearing.name}" if bearing.name else title
