"""Derived equations for notebooks: the sections of `equations` as HTML with MathML, which browsers show themselves.

In: a `System`.  Out: HTML without script and network.
"""

from __future__ import annotations

import re

from ballpass.derive.emit.equations import HEADER, equations
from ballpass.derive.system import System
from ballpass.runtime.show import html

#: Sections that are open at first.
_OPEN = ("Equations of motion",)

#: Displayed and inline formulas of the Markdown; and their places while Markdown becomes HTML.
_FORMULA, _PLACE = re.compile(r"\$\$\n(.*?)\n\$\$|\$([^$\n]+)\$", re.DOTALL), re.compile("\ue000(\\d+)\ue001")


def equations_html(system: System) -> str:
    """All derived equations of a scene, in sections that open and close."""
    formulas: list[str] = []

    def keep(found: re.Match[str]) -> str:
        formulas.append(_mathml(found[1] or found[2], displayed=found[1] is not None))
        return f"\ue000{len(formulas) - 1}\ue001"

    text = _FORMULA.sub(keep, equations(system).removeprefix(HEADER))
    head, *sections = re.split(r"^## ", text, flags=re.MULTILINE)
    about = head.strip().partition("\n\n")[2]  # behind its title
    parts = [html.title(system.scene.title or system.scene.name, repr(system)), _rendered(about)]
    for section in sections:
        name, _, content = section.partition("\n")
        parts.append(html.folded(name, _rendered(content), opened=name.startswith(_OPEN)))
    return _PLACE.sub(lambda place: formulas[int(place[1])], html.block(*parts))


def _rendered(markdown: str) -> str:
    from markdown_it import MarkdownIt

    return str(MarkdownIt("commonmark", {"html": False}).enable("table").render(markdown))


def _mathml(latex: str, *, displayed: bool) -> str:
    """A formula; a displayed one may be wider than the page and is then moved sideways."""
    from latex2mathml.converter import convert

    text = str(convert(latex, display="block" if displayed else "inline"))
    return f'<span class="scroll formula">{text}</span>' if displayed else text
