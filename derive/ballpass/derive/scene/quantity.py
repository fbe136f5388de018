"""Numbers of a scene: a quantity with its path and bounds, and plane vectors of quantities."""

from __future__ import annotations

import operator
from dataclasses import dataclass, field
from typing import Literal


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """Bounds of a value: > above, >= least, <= most, < below; None bounds nothing."""

    above: float | None = None
    least: float | None = None
    most: float | None = None
    below: float | None = None

    def __str__(self) -> str:
        if self in (POSITIVE, NOT_NEGATIVE):
            return "above zero" if self == POSITIVE else "zero or above"
        ends = ((self.above, "above"), (self.least, "from"), (self.most, "up to"), (self.below, "below"))
        return " ".join(f"{words} {bound:g}" for bound, words in ends if bound is not None)

    @property
    def allowed(self) -> str:
        """The allowed values."""
        return "zero or a value above it" if self == NOT_NEGATIVE else f"a value {self}"

    def problem(self, value: float) -> str:
        """Fault of a value; empty where there is none, and for NaN."""
        checks = (
            (self.above, operator.le),
            (self.least, operator.lt),
            (self.most, operator.gt),
            (self.below, operator.ge),
        )
        if not any(bound is not None and wrong(value, bound) for bound, wrong in checks):
            return ""
        if self not in (POSITIVE, NOT_NEGATIVE):
            return "the value is out of its bounds"
        return "the value is zero" if value == 0.0 else "the value is negative"


POSITIVE, NOT_NEGATIVE = Bounds(above=0.0), Bounds(least=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class UsualRange:
    """Where a number usually lies: itself, or over the amount of the nearest number `of`, in a table around it."""

    least: float | None = None
    most: float | None = None
    of: str = ""
    hint: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits of the values of a key: bounds, remedy beyond them, usual range."""

    bounds: Bounds | None = None
    remedy: str = ""
    usual: UsualRange | None = None

    @property
    def advice(self) -> str:
        """Remedy where a value is out of its bounds."""
        words = {POSITIVE: "give a positive value", NOT_NEGATIVE: "give zero or a positive value"}
        return self.remedy or words.get(self.bounds or POSITIVE, "correct the value")


NO_LIMITS = Limits()
#: Limits of a length in polar form.
AMOUNT = Limits(bounds=NOT_NEGATIVE, remedy="give the amount, and turn the angle by 180 deg")


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneNumber:
    """One number of the scene, in SI.

    Attributes
    ----------
    path : dotted place in the scene file; the parameter's name
    value : magnitude in SI [unit]
    unit : SI unit as text, "kg*m^2"; "1" when dimensionless
    description : one line, without the unit
    latex : symbol in the derived equations
    limits : of its value, by the declaration of its key
    """

    path: str
    value: float
    unit: str
    description: str
    latex: str
    limits: Limits = field(default=NO_LIMITS, compare=False, repr=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Vector:
    """A plane vector with as many numbers as the file gave it.

    ``zero`` has none.  ``axis`` has one, along the axis its user defines (body x axis for points,
    −y for gravity).  ``cartesian`` has x and y.  ``polar`` has a length and an angle from +x.
    """

    kind: Literal["zero", "axis", "cartesian", "polar"]
    first: SceneNumber | None = None
    second: SceneNumber | None = None
