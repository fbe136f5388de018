"""HTML of objects in notebooks: one style, no script except in framed pages, everything escaped.

In: heads and rows of text.  Out: HTML that needs nothing else, for light and dark pages.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from html import escape
from importlib.resources import files


def block(*parts: str) -> str:
    """Parts, HTML already, as one output of a notebook."""
    style = (files(__package__) / "notebook.css").read_text(encoding="utf-8")
    return f'<div class="ballpass"><style>{style}</style>{"".join(parts)}</div>'


def framed_page(page: str) -> str:
    """A whole page with its own script, in a frame that shares nothing with the notebook."""
    style = "width: 100%; height: 720px; border: 0;"
    return f'<iframe sandbox="allow-scripts" srcdoc="{escape(page)}" style="{style}"></iframe>'


def title(words: str, note: str = "") -> str:
    """A title line, and a fainter line below it."""
    return f'<p><span class="title">{escape(words)}</span></p>' + (paragraph(note) if note else "")


def paragraph(words: str) -> str:
    """A line of text."""
    return f'<p class="note">{escape(words)}</p>'


def folded(words: str, content: str, *, opened: bool = False) -> str:
    """Content, HTML already, under a line that opens and closes it."""
    state = ' open=""' if opened else ""
    return f"<details{state}><summary>{escape(words)}</summary>{content}</details>"


def table(heads: Sequence[str], rows: Iterable[Sequence[object]], *, right: Collection[str] = ()) -> str:
    """A table.

    Parameters
    ----------
    rows : of cells, shown as ``str`` shows them
    right : heads of the columns that are aligned to the right
    """
    return table_of_html(heads, ([escape(str(cell)) for cell in row] for row in rows), right)


def table_of_html(heads: Sequence[str], rows: Iterable[Sequence[str]], right: Collection[str]) -> str:
    """A table of cells that are HTML."""
    looks = [' class="number"' if name in right else "" for name in heads]
    head = "".join(f'<th scope="col"{look}>{escape(name)}</th>' for look, name in zip(looks, heads, strict=True))
    body = "".join(
        f"<tr>{''.join(f'<td{look}>{cell}</td>' for look, cell in zip(looks, row, strict=True))}</tr>" for row in rows
    )
    return f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'
