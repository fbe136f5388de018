"""Tables of the page: Markdown, numbers to the right."""

from __future__ import annotations

from collections.abc import Sequence


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Markdown table, numbers to the right."""
    marks = ["---", *("---:" for _ in head[1:])]
    return [f"| {' | '.join(cells)} |" for cells in (head, marks, *rows)]


def milliseconds(seconds: float | None) -> str:
    """Three digits, or a dash."""
    return "–" if seconds is None else f"{1e3 * seconds:.3g}"
