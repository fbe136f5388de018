"""The line of each key in a TOML text.

In: text that `tomllib` has read.  Out: line numbers by path, for the messages.  Because the text is known to be valid,
it is enough to follow strings, comments and brackets; nothing is read a second time.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import islice

from ballpass.derive.scene.errors import Fault

_HEADER = re.compile(r"\s*(\[\[?)([^\[\]]*?)\]\]?\s*(?:#.*)?$")
_KEY = re.compile(r"""\s*((?:"[^"]*"|'[^']*'|[A-Za-z0-9_-]+)(?:\s*\.\s*(?:"[^"]*"|'[^']*'|[A-Za-z0-9_-]+))*)\s*=""")
#: Keys of a dotted path that are indexed; no key of a scene lies deeper.
_DEEPEST = 16
#: A key of more parts than that, anywhere in a text.  The lookbehind lets a search begin at whole parts only, so that
#: it takes linear time.
_TOO_DEEP = re.compile(
    r"""(?<![A-Za-z0-9_"'-])(?:(?:"[^"\n]{0,80}"|'[^'\n]{0,80}'|[A-Za-z0-9_-]++)[ \t]*+\.[ \t]*+){64}"""
)
_PART = re.compile(r""""([^"]*)"|'([^']*)'|([A-Za-z0-9_-]+)""")


@dataclass(frozen=True, slots=True, kw_only=True)
class LineIndex:
    """Lines of tables and keys, counted from 1; elements of arrays of tables are counted from 1 too."""

    lines: dict[tuple[str, ...], int]

    def place(self, faults: Iterable[Fault]) -> list[Fault]:
        """Faults with their lines, in the order of the file; those of the whole file first."""
        placed = [
            fault if fault.line else replace(fault, line=self.find(tuple(fault.key.split(".")))) for fault in faults
        ]
        return sorted(placed, key=lambda fault: fault.line or 0)

    def find(self, path: tuple[str, ...]) -> int | None:
        """Line of the key, or else of the innermost table around it; None where the file names none of them."""
        for length in range(len(path), 0, -1):
            if path[:length] in self.lines:
                return self.lines[path[:length]]
        return None


def deep_key(text: str) -> int | None:
    """Line of the first key with more than 64 dots, None where there is none.

    The time `tomllib` takes for a key grows with the square of its parts: a file of one key could take hours.
    """
    found = _TOO_DEEP.search(text)
    return None if found is None else text.count("\n", 0, found.start()) + 1


def index_lines(text: str) -> LineIndex:
    """Index the keys and table headers of a valid TOML text."""
    lines: dict[tuple[str, ...], int] = {}
    elements: dict[tuple[str, ...], int] = {}
    table: tuple[str, ...] = ()
    state = _LineState()
    for number, line in enumerate(text.split("\n"), start=1):
        if state.at_statement():
            header, key = _HEADER.match(line), _KEY.match(line)
            if header is not None:
                table = _element(_parts(header.group(2)), elements)
                if header.group(1) == "[[":
                    elements[table] = elements.get(table, 0) + 1
                    lines.setdefault(table, number)
                    table = (*table, str(elements[table]))
                lines.setdefault(table, number)
                continue
            if key is not None:
                path = table
                for part in _parts(key.group(1)):
                    path = (*path, part)
                    lines.setdefault(path, number)
        state.follow(line)
    return LineIndex(lines=lines)


def _parts(dotted: str) -> tuple[str, ...]:
    parts = (next(group for group in match.groups() if group is not None) for match in _PART.finditer(dotted))
    return tuple(islice(parts, _DEEPEST))


def _element(path: tuple[str, ...], elements: dict[tuple[str, ...], int]) -> tuple[str, ...]:
    """Path with the number of the current element behind each array of tables that it passes through."""
    inside: tuple[str, ...] = ()
    for position, part in enumerate(path):
        inside = (*inside, part)
        if inside in elements and position < len(path) - 1:
            inside = (*inside, str(elements[inside]))
    return inside


@dataclass(slots=True)
class _LineState:
    """Open elements at the end of a line: brackets of arrays and inline tables, or a multi-line string."""

    depth: int = 0
    quote: str = ""

    def at_statement(self) -> bool:
        return self.depth == 0 and not self.quote

    def follow(self, line: str) -> None:
        position = 0
        while position < len(line):
            if self.quote:
                if self.quote[0] == '"' and line[position] == "\\":
                    position += 2
                elif line.startswith(self.quote, position):
                    position += len(self.quote)
                    self.quote = ""
                else:
                    position += 1
                continue
            character = line[position]
            if character == "#":
                return
            if character in "\"'":
                self.quote = character * 3 if line.startswith(character * 3, position) else character
                position += len(self.quote)
                continue
            self.depth += (character in "[{") - (character in "]}")
            position += 1
