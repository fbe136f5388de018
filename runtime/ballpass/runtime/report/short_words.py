"""Descriptions and names of a manifest, shortened for a column of a table."""

from __future__ import annotations

import re
from collections.abc import Mapping

#: Characters of a column's head in one line.
HEAD = 13

#: What shortens a description, in this order.
_SHORTER = (
    (r"^(Force|Moment) of the \S+ on the ", r"\1 on the "),
    (r"^Position of the centre of the ", ""),
    (r"^Velocity of the centre of the ", "Velocity of the "),
    (r"^Torque of the drive.*", "Torque of the drive"),
    (r"^External load on", "Load on"),
    (r"(, r_b/.*)?, Eq\. .*", ""),
    (r", counter-clockwise$", ""),
    (r" along (x|y)$", r", \1"),
)


def short_words(description: str) -> str:
    """A description of a state, an output or a constant in few words.

    Examples
    --------
    >>> short_words("Position of the centre of the inner ring along x")
    'Inner ring, x'
    """
    for pattern, short in _SHORTER:
        description = re.sub(pattern, short, description)
    return description[:1].upper() + description[1:]


def names_in_words(described: Mapping[str, str]) -> str:
    """Names of a table and what each is, as one sentence below it.

    Examples
    --------
    >>> names_in_words({"inner.x": "Position of the centre of the inner ring along x"})
    'inner.x: inner ring, x'
    """
    words = ((name, short_words(description)) for name, description in described.items())
    return "; ".join(f"{name}: {short[:1].lower()}{short[1:]}" for name, short in words)


def head_lines(name: str) -> str:
    """A long name in several lines, broken behind its signs, as the head of a column.

    Examples
    --------
    >>> head_lines("free_end.inner.x")
    'free_end.\ninner.x'
    """
    lines = [""]
    for part in re.split(r"(?<=[._:])", name):
        lines = [*lines[:-1], lines[-1] + part] if len(lines[-1] + part) <= HEAD else [*lines, part]
    return "\n".join(filter(None, lines))
