"""What a damping law of a ball is: its name, its numbers in the scene file, its force.

A law is one object in one file of this folder; `LAWS` in ``__init__.py`` lists them.  Its force is an expression over
deflection and rate; slopes, switching functions, smoothness and the smoothed form follow from it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, ClassVar

from ballpass.derive.scene.quantity import Bounds, Quantity
from ballpass.derive.scene.schema import Table
from ballpass.derive.scene.units import show

if TYPE_CHECKING:
    import sympy as sp

    from ballpass.derive.bearing.laws.contact import Contact, Rest


class DampingLaw(ABC):
    """A damping law at the ball.

    Attributes
    ----------
    name : what stands in the scene file
    description : one clause for people
    unit, latex, words : of the law's coefficient, a constant of a run made of its numbers
    kinked_at_rest : whether its force has a kink where the rate passes zero, which a scene may smooth
    """

    name: ClassVar[str]
    description: ClassVar[str]
    unit: ClassVar[str] = "N*s/m"
    latex: ClassVar[str] = "c_b"
    words: ClassVar[str] = "Damping coefficient of a ball, Eq. (10)"
    kinked_at_rest: ClassVar[bool] = False

    @abstractmethod
    def read(self, table: Table) -> tuple[Quantity, ...]:
        """The law's numbers out of ``[bearing.damping]``; faults are noted."""

    @abstractmethod
    def coefficient(self, numbers: Mapping[str, sp.Expr], stiffness: sp.Expr) -> sp.Expr:
        """The coefficient from the law's numbers, by key, and the contact stiffness k_b [N/m^1.5]."""

    @abstractmethod
    def force(self, delta: sp.Expr, rate: sp.Expr, coefficient: sp.Expr, contact: Contact, rest: Rest) -> sp.Expr:
        """Damping force [N]; positive pushes the rings apart.  Zero is a law without a force."""

    def bounds(self, key: str) -> Bounds:
        """What a number of the law must satisfy."""
        del key
        return Bounds(least=0.0)


def coefficient_or_ratio(table: Table, law: str) -> tuple[Quantity, ...]:
    """One of ``coefficient`` c_b [N*s/m] and ``ratio`` c_b/k_b [s*m^0.5]."""
    table.know("coefficient", "ratio")
    present = [key for key in ("coefficient", "ratio") if key in table.data]
    if len(present) != 1:
        table.fault(
            "",
            "the coefficient is given twice" if present else "the coefficient is missing",
            given=" and ".join(f"{key} = {show(table.data[key])}" for key in present) or "neither",
            allowed='either coefficient (as in "683 N*s/m") or ratio (as in "0.25e-5 s*mm^0.5")',
            remedy="delete one of the two" if present else 'add coefficient = "683 N*s/m", or a ratio',
        )
    numbers = []
    if "coefficient" in present:
        words = "Damping coefficient of a ball's contacts"
        numbers.append(table.quantity("coefficient", "N*s/m", words, "c_b", example="683 N*s/m"))
    if "ratio" in present:
        numbers.append(
            table.quantity(
                "ratio",
                "s*m^0.5",
                "Ratio of damping coefficient to contact stiffness of a ball",
                r"\beta",
                example="0.25e-5 s*mm^0.5",
                wrong_dimension=f'the law "{law}" multiplies k_b [N/m^1.5]: write the paper\'s number as '
                '"0.25e-5 s*mm^0.5"; for a time, as in "0.25e-5 s", name the law "tangent"',
            )
        )
    return tuple(numbers)


class ViscousLaw(DampingLaw):
    """A law whose coefficient c_b is given, or a ratio of the contact stiffness."""

    def read(self, table: Table) -> tuple[Quantity, ...]:
        return coefficient_or_ratio(table, self.name)

    def coefficient(self, numbers: Mapping[str, sp.Expr], stiffness: sp.Expr) -> sp.Expr:
        return numbers["coefficient"] if "coefficient" in numbers else numbers["ratio"] * stiffness
