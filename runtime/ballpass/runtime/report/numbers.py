"""Numbers as people read them: so many significant digits, and an exponent only where the number is long without it."""

from __future__ import annotations

#: From here on a number has an exponent.
LONG = 1e6

#: Digits from which on a number is no rough one: zeros in the place of further digits in front of the point would lie.
EXACT = 4


def rounded(value: float, digits: int = 4) -> str:
    """A number with so many significant digits, and all in front of the point where these are `EXACT` or more.

    Examples
    --------
    >>> rounded(13312.7), rounded(-0.0004567, 2), rounded(187.2, 2), rounded(2.5e9)
    ('13313', '-0.00046', '190', '2.5e+09')
    """
    text = f"{value:z.{digits}g}"
    if "e+" not in text or abs(float(text)) >= LONG:
        return text
    return f"{value if digits >= EXACT else float(text):.0f}"
