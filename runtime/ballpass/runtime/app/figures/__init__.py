"""The paper's figures of a run: `draw_all` writes those for which the outputs exist."""

from ballpass.runtime.app.figures.gallery import FIGURES, FigureKind, draw, draw_all

__all__ = ["FIGURES", "FigureKind", "draw", "draw_all"]
