"""The style of every figure: size, palette, letters, captions, files.

The palette is ordered by luminance and every line has its own style, so that the figures survive a greyscale print.
Nothing here touches pyplot or leaves matplotlib's settings changed.
"""

from __future__ import annotations

import io
import math
import re
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import Any, Literal, ParamSpec

import matplotlib
import numpy as np
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_pdf import Op, PdfPages
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

from ballpass.runtime.contract.folders import replace_file
from ballpass.runtime.contract.units import printed_unit
from ballpass.runtime.plot import PAPER

#: 1200 pixels wide.
DPI = 150
WIDTH = 8.0

#: Of figures for a paper: scale that makes letters of 9.5 points those of 7, and pixels in an inch.
PAPER_SCALE = 7.0 / 9.5
PAPER_DPI = 300

# relative luminance (CIE L*): 22, 51, 78, 90
INK = "#1d3557"
SIGNAL = "#d1495b"
SAND = "#edae49"
PALE = "#dfe3e8"
GREY = "#6c757d"
FAINT = "#b4bcc4"

#: What is drawn of a machine has one colour in figures and pages: reactions and loads of bearings `SIGNAL`, and these.
APPLIED = "#b87503"
TORQUE = "#3c7a5e"

#: First and second signal of an axes: dark solid, lighter dashed.
FIRST: dict[str, Any] = {"color": INK, "linestyle": "-", "linewidth": 1.4}
SECOND: dict[str, Any] = {"color": SIGNAL, "linestyle": (0, (5, 2)), "linewidth": 1.4}

#: Styles of lines without their own: 20, each another pair of colour and dashes.
_CYCLE = cycler(
    color=[INK, SIGNAL, SAND, "#5b8e7d", GREY] * 4,
    linestyle=["-", (0, (5, 2)), (0, (1, 1.2)), (0, (6, 2, 1, 2))] * 5,
)

_SETTINGS = matplotlib.rc_params_from_file(Path(__file__).with_name("figures.mplstyle"), use_default_template=False)

#: Kinds of files, and settings by which their bytes depend on the drawing alone: no date, no version.
_METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}

#: Lines of many things on one axes: colours from dark to light, each with a marker and dashes of its own.
MANY: tuple[dict[str, Any], ...] = tuple(
    {"color": colour, "marker": marker, "linestyle": dashes}
    for (colour, dashes), marker in zip(
        [(colour, dashes) for dashes in ("-", (0, (5, 2))) for colour in (INK, SIGNAL, "#5b8e7d", SAND, GREY)],
        "osv^<>Dx*P",
        strict=True,
    )
)

#: Look of a figure's title, in which no dollar begins a formula.
TITLE: dict[str, Any] = {"ha": "left", "fontsize": 12, "fontweight": "bold", "parse_math": False}

P = ParamSpec("P")


@contextmanager
def settings() -> Iterator[None]:
    """Context with the settings of this module instead of the user's."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_SETTINGS)
        yield


def use(*_: object) -> None:
    """Use the settings and line styles of this module for all later axes, in examples and notebooks."""
    matplotlib.rcParams.update({**_SETTINGS, "axes.prop_cycle": _CYCLE})


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Draw with the settings of this module, then restore the user's."""

    @wraps(draw)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with settings():
            return draw(*args, **kwargs)

    return wrapped


def new_figure(height: float, *, layout: Literal["constrained"] | None = "constrained") -> Figure:
    """An empty figure of the common width and a height [inch], without pyplot.

    One for a paper is as wide as its letters ask for, and lower; `save` scales it to the width of the paper.

    Parameters
    ----------
    layout : "constrained" finds room for all texts, which takes as long as drawing; None leaves it to `frame`
    """
    width = PAPER.get()[0]
    if width is not None:
        width /= PAPER_SCALE
        height *= min(1.0, math.sqrt(width / WIDTH))
        layout = "constrained"
    return Figure(figsize=(width or WIDTH, height), dpi=DPI, layout=layout)


