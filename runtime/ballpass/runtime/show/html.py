"""HTML of objects in notebooks: one style, no script except in framed pages, everything escaped.

In: heads and rows of text.  Out: HTML that needs nothing else, for light and dark pages.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from html import escape

#: Colours come from the notebook; rules and heads are translucent, so that they fit both a light and a dark page.
_STYLE = """
.ballpass { font-size: 0.92em; line-height: 1.4; margin: 0.3em 0; }
.ballpass .scroll { overflow-x: auto; max-width: 100%; }
.ballpass .formula { display: block; overflow-y: hidden; padding: 0.2em 0; }
.ballpass table { border-collapse: collapse; margin: 0.3em 0 0.6em; }
.ballpass table th, .ballpass table td { text-align: left !important; vertical-align: top; border: 0; }
.ballpass table th, .ballpass table td { padding: 0.15em 0.8em 0.15em 0; }
.ballpass table thead th { border-bottom: 1px solid rgba(128, 128, 128, 0.6); vertical-align: bottom; }
.ballpass table .number { text-align: right !important; font-variant-numeric: tabular-nums; white-space: nowrap; }
.ballpass table td:last-child:not(.number) { min-width: 16em; }
.ballpass .title { font-weight: 600; }
.ballpass .note { opacity: 0.75; }
.ballpass p { margin: 0.2em 0; }
.ballpass summary { cursor: pointer; font-weight: 600; }
.ballpass math { font-size: 1.1em; }
.ballpass .good { color: #2e8b57; }
.ballpass .bad { color: #d1495b; font-weight: 600; }
.ballpass .doubt { color: #b7791f; }
.ballpass .faint { opacity: 0.75; }
.ballpass .head { font-style: italic; }
"""


def block(*parts: str) -> str:
    """Parts, HTML already, as one output of a notebook."""
    return f'<div class="ballpass"><style>{_STYLE}</style>{"".join(parts)}</div>'


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
    return table_of_html(
        heads, ([escape(str(cell)) for cell in row] for row in rows), [head in right for head in heads]
    )


def table_of_html(heads: Sequence[str], rows: Iterable[Sequence[str]], right: Sequence[bool]) -> str:
    """A table of cells that are HTML."""
    looks = [' class="number"' if numbers else "" for numbers in right]
    head = "".join(f'<th scope="col"{look}>{escape(name)}</th>' for look, name in zip(looks, heads, strict=True))
    body = "".join(
        f"<tr>{''.join(f'<td{look}>{cell}</td>' for look, cell in zip(looks, row, strict=True))}</tr>" for row in rows
    )
    return f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'
