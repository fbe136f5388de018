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


def with_spread(value: float, low: float, high: float) -> str:
    """Three digits of each."""
    return f"{value:.3g} ({low:.3g} … {high:.3g})"


def spread_of(value: dict[str, float], factor: float) -> str:
    """Median with 10th and 90th percentile, in a unit that is `factor` of them."""
    return with_spread(*(factor * value[what] for what in ("median", "p10", "p90")))
