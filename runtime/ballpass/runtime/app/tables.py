"""Tables on the terminal: one look for all commands."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from rich import box
from rich.console import Console, RenderableType
from rich.table import Table


def simple_table(title: str, heads: Sequence[str], *, right: Collection[str] = (), caption: str | None = None) -> Table:
    """An empty table with a rule under its heads; columns are as wide as their content.

    Parameters
    ----------
    right : heads of the columns that are aligned to the right
    """
    table = Table(
        title=title,
        caption=caption,
        title_justify="left",
        caption_justify="left",
        header_style="bold",
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    for head in heads:
        table.add_column(head, justify="right" if head in right else "left", vertical="bottom", no_wrap=True)
    return table


def plain_table(title: str, heads: Sequence[str], *, right: Collection[str] = (), caption: str | None = None) -> Table:
    """An empty table without rules; long cells are wrapped."""
    table = Table(title=title, caption=caption, title_justify="left", caption_justify="left", box=None, pad_edge=False)
    for head in heads:
        table.add_column(head, justify="right" if head in right else "left")
    return table


def wide_console(table: RenderableType) -> Console:
    """The terminal, made as wide as the table where that is wider: a number that lost its exponent would be wrong."""
    terminal = Console(emoji=False)
    wide = Console(width=10_000).measure(table).maximum
    return Console(emoji=False, width=max(terminal.width, wide))
