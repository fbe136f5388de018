"""Paper and pencils: figure size, palette, captions, files.

The palette is ordered by luminance and every line has its own style, so that the figures survive a greyscale print.
Nothing here touches pyplot or leaves matplotlib's settings changed.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import Any, Literal, ParamSpec

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

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

_CAPTION: dict[str, Any] = {"fontsize": 8, "color": "#495057"}

P = ParamSpec("P")


@contextmanager
def settings() -> Iterator[None]:
    """Settings of this module within, whatever the user's are."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_SETTINGS)
        yield


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Draw with the settings of this module, and put the user's back."""

    @wraps(draw)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with settings():
            return draw(*args, **kwargs)

    return wrapped


def new_figure(height: float, *, layout: Literal["constrained"] | None = "constrained") -> Figure:
    """An empty figure of the common width and a height [inch], without pyplot.

    Parameters
    ----------
    layout : "constrained" finds room for all words, which takes as long as drawing; None leaves it to `frame`
    """
    return Figure(figsize=(WIDTH, height), dpi=DPI, layout=layout)


def frame(
    figure: Figure, title: str, text: str, *, left: float = 0.75, right: float = 0.2, below: float = 0.6, **gaps: float
) -> None:
    """Title above, caption below and the axes between them, by margins [inch].

    Parameters
    ----------
    below : room for ticks and label of the x axis
    gaps : ``wspace`` and ``hspace`` between axes, in parts of their size
    """
    width, height = figure.get_size_inches()
    lines = textwrap.wrap(text, 124, break_on_hyphens=False)
    figure.suptitle(title, x=0.1 / width, y=1.0 - 0.1 / height, ha="left", va="top", fontsize=12, fontweight="bold")
    figure.supxlabel("\n".join(lines), x=0.1 / width, y=0.08 / height, ha="left", va="bottom", **_CAPTION)
    figure.subplots_adjust(
        left=left / width,
        right=1.0 - right / width,
        bottom=(below + 0.14 * len(lines)) / height,
        top=1.0 - (0.4 + 0.21 * len(title.splitlines())) / height,
        **gaps,
    )


def caption(figure: Figure, title: str, text: str) -> None:
    """Title above, caption below, both inside the layout."""
    figure.suptitle(title, x=0.012, ha="left", fontsize=12, fontweight="bold")
    wrapped = "\n".join(textwrap.wrap(text, 124, break_on_hyphens=False))
    figure.supxlabel(wrapped, x=0.012, ha="left", **_CAPTION)


def shade_windows(axes: Axes, windows: Iterable[tuple[float, float]], turns: Iterable[int]) -> None:
    """Shade windows of the crank angle [rad] in some turns of an axis in degrees."""
    for start, end in np.degrees(list(windows)):
        for turn in turns:
            axes.axvspan(start + 360.0 * turn, end + 360.0 * turn, color=PALE, linewidth=0, zorder=0)


def legend_above(figure: Figure, *args: Any, **kwargs: Any) -> None:
    """A legend in the corner right of the title; arguments as for `Figure.legend`."""
    figure.legend(*args, **kwargs, loc="upper right", ncols=2, bbox_to_anchor=(0.995, 0.995))


def arrow(axes: Axes, foot: NDArray[np.float64], tip: NDArray[np.float64], colour: str, *, width: float = 2.6) -> None:
    """An arrow between two places of the axes."""
    look = {"arrowstyle": "-|>", "color": colour, "linewidth": width, "mutation_scale": 17, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", xy=(tip[0], tip[1]), xytext=(foot[0], foot[1]), arrowprops=look, zorder=7)


def write(axes: Axes, at: NDArray[np.float64], words: str, **look: Any) -> None:
    """Words centred at a place of the axes; `look` as for `Axes.text`."""
    axes.text(float(at[0]), float(at[1]), words, **({"ha": "center", "va": "center"} | look))


def save(figure: Figure, path: Path) -> Path:
    """Write a PNG whose bytes depend on the drawing alone: no date, no version of the software."""
    with settings():
        figure.savefig(path, format="png", dpi=DPI, metadata={"Software": None})
    return path
