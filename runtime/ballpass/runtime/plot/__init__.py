"""The paper's figures of a run; `gallery` draws them.  Their names are here, for they are needed without matplotlib."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

#: Names of the figures of a run, in their order.
NAMES = (
    "load_curve",
    "orbit",
    "displacements",
    "spectra",
    "phase_portrait",
    "ball_loads",
    "peak_moment",
    "shaft_loads",
)

#: Kinds of files of a moving picture.
MOVING = ("html", "mp4", "gif")

#: Kinds of files of a figure, and name of the page with the captions of a run's figures.
FORMATS = ("png", "svg", "pdf")
CAPTIONS = "figures.md"

#: Width of the figures in a paper [inch], None for the usual size; and whether they have titles.
PAPER: ContextVar[tuple[float | None, bool]] = ContextVar("PAPER", default=(None, True))


@contextmanager
def on_paper(width: float | None, *, titles: bool) -> Iterator[None]:
    """Context whose figures are drawn for a paper.

    Parameters
    ----------
    width : of the files [m], with letters of seven points; None for the usual size
    titles : whether titles are drawn
    """
    before = PAPER.set((None if width is None else width / 0.0254, titles))
    try:
        yield
    finally:
        PAPER.reset(before)
