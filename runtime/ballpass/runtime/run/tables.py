"""Tables that `ballpass.runtime.many.ensemble` still fills row by row; its report takes their place."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from ballpass.runtime.report.html import table_html
from ballpass.runtime.report.report import ReportTable
from ballpass.runtime.report.text import table_text


class FilledTable:
    """A table that grows."""

    def __init__(self, title: str, heads: Sequence[str], right: Collection[str], caption: str) -> None:
        self._rows: list[tuple[str, ...]] = []
        self.table = ReportTable(title=title, heads=heads, rows=self._rows, right=right, caption=caption)

    def add_row(self, *cells: str) -> None:
        """Put a row below the others."""
        self._rows.append(cells)

    def as_html(self) -> str:
        """The table for a notebook."""
        return table_html(self.table)


def simple_table(title: str, heads: Sequence[str], *, right: Collection[str] = (), caption: str = "") -> FilledTable:
    """An empty table."""
    return FilledTable(title, heads, right, caption)


def printed(table: FilledTable) -> str:
    """The table as text."""
    return table_text(table.table)