def frame(
    figure: Figure,
    title: str,
    text: str,
    *,
    left: float = 0.82,
    right: float = 0.2,
    below: float = 0.6,
    above: float = 0.0,
    **gaps: float,
) -> None:
    """Title above and the axes below it, by margins [inch]; the caption as `caption_of` gives it.

    Parameters
    ----------
    below : room for ticks and label of the x axis
    above : further room between title and axes
    gaps : ``wspace`` and ``hspace`` between axes, in parts of their size
    """
    if PAPER.get()[0] is not None and figure.get_layout_engine() is not None:
        caption(figure, title, text)
        return
    width, height = figure.get_size_inches()
    figure.suptitle(title, x=0.1 / width, y=1.0 - 0.1 / height, va="top", **TITLE)
    figure.set_label(text)
    figure.subplots_adjust(
        left=left / width,
        right=1.0 - right / width,
        bottom=below / height,
        top=1.0 - (0.4 + above + 0.21 * len(title.splitlines())) / height,
        **gaps,
    )


def caption(figure: Figure, title: str, text: str) -> None:
    """Title above, inside the layout; the caption as `caption_of` gives it."""
    figure.suptitle(title, x=0.012, **TITLE)
    figure.set_label(text)


def caption_of(figure: Figure) -> str:
    """Caption of the figure where it is printed; it is not part of the picture."""
    return str(figure.get_label())


def label(words: str, unit: str) -> str:
    """Words and unit of an axis, in lines that fit beside it."""
    return "\n".join(textwrap.wrap(f"{words} [{unit_words(unit)}]", 44, break_on_hyphens=False))


def unit_words(unit: str) -> str:
    """A unit beside an axis: m/s², N·m, µm, and ° for deg."""
    return "°" if unit == "deg" else printed_unit(unit)


def log_ticks(axis: Axis) -> None:
    """Ticks of a logarithmic axis whose limits stand: decades, and of fewer than two decades 2 and 5 between them."""
    low, high = sorted(axis.get_view_interval())
    few = high < 100.0 * low
    axis.set_major_locator(LogLocator(10.0, subs=(1.0, 2.0, 5.0) if few else (1.0,), numticks=20))
    axis.set_major_formatter(FuncFormatter(lambda value, _: decade_words(value)))
    axis.set_minor_formatter(NullFormatter())


