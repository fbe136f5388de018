"""Tables as text: one look, names and numbers always whole.

In: titles, heads, cells.  Out: a table of Rich; its text for `print`, or on standard output.

A name or a number is never cut or broken.  A table wider than the terminal is printed in blocks of columns below each
other, the first columns in each; elsewhere, as in a pipe or a file, it is as wide as it must be.
"""

from __future__ import annotations

import io
from collections.abc import Collection, Iterator, Sequence

from rich import box
from rich.console import Console, Group, JustifyMethod, RenderableType
from rich.markup import escape
from rich.table import Column, Table
from rich.text import Text

#: Columns of text where no terminal says how many.
WIDTH = 80

#: Measures what cells take.
_WIDE = Console(width=10_000, emoji=False)


def simple_table(
    title: str,
    heads: Sequence[str],
    *,
    right: Collection[str] = (),
    wrapped: Collection[str] = (),
    caption: str | None = None,
) -> Table:
    """An empty table with a rule under its heads.

    Parameters
    ----------
    title, caption : plain text; heads and cells are Rich's markup
    right : heads of the columns that are aligned to the right
    wrapped : heads of the columns of sentences, which take several lines where there is no room; others never do
    """
    table = _empty(escape(title), None if caption is None else escape(caption))
    for head in heads:
        justify: JustifyMethod = "right" if head in right else "left"
        table.add_column(head, justify=justify, no_wrap=head not in wrapped)
    return table


def _empty(title: str | None = None, caption: str | None = None) -> Table:
    return Table(
        title=title,
        caption=caption,
        title_justify="left",
        caption_justify="left",
        header_style="bold",
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )


def printed(shown: RenderableType, width: int = WIDTH) -> str:
    """Text of tables and sentences without colours, and without blanks at the ends of lines."""
    stream = io.StringIO()
    _print(shown, Console(file=stream, width=width, color_system=None, force_terminal=False, emoji=False))
    return "\n".join(line.rstrip() for line in stream.getvalue().splitlines()).strip("\n")


def show_tables(*shown: RenderableType) -> None:
    """Print tables and sentences on standard output."""
    console = Console(emoji=False)
    if console.is_terminal:
        _print(Group(*shown), console)
    else:
        print(printed(Group(*shown)))


def _print(shown: RenderableType, console: Console) -> None:
    width = console.width
    for part in _parts(shown):
        if not isinstance(part, Table):
            console.print(part, highlight=False)
            continue
        if part.title:
            console.print(Text.from_markup(str(part.title), style="italic", emoji=False), highlight=False)
        for block in _blocks(part, console):
            # wider only where a block cannot be narrower, or where there is no terminal to wrap it
            console.width = max(width, _least_width(block))
            console.print(block, highlight=False)
            console.width = width
        if part.caption:
            console.print(Text.from_markup(str(part.caption), style="dim italic", emoji=False), highlight=False)


def _parts(shown: RenderableType) -> Iterator[RenderableType]:
    if isinstance(shown, Group):
        for part in shown.renderables:
            yield from _parts(part)
    else:
        yield shown


def _blocks(table: Table, console: Console) -> Iterator[Table]:
    """The table without title and caption, in parts that fit the terminal, each with the columns that name the rows."""
    columns = table.columns
    names = next((k for k, column in enumerate(columns) if column.justify == "right"), 1) or 1
    chosen = columns[:names]
    for column in columns[names:]:
        wider = _of_columns(table, [*chosen, column])
        if console.is_terminal and len(chosen) > names and _least_width(wider) > console.width:
            yield _of_columns(table, chosen)
            chosen = columns[:names]
        chosen = [*chosen, column]
    yield _of_columns(table, chosen)


def _of_columns(table: Table, columns: Sequence[Column]) -> Table:
    part = _empty()
    for column in columns:
        # a column that must not wrap would be cut where the table has no room
        least = max(_WIDE.measure(cell).maximum for cell in (column.header, *column.cells)) if column.no_wrap else None
        part.add_column(column.header, justify=column.justify, no_wrap=column.no_wrap, min_width=least)
    for row, cells in zip(table.rows, zip(*(column.cells for column in columns), strict=True), strict=True):
        part.add_row(*cells, style=row.style, end_section=row.end_section)
    return part


def _least_width(table: Table) -> int:
    """Columns of text that it takes with every name and number whole, and sentences broken at blanks."""
    return _WIDE.measure(table).minimum
