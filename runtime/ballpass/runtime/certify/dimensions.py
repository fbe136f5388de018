"""Identities of dimensions: what derivatives by all parameters have to add up to, whatever the machine.

In: a quantity and its derivatives.  Out: `Identity`s.  A quantity y of the unit kg^a m^b s^c is multiplied by 2^a where
the unit of mass becomes half as large, and so for length and time.  Parameters p are all that it depends on, so that
Σ a_p p ∂y/∂p = a y (Euler's theorem on homogeneous functions).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ballpass.runtime.contract.units import GrammarError, unit_size

#: Names of the base units.
BASES = {"gram": "kg", "meter": "m", "second": "s"}

#: Departure that rounding and the steps leave in any case, of the largest term [1].
LEFT = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity:
    """Sum of the derivatives of a quantity by all parameters, each times the parameter and its power of a base unit.

    Attributes
    ----------
    quantity, base : names
    total, expected : the sum, and what it has to be, in the quantity's unit
    departure, stated : of one from the other, and what derivatives are uncertain by, of the largest term [1]
    """

    quantity: str
    base: str
    total: float
    expected: float
    departure: float
    stated: float

    @property
    def holds(self) -> bool:
        """Whether the departure is no more than what is stated."""
        return self.departure <= self.stated


def power(unit: str, base: str) -> float:
    """Power of a base unit in a unit; NaN for one that has none, as hours of life."""
    try:
        return float(dict(unit_size(unit).base).get(base, 0))
    except GrammarError:
        return math.nan


def identities(
    quantity: str,
    value: float,
    unit: str,
    terms: Sequence[tuple[str, float, float, float]],
    units: Mapping[str, str],
    bases: Sequence[str] = tuple(BASES),
) -> list[Identity]:
    """Identities of a quantity.

    Parameters
    ----------
    terms : of each parameter its name, its value, the derivative by it, and how uncertain that is, SI
    units : of the parameters, by name
    bases : of `BASES`, those in which nothing but parameters has a dimension
    """
    found = []
    for base in bases:
        expected = power(unit, base) * value
        powers = [power(units[name], base) for name, *_ in terms]
        parts = [a * p * slope for a, (_, p, slope, _) in zip(powers, terms, strict=True)]
        stated = sum(abs(a * p) * doubt for a, (_, p, _, doubt) in zip(powers, terms, strict=True))
        largest = max(map(abs, (*parts, expected)), default=0.0)
        if 0.0 < largest < math.inf and math.isfinite(stated):  # NaN is neither
            total = math.fsum(parts)
            found.append(
                Identity(
                    quantity=quantity,
                    base=BASES[base],
                    total=total,
                    expected=expected,
                    departure=abs(total - expected) / largest,
                    stated=max(stated / largest, LEFT),
                )
            )
    return found