def decade_words(value: float) -> str:
    """A tick's number: 0.001 and 2000 in full, beyond them 2·10⁻⁵; not by mathtext, which is slow."""
    if 0.9e-3 < value < 1.1e4:
        return f"{value:g}"
    digits, _, power = f"{value:.0e}".partition("e")
    raised = str(int(power)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return f"10{raised}" if digits == "1" else f"{digits}·10{raised}"


def shade_windows(axes: Axes, windows: Iterable[tuple[float, float]], turns: Iterable[int]) -> None:
    """Shade windows of the crank angle [rad] in some turns of an axis in degrees."""
    for start, end in np.degrees(list(windows)):
        for turn in turns:
            axes.axvspan(start + 360.0 * turn, end + 360.0 * turn, color=PALE, linewidth=0, zorder=0)


def mark_angles(axes: Axes, along: NDArray[np.float64], most: int) -> None:
    """Ticks at quarters of turns, or at multiples of these, at most so many or one more, on an axis in degrees."""
    degree = 90.0 * max(1.0, np.ceil((along.max() - along.min()) / (90.0 * most)))
    axes.set_xticks(np.arange(np.ceil(along.min() / degree) * degree, along.max() + 1e-6, degree))


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
    """Write a file whose kind is that of its ending, PNG, SVG or PDF, and whose bytes depend on the drawing alone."""
    kind, drawn, (width, titles) = path.suffix.removeprefix("."), io.BytesIO(), PAPER.get()
    scale = 1.0 if width is None else PAPER_SCALE
    with settings():
        given: dict[str, Any] = {"format": kind, "metadata": _METADATA[kind]}
        if width is not None:
            _fit(figure)
        if not titles:
            figure.suptitle("")
            given["bbox_inches"] = _without_blank(figure)
        if scale == 1.0:
            figure.savefig(drawn, dpi=DPI, **given)
        elif kind == "png":
            dpi = (PAPER_DPI, PAPER_DPI)
            figure.savefig(drawn, dpi=PAPER_DPI * scale, pil_kwargs={"dpi": dpi}, **given)
        elif kind == "svg":
            figure.savefig(drawn, **given)
            size = re.compile(rb'(width|height)="([\d.]+)pt"')
            content = size.sub(lambda found: b'%s="%.6gpt"' % (found[1], scale * float(found[2])), drawn.getvalue(), 2)
            drawn = io.BytesIO(content)
        else:
            _save_pdf(figure, drawn, scale, given)
    replace_file(path, drawn.getvalue())
    return path


def _fit(figure: Figure) -> None:
    """Wrap titles and labels that are longer than their axes, and legends in as many columns as there is room for."""
    outside = (
        legend for axes in figure.axes if (legend := axes.get_legend()) and legend.get_bbox_to_anchor() is not axes.bbox
    )
    for legend in [*figure.legends, *outside]:
        handles = [handle for handle in legend.legend_handles if handle is not None]
        words = [text.get_text() for text in legend.get_texts()]
        legend.remove()
        for columns in range(len(words), 0, -1):
            legend = figure.legend(handles, words, loc="outside lower left", ncols=columns, columnspacing=1.2)
            figure.draw_without_rendering()
            if columns == 1 or legend.get_window_extent().width <= figure.bbox.width:
                break
            legend.remove()
    figure.draw_without_rendering()
    longest = [(text, figure.bbox.width * 0.97) for text in figure.texts]
    for axes in figure.axes:
        width, height = axes.bbox.size
        while sum(text.get_window_extent().width + 4 for text in axes.get_xticklabels() if text.get_text()) > width:
            axes.set(xticks=axes.get_xticks()[::2], xlim=axes.get_xlim())  # ticks beyond the limits would move them
        titles = [axes.get_title(loc=where) for where in ("left", "center", "right")]
        own = [child for child in axes.get_children() if isinstance(child, Text) and child.get_text()]
        notes = [text for text in own if text.get_text() in titles or text.get_text().count(" ") > 3]
        longest += [(axes.xaxis.label, width), (axes.yaxis.label, height), *((text, width) for text in notes)]
    for text, room in longest:
        parts = math.ceil(max(text.get_window_extent().size) / room * len(text.get_text().splitlines()))
        if parts > 1 and max(text.get_window_extent().size) > room:
            most = math.ceil(len(text.get_text()) / parts) + 2  # for words are not equally long
            text.set_text("\n".join(textwrap.wrap(text.get_text(), most, break_long_words=False)))


def _without_blank(figure: Figure) -> Bbox:
    """The figure in its whole width, without the blank above and below [inch]."""
    figure.draw_without_rendering()
    box = figure.get_tightbbox()
    return Bbox([[0.0, box.y0 - 0.05], [figure.get_figwidth(), box.y1 + 0.05]])


def _save_pdf(figure: Figure, drawn: io.BytesIO, scale: float, given: dict[str, Any]) -> None:
    """Save a PDF whose page is scaled, which matplotlib has no option for: a figure has 72 points in an inch."""
    with PdfPages(drawn, metadata=given.pop("metadata")) as pages:
        file = pages._ensure_file()
        begin = file.newPage

        def scaled(width: float, height: float) -> None:
            begin(width * scale, height * scale)
            file.width, file.height = width, height  # to which curves are cut, before they are scaled
            file.output(scale, 0.0, 0.0, scale, 0.0, 0.0, Op.concat_matrix)

        file.newPage = scaled
        figure.savefig(pages, **given)


def write_figures(
    figures: Iterable[tuple[str, Figure]], folder: Path, formats: Sequence[str], captions: str
) -> list[Path]:
    """Write figures, and their captions as a page of Markdown.

    Parameters
    ----------
    figures : names of their files, without ending, and figures
    formats : png, svg, pdf
    captions : name of the page

    Returns
    -------
    files written, the page last; none without figures
    """
    written, lines = [], []
    for name, figure in figures:
        folder.mkdir(parents=True, exist_ok=True)
        title = " ".join(figure.get_suptitle().split())
        written += [save(figure, folder / f"{name}.{kind}") for kind in formats]
        lines += [f"![{title}]({name}.{formats[0]})", "", f"**{title}.** {caption_of(figure)}".rstrip(), ""]
    if written:
        page = folder / captions
        replace_file(page, "\n".join(lines).encode())
        written.append(page)
    return written
