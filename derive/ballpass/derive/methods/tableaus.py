"""What do the tableaus of the stepper share?  Exact figures, their checks, and the nested form of dense output.

A tableau is a frozen record of the coefficients of a method; it says what to compute and holds no code of a step.
Figures are `fractions.Fraction`, exactly as printed in the source.  Making a record checks shapes, row sums, the order
conditions of solution, error estimate and dense output, and, for linearly implicit methods, stiff accuracy and damping
at infinity.  A wrong digit raises `TableauError`.  All records together take about 10 ms.

See `explicit_tableaus.py` and `rosenbrock_tableaus.py` for the methods, `order_conditions.py` for the mathematics.
"""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal, localcontext
from fractions import Fraction
from typing import TypeAlias

from ballpass.derive.methods.order_conditions import PRECISION, Figures
from ballpass.runtime.contract.errors import BallpassError

Row: TypeAlias = tuple[Fraction, ...]
Rows: TypeAlias = tuple[Row, ...]


class TableauError(BallpassError, ValueError):
    """The coefficients of a method do not have the properties its record claims; all faults are listed."""


class CheckedTableau:
    """A record of coefficients that raises `TableauError` when it is made and claims what does not hold."""

    __slots__ = ()
    name: str

    def __post_init__(self) -> None:
        require_no_faults(self.name, self._shape_faults())
        with localcontext() as context:
            context.prec = PRECISION
            require_no_faults(self.name, self._order_faults())

    def _shape_faults(self) -> list[str]:
        """Rows that are too long or too short."""
        raise NotImplementedError

    def _order_faults(self) -> list[str]:
        """Conditions of the claimed orders that do not hold, in decimals of `PRECISION` digits."""
        raise NotImplementedError


def row_of(text: str) -> Row:
    """Figures separated by blanks, as printed: decimals or quotients of integers."""
    return tuple(Fraction(figure) for figure in text.split())


def rows_of(*texts: str) -> Rows:
    """One row of figures for each text."""
    return tuple(row_of(text) for text in texts)


def require_no_faults(name: str, faults: Sequence[str]) -> None:
    """Raise one `TableauError` that lists `faults` of the tableau `name`, if there are any."""
    if faults:
        listed = "\n".join(f"  {fault}" for fault in faults)
        count = "1 claim does not hold" if len(faults) == 1 else f"{len(faults)} claims do not hold"
        raise TableauError(
            f"tableau {name}: {count}\n{listed}\n"
            "  allowed: what the rounding of the printed figures leaves\n"
            "  remedy: compare the figures with the source, or claim less"
        )


def shape_faults(label: str, rows: Rows, lengths: Sequence[int]) -> list[str]:
    """A fault if the rows have other lengths than needed."""
    found = [len(row) for row in rows]
    return [] if found == list(lengths) else [f"{label}: rows of {found} figures, needed {list(lengths)}"]


def row_sum_faults(label: str, matrix: Figures, sums: Figures, tolerance: Decimal) -> list[str]:
    """Rows of `matrix` that do not add up to `sums`: the stage would see the wrong time."""
    return [
        f"{label} {row}: the sum is off by {difference:.1e}"
        for row, difference in enumerate(matrix.sum(axis=1) - sums, start=1)
        if abs(difference) > tolerance
    ]


def nested_powers(terms: Sequence[Row], by_theta: Sequence[bool]) -> Rows:
    """Weights of the powers of theta in a nested polynomial.

    Parameters
    ----------
    terms : T0, T1, ... of ``theta (T0 + g1 (T1 + g2 (T2 + ...)))``, each of shape (n,)
    by_theta : for g1, g2, ...: theta if true, ``1 - theta`` if not

    Returns
    -------
    row k are the weights of ``theta**(k + 1)``; shape (number of terms, n)
    """
    factor: Row = (Fraction(0), Fraction(1))
    factors = [factor]
    for theta in by_theta:
        raised = (Fraction(0), *factor)
        factor = raised if theta else tuple(a - b for a, b in zip((*factor, Fraction(0)), raised, strict=True))
        factors.append(factor)
    pairs = list(zip(factors, terms, strict=True))
    return tuple(
        tuple(
            sum((factor[power] * term[column] for factor, term in pairs if power < len(factor)), Fraction(0))
            for column in range(len(terms[0]))
        )
        for power in range(1, len(terms) + 1)
    )
