"""Numbers as people read them: so many significant digits, and an exponent only where the number is long without it."""

from __future__ import annotations

#: From here on a number has an exponent.
LONG = 1e6


def rounded(value: float, digits: int = 4) -> str:
    """A number with so many significant digits: "13 310" of 13 312.7 is written 13310, not 1.331e+04.

    Examples
    --------
    >>> rounded(13312.7), rounded(-0.0004567, 2), rounded(187.2, 2), rounded(2.5e9)
    ('13310', '-0.00046', '190', '2.5e+09')
    """
    text = f"{value:z.{digits}g}"
    return f"{float(text):.0f}" if "e+" in text and abs(float(text)) < LONG else text
