"""A report as HTML for notebooks."""

from __future__ import annotations

from html import escape

from ballpass.runtime.report.report import Report, ReportTable, Words
from ballpass.runtime.show import html


def to_html(report: Report) -> str:
    """One output of a notebook."""
    parts = [table_html(part) if isinstance(part, ReportTable) else _sentence(part) for part in report.parts if part]
    return html.block(html.title(report.title) if report.title else "", *parts)


def table_html(table: ReportTable) -> str:
    """A table with its title and caption."""
    rows = [[_cell(cell) for cell in (*row, *[""] * (len(table.heads) - len(row)))] for row in table.rows]
    shown = html.table_of_html(table.heads, rows, table.right)
    title = html.title(table.title) if table.title else ""
    return title + shown + (html.paragraph(table.caption) if table.caption else "")


def _sentence(words: Words) -> str:
    return html.paragraph(words.strip()) if isinstance(words, str) else f"<p>{_cell(words)}</p>"


def _cell(words: Words) -> str:
    if isinstance(words, str):
        return escape(words)
    return f'<span class="{words.look}">{escape(words.text)}</span>{escape(words.rest)}'
