"""A report as text of 80 columns, or as wide as the terminal: one style, names and numbers always whole.

A name or a number is never cut or broken.  A table wider than that is printed in blocks of columns below each other,
the first columns in each.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence

from rich import box
from rich.console import Console, JustifyMethod
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from ballpass.runtime.contract.errors import printable
from ballpass.runtime.report.report import Marked, Report, ReportTable, Words

#: Columns of text without a terminal.
WIDTH = 80

#: Measures the width of cells.
_WIDE = Console(width=10_000, emoji=False)

#: Styles of the terminal, by what marked text means.
_STYLES = {"good": "green", "bad": "bold red", "doubt": "yellow", "faint": "dim", "head": "italic"}


def to_text(report: Report, width: int = WIDTH) -> str:
    """Text without colours, and without blanks at the ends of lines."""
    stream = io.StringIO()
    _print(report, Console(file=stream, width=width, color_system=None, force_terminal=False, emoji=False))
    return "\n".join(line.rstrip() for line in stream.getvalue().splitlines()).strip("\n")


def show(report: Report) -> None:
    """Print a report on standard output."""
    console = Console(emoji=False)
    if console.is_terminal:
        _print(report, console)
    else:
        print(to_text(report))


def _print(report: Report, console: Console) -> None:
    if report.title:
        console.print(_plain(report.title, "bold"), highlight=False)
    for part in report.parts:
        if isinstance(part, ReportTable):
            _print_table(part, console)
        else:
            text = _text(part)
            indent = len(text.plain) - len(text.plain.lstrip())
            console.print(Padding(text[indent:], (0, 0, 0, indent)) if indent else text, highlight=False)


def _print_table(table: ReportTable, console: Console) -> None:
    width = console.width
    if table.title:
        console.print(_plain(table.title, "italic"), highlight=False)
    for block in _blocks(table, console):
        # wider only where a block cannot be narrower
        console.width = max(width, _least_width(block))
        console.print(block, highlight=False)
        console.width = width
    if table.caption:
        console.print(_plain(table.caption, "dim italic"), highlight=False)


def _blocks(table: ReportTable, console: Console) -> Iterator[Table]:
    """The table without title and caption, in parts that fit the terminal, each with the columns that name the rows."""
    columns = range(len(table.heads))
    names = next((k for k in columns if table.heads[k] in table.right), 1) or 1
    chosen = list(columns[:names])
    for column in columns[names:]:
        wider = _of_columns(table, [*chosen, column])
        if len(chosen) > names and _least_width(wider) > console.width:
            yield _of_columns(table, chosen)
            chosen = list(columns[:names])
        chosen = [*chosen, column]
    yield _of_columns(table, chosen)


def _of_columns(table: ReportTable, columns: Sequence[int]) -> Table:
    part = Table(header_style="bold", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    cells = [[_text(row[k] if k < len(row) else "") for k in columns] for row in table.rows]
    for place, k in enumerate(columns):
        head = table.heads[k]
        justify: JustifyMethod = "right" if head in table.right else "left"
        whole = head not in table.wrapped
        # a column that must not wrap would be cut where the table has no room
        least = max(_WIDE.measure(cell).maximum for cell in (_plain(head), *(row[place] for row in cells)))
        part.add_column(_plain(head), justify=justify, no_wrap=whole, min_width=least if whole else None)
    for number, row in enumerate(cells):
        part.add_row(*row, end_section=number + 1 in table.sections)
    return part


def _text(words: Words) -> Text:
    if isinstance(words, Marked):
        return _plain(words.text, _STYLES[words.look]).append_text(_plain(words.rest))
    return _plain(words)


def _plain(text: str, style: str = "") -> Text:
    return Text(printable(text), style=style)


def _least_width(table: Table) -> int:
    """Columns of text that it takes with every name and number whole, and sentences broken at blanks."""
    return _WIDE.measure(table).minimum
