"""Figures of signals: lines of a spectrum with the characteristic frequencies of the bearings, and spectrograms."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import StrMethodFormatter

from ballpass.runtime.contract.units import table_unit
from ballpass.runtime.plot.style import GREY, INK, SAND, SIGNAL, frame, new_figure, styled
from ballpass.runtime.quantity.characteristic import CharacteristicLine
from ballpass.runtime.vibration.diagnosis import Spectrogram

#: Multiples of a characteristic frequency that are marked.
MARKED = 5
#: Lines below this part of the highest are not shown.
FLOOR = 1e-3
#: At most so many multiples of the highest characteristic frequency are shown.
SHOWN = 6.0

_LOOKS: dict[str, dict[str, Any]] = {
    "shaft": {"color": GREY, "linestyle": (0, (1, 1.5)), "linewidth": 0.8},
    "FTF": {"color": "#7b5ea7", "linestyle": (0, (1, 1)), "linewidth": 1.0},
    "BPFO": {"color": SIGNAL, "linestyle": (0, (6, 2)), "linewidth": 1.2},
    "BPFI": {"color": SAND, "linestyle": (0, (4, 1.5)), "linewidth": 1.4},
    "2 BSF": {"color": "#5b8e7d", "linestyle": (0, (3, 1, 1, 1)), "linewidth": 1.2},
}
#: Head of the marks of a scene's first, second, ... bearing.
_HEADS = ("", "o", "s", "^", "D")

#: Width of the legend, of a handle and of a letter in it, height of its rows [inch].
_LEGEND, _HANDLE, _LETTER, _ROW = 7.4, 0.5, 0.062, 0.19

#: Place of a legend: right above the axes.
_ABOVE: dict[str, Any] = {
    "loc": "lower right",
    "bbox_to_anchor": (1.0, 1.0),
    "borderaxespad": 0.2,
    "columnspacing": 1.2,
}


@styled
def draw_lines(
    position: np.ndarray,
    height: np.ndarray,
    marks: Sequence[CharacteristicLine],
    *,
    title: str,
    across: str,
    up: str,
    text: str,
) -> Figure:
    """A spectrum, logarithmic in height, with the first multiples of each characteristic frequency marked.

    Parameters
    ----------
    position, height : (m,) of the lines, in the units that `across` and `up` name
    marks : characteristic frequencies, in the unit of `position`
    text : for the caption
    """
    figure = new_figure(4.6, layout=None)
    axes = figure.subplots()
    limit = float(position[-1])
    if marks:
        limit = min(limit, SHOWN * max(mark.frequency for mark in marks))
    shown = (position > 0.0) & (position <= limit)
    peak = float(np.max(height[shown]))
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))  # not by mathtext, which is slow
    axes.minorticks_off()
    axes.set_ylim(FLOOR * peak, 2.0 * peak)
    axes.set_xlim(0.0, limit)
    unit = " Hz" if across.endswith("[Hz]") else ""
    looks = []
    bearings = list(dict.fromkeys(mark.bearing for mark in marks if mark.of_bearing))
    for mark in marks:
        every = mark.frequency * np.arange(1, (1 if mark.name == "FTF" else MARKED) + 1)
        every, look = every[every <= limit], _LOOKS.get(mark.name, _LOOKS["shaft"])
        head = _HEADS[bearings.index(mark.bearing) % len(_HEADS)] if mark.of_bearing else _HEADS[0]
        axes.vlines(every, 0.0, 1.0, transform=axes.get_xaxis_transform(), zorder=0.5, **look)
        if head:
            heads = {"marker": head, "color": look["color"], "linestyle": "none", "markersize": 5.0}
            axes.plot(every, np.full(len(every), 0.97), transform=axes.get_xaxis_transform(), **heads)
        line = Line2D([], [], marker=head, markersize=5.0, **look | {"linewidth": 1.6})
        looks.append((line, f"{mark.label} {mark.frequency:.4g}{unit}"))
    axes.plot(position[shown], np.maximum(height[shown], FLOOR * peak), color=INK, linewidth=1.0)
    axes.grid(visible=False, axis="x")
    axes.set_xlabel(across)
    axes.set_ylabel(up)
    rows = 1
    if looks:
        longest = max(len(words) for _, words in looks)
        columns = min(len(looks), max(int(_LEGEND / (_HANDLE + _LETTER * longest)), 1), 5)
        rows = -(-len(looks) // columns)
        axes.legend(*zip(*looks, strict=True), ncols=columns, **_ABOVE)
        text += f" Marked: characteristic frequencies and multiples up to {MARKED}."
    frame(figure, title, text, left=1.1, above=_ROW * (rows - 1))
    return figure


@styled
def draw_spectrogram(
    found: Spectrogram, orders: Sequence[CharacteristicLine], speed: np.ndarray, *, title: str, unit: str
) -> Figure:
    """Amplitudes over time and frequency, in decades of the highest, with the characteristic frequencies.

    Parameters
    ----------
    orders : characteristic lines over the speed of the shaft
    speed : of the shaft at the times of the segments, shape (k,) [1/s]
    """
    figure = new_figure(4.8, layout=None)
    axes = figure.subplots()
    levels = np.log10(np.maximum(found.amplitude, 1e-300) / np.max(found.amplitude))
    picture = axes.pcolormesh(
        found.time, found.frequency, levels, cmap="Greys", vmin=np.log10(FLOOR), vmax=0.0, shading="nearest"
    )
    axes.grid(visible=False)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("frequency [Hz]")
    for mark in orders:
        axes.plot(found.time, mark.frequency * speed, label=mark.label, **_LOOKS.get(mark.name, _LOOKS["shaft"]))
    if orders:
        axes.legend(ncols=min(len(orders), 5), **_ABOVE)
    highest = [SHOWN * mark.frequency * float(np.max(speed)) for mark in orders]
    axes.set_ylim(0.0, min(float(found.frequency[-1]), max(highest, default=np.inf)))
    bar, (factor, shown) = figure.colorbar(picture, ax=axes, pad=0.02), table_unit(unit)
    bar.set_label(f"log10 of amplitude over {factor * np.max(found.amplitude):.3g} {shown}")
    lines = found.frequency[1] - found.frequency[0]
    frame(figure, title, f"Segments of {1.0 / lines:.3g} s, lines {lines:.3g} Hz apart.", left=0.9)
    return figure
