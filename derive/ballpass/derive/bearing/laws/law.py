"""What a damping law of a ball is: its name, its numbers in the scene file, its force.

A law is one object in one file of this folder; `LAWS` in ``__init__.py`` lists them.  Its force is an expression over
deflection and rate; slopes, switching functions, smoothness and the smoothed form follow from it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from types import MappingProxyType
from typing import ClassVar

import sympy as sp

from ballpass.derive.bearing.laws.contact import Contact, SmoothedRest
from ballpass.derive.scene.keys import Fill, QuantityKey
from ballpass.derive.scene.quantity import NOT_NEGATIVE, SceneNumber
from ballpass.derive.scene.read_keys import Either, number, read_keys
from ballpass.derive.scene.table import Table
from ballpass.derive.scene.units import check_unit


class DampingLaw(ABC):
    """A damping law at the ball.

    Attributes
    ----------
    name : what stands in the scene file
    description : one clause for people
    unit, latex, words : of the law's coefficient, a constant of a run made of its numbers
    kinked_at_rest : whether its force has a kink where the rate passes zero, which a scene may smooth
    keys, one_of : of its numbers in ``[bearing.damping]``; LAW stands for its name
    """

    name: ClassVar[str]
    description: ClassVar[str]
    unit: ClassVar[str] = "N*s/m"
    latex: ClassVar[str] = "c_b"
    words: ClassVar[str] = "Damping coefficient of a ball, Eq. (10)"
    kinked_at_rest: ClassVar[bool] = False
    keys: ClassVar[Mapping[str, QuantityKey]] = MappingProxyType({})
    one_of: ClassVar[tuple[Either, ...]] = ()

    def __init_subclass__(cls) -> None:
        for unit in (cls.unit, *(key.unit for key in cls.keys.values())):
            check_unit(unit)

    def read(self, table: Table, fill: Fill) -> tuple[SceneNumber, ...]:
        """The law's numbers out of ``[bearing.damping]``; faults are noted.

        Parameters
        ----------
        fill : texts that the rolling element puts for others, see `RollingElement.fill`
        """
        keys = {name: key.filled({"LAW": self.name, **fill}) for name, key in self.keys.items()}
        return tuple(number for number in read_keys(table, keys, self.one_of).values() if number is not None)

    @abstractmethod
    def coefficient(self, numbers: Mapping[str, sp.Expr], stiffness: sp.Expr) -> sp.Expr:
        """The coefficient from the law's numbers, by key, and the contact stiffness k_b."""

    @abstractmethod
    def force(
        self, delta: sp.Expr, rate: sp.Expr, coefficient: sp.Expr, contact: Contact, rest: SmoothedRest
    ) -> sp.Expr:
        """Damping force [N]; positive pushes the rings apart.  Zero is a law without a force."""


class ViscousLaw(DampingLaw):
    """A law whose coefficient c_b is given, or a ratio of the contact stiffness."""

    keys = MappingProxyType(
        {
            "coefficient": number(
                "N*s/m", "Damping coefficient of a ball's contacts", "c_b", "683 N*s/m", bounds=NOT_NEGATIVE
            ),
            "ratio": number(
                "s*m^0.5",
                "Ratio of damping coefficient to contact stiffness of a ball",
                r"\beta",
                "0.25e-5 s*mm^0.5",
                bounds=NOT_NEGATIVE,
                wrong_dimension='the law "LAW" multiplies k_b [N/m^1.5]: write the paper\'s number as '
                '"0.25e-5 s*mm^0.5"; for a time, as in "0.25e-5 s", name the law "tangent"',
            ),
        }
    )
    one_of = (Either(what="the coefficient", groups=(("coefficient",), ("ratio",))),)

    def coefficient(self, numbers: Mapping[str, sp.Expr], stiffness: sp.Expr) -> sp.Expr:
        return numbers["coefficient"] if "coefficient" in numbers else numbers["ratio"] * stiffness
