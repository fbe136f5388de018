"""A page that draws a run, as one HTML file that needs nothing else: no network, no server, no library.

In: the plain numbers of `animation.to_plain`.  Out: the text of a page.  ``animation.html`` and ``explore.html`` are
pages; ``pictures.html``, ``.css`` and ``.js`` are what both show of a run, how it looks and how it moves.
"""

from __future__ import annotations

import html
import json
from collections.abc import Mapping
from importlib.resources import files
from typing import Any, Literal


def page(numbers: Mapping[str, Any], kind: Literal["animation", "explore"] = "animation") -> str:
    """Text of the page."""
    text = json.dumps(numbers, separators=(",", ":"), allow_nan=False, ensure_ascii=False)
    parts = {
        "/*STYLE*/": _template("pictures.css").rstrip(),
        "/*PICTURES*/": _template("pictures.html").rstrip(),
        "/*SCRIPT*/": _template("pictures.js"),
        "/*TITLE*/": html.escape(str(numbers["title"])),
        "/*DATA*/": text.replace("<", "\\u003c"),  # no word of a scene ends the element
    }
    if kind == "explore":
        parts["/*SCRIPT*/"] += _template("solver.js") + _template("explore.js")
    found = _template(f"{kind}.html")
    for mark, content in parts.items():
        found = found.replace(mark, content)
    return found


def _template(name: str) -> str:
    return (files(__package__) / name).read_text(encoding="utf-8")
