"""A moving picture as one HTML file that needs nothing else: no network, no server, no library.

In: the plain numbers of `animation.to_plain`.  Out: the text of a page.  ``animation.html`` says what it looks like,
``animation.js`` what it does.
"""

from __future__ import annotations

import html
import json
from collections.abc import Mapping
from importlib.resources import files
from typing import Any


def page(numbers: Mapping[str, Any]) -> str:
    """Text of the page."""
    text = json.dumps(numbers, separators=(",", ":"), allow_nan=False, ensure_ascii=False)
    parts = {
        "/*TITLE*/": html.escape(str(numbers["title"])),
        "/*SCRIPT*/": _template("animation.js"),
        "/*DATA*/": text.replace("<", "\\u003c"),  # no word of a scene ends the element
    }
    found = _template("animation.html")
    for mark, content in parts.items():
        found = found.replace(mark, content)
    return found


def _template(name: str) -> str:
    return (files(__package__) / name).read_text(encoding="utf-8")
