"""What do the tableaus of the stepper share?  Exact figures, as printed in the source, and the check of their shapes.

A tableau is a frozen record of the coefficients of a method; it says what to compute and holds no code of a step.  See
`explicit.py` and `rosenbrock.py` for the methods.  The tests check that the figures have the orders printed for them.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import TypeAlias

from ballpass.runtime.contract.errors import BallpassError

Row: TypeAlias = tuple[Fraction, ...]
Rows: TypeAlias = tuple[Row, ...]


class TableauError(BallpassError, ValueError):
    """Rows of a tableau have too many or too few figures; all of them are listed."""


def row_of(text: str) -> Row:
    """Figures separated by blanks, as printed: decimals or quotients of integers."""
    return tuple(Fraction(figure) for figure in text.split())


def rows_of(*texts: str) -> Rows:
    """One row of figures for each text."""
    return tuple(row_of(text) for text in texts)


def require_lengths(name: str, *needed: tuple[str, Sequence[Row], Sequence[int]]) -> None:
    """Raise `TableauError` if rows of the tableau `name`, given by label, have other lengths than needed."""
    faults = [
        f"\n  {label}: rows of {found} figures, needed {list(lengths)}"
        for label, rows, lengths in needed
        if (found := [len(row) for row in rows]) != list(lengths)
    ]
    if faults:
        raise TableauError(f"tableau {name}:{''.join(faults)}\n  remedy: compare the figures with the source")
