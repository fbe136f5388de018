"""Descriptions of a manifest, shortened for a column of a table."""

from __future__ import annotations

import re

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
