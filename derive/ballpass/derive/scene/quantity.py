"""Numbers of a scene: a quantity with its path, what bounds it, and plane vectors of quantities."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """One number of the scene, in SI.

    Attributes
    ----------
    path : dotted place in the scene file; the parameter's name
    value : magnitude in SI [unit]
    unit : SI unit as text, "kg*m^2"; "1" when dimensionless
    description : one line for people, without the unit
    latex : symbol in the derived equations
    """

    path: str
    value: float
    unit: str
    description: str
    latex: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """What a value must satisfy: > above, >= least, <= most, < below; None bounds nothing."""

    above: float | None = None
    least: float | None = None
    most: float | None = None
    below: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Vector:
    """A plane vector with as many numbers as the file gave it.

    ``zero`` has none.  ``axis`` has one, along the axis its user defines (body x axis for points,
    −y for gravity).  ``cartesian`` has x and y.  ``polar`` has a length and an angle from +x.
    """

    kind: Literal["zero", "axis", "cartesian", "polar"]
    first: Quantity | None = None
    second: Quantity | None = None

    def quantities(self) -> tuple[Quantity, ...]:
        """The numbers it is made of."""
        return tuple(q for q in (self.first, self.second) if q is not None)
