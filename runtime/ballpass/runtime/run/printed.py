"""Text of a table for ``print``: as on a terminal of a given width, without colours."""

from __future__ import annotations

import io

from rich.console import Console, RenderableType


def printed(table: RenderableType, width: int = 100) -> str:
    """`table` as plain text without blanks at the ends of lines."""
    stream = io.StringIO()
    Console(file=stream, width=width, color_system=None, force_terminal=False).print(table, highlight=False)
    return "\n".join(line.rstrip() for line in stream.getvalue().splitlines()).strip("\n")
