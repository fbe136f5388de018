"""Paper and pencils: figure size, palette, captions, files.

The palette is ordered by luminance and every line has its own style, so that the figures survive a greyscale print.
Nothing here touches pyplot or leaves matplotlib's settings changed.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any, ParamSpec

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

#: 1200 pixels wide.
DPI = 150
WIDTH = 8.0

# relative luminance (CIE L*): 22, 51, 78, 90
INK = "#1d3557"
SIGNAL = "#d1495b"
SAND = "#edae49"
PALE = "#dfe3e8"
GREY = "#6c757d"

#: First and second signal of an axes: dark solid, lighter dashed.
FIRST: dict[str, Any] = {"color": INK, "linestyle": "-", "linewidth": 1.4}
SECOND: dict[str, Any] = {"color": SIGNAL, "linestyle": (0, (5, 2)), "linewidth": 1.4}

_SETTINGS: dict[Any, Any] = {
    "font.family": "DejaVu Sans",  # ships with matplotlib: the same letters on every machine
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#495057",
    "axes.axisbelow": True,
    "axes.grid": True,
    "grid.color": "#e3e6ea",
    "grid.linewidth": 0.7,
    "xtick.color": "#343a40",
    "ytick.color": "#343a40",
    "legend.frameon": False,
    "legend.fontsize": 9,
    "hatch.linewidth": 0.7,
}

P = ParamSpec("P")


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Draw with the settings of this module, whatever the user's are, and put the user's back."""

    @wraps(draw)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with matplotlib.rc_context():
            matplotlib.rcdefaults()
            matplotlib.rcParams.update(_SETTINGS)
            return draw(*args, **kwargs)

    return wrapped


def new_figure(height: float) -> Figure:
    """An empty figure of the common width and a height [inch], without pyplot."""
    return Figure(figsize=(WIDTH, height), dpi=DPI, layout="constrained")


def caption(figure: Figure, title: str, text: str) -> None:
    """Title above, caption below, both inside the layout."""
    figure.suptitle(title, x=0.012, ha="left", fontsize=12, fontweight="bold")
    wrapped = "\n".join(textwrap.wrap(text, 124, break_on_hyphens=False))
    figure.supxlabel(wrapped, x=0.012, ha="left", fontsize=8, color="#495057")


def degree_axis(axes: Axes, *, end: float = 360.0) -> None:
    """Crank angle from 0 to `end` [deg] along x."""
    axes.set_xlim(0.0, end)
    axes.xaxis.set_major_locator(MultipleLocator(60.0 if end <= 360.0 else 90.0))


def save(figure: Figure, path: Path) -> Path:
    """Write a PNG whose bytes depend on the drawing alone: no date, no version of the software."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_SETTINGS)
        figure.savefig(path, format="png", dpi=DPI, metadata={"Software": None})
    return path
