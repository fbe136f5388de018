"""A force on a linkage has a pathway (on which bodies it acts, along which line) and a law (how large it is).

::

    [mechanism.forces.punch]     pathway: on a point, components in the frame's axes     law: within windows of an angle
    [mechanism.springs.return]   pathway: along the line between two points              law: spring and damper

A law gives an amount.  The pathway multiplies it by its own direction, and gives what acts on each body.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

import sympy as sp

from ballpass.derive.drive import OverAngle
from ballpass.derive.mechanism.balance import AppliedLoad
from ballpass.derive.mechanism.kinematics import Ledger
from ballpass.derive.mechanism.linkage import Linkage
from ballpass.derive.scene.body_keys import Points, check_names
from ballpass.derive.scene.checker import Checker
from ballpass.derive.scene.keys import Fill
from ballpass.derive.scene.mechanism_records import Driver, Force
from ballpass.derive.scene.quantity import SceneNumber
from ballpass.derive.scene.read_keys import keys_of, read_record
from ballpass.derive.scene.table import Table, listing, upright
from ballpass.derive.terms import Definition, Smoothness
from ballpass.derive.variables import Input, Output, StateSwitch
from ballpass.runtime.contract.manifest import UsualInfo
from ballpass.runtime.contract.plugins import added

__all__ = ["Action", "ForceTable", "Law", "Measure", "Pathway", "Points", "Setting"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """The linkage that forces act in, and their derived constants, definitions, inputs and outputs.

    `requested` are outputs on request, `switched` are definitions that change with the driver's angle and that
    others use.
    """

    linkage: Linkage
    ledger: Ledger = field(default_factory=Ledger)
    constants: list[Definition] = field(default_factory=list)
    inputs: list[Input] = field(default_factory=list)
    outputs: list[Output] = field(default_factory=list)
    requested: list[Output] = field(default_factory=list)
    switched: list[Definition] = field(default_factory=list)
    smoothness: list[tuple[str, Smoothness]] = field(default_factory=list)
    switches: list[StateSwitch] = field(default_factory=list)

    def over_angle(self, found: OverAngle) -> sp.Expr:
        """Add a term that changes with the driver's angle; return its value."""
        self.constants.extend(found.constants)
        self.inputs.extend(found.inputs)
        self.switched.extend(found.definitions)
        self.smoothness.extend(found.smoothness)
        self.switches.extend(found.switches)
        return found.value


@dataclass(frozen=True, slots=True, kw_only=True)
class Measure:
    """The size of a pathway, "length" in "m" as "40 mm", and the amount that acts along it, "tension" in "N"."""

    size: str
    size_unit: str
    example: str
    amount: str
    amount_unit: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Action:
    """A pathway in its linkage.

    Attributes
    ----------
    loads : on the bodies, by an amount; what acts on the frame is left out later
    excess : of the pathway's size over a free one [m] or [rad]; None where the pathway has no size
    rate : of the size [m/s] or [rad/s]
    """

    loads: Callable[[sp.Expr], tuple[AppliedLoad, ...]]
    excess: Callable[[sp.Expr], sp.Expr] | None = None
    rate: sp.Expr | None = None


class Pathway(ABC):
    """The bodies a force acts on, and its line of action; a frozen record of the scene.

    Attributes
    ----------
    key : the key of the scene that selects it; empty for the default pathway of a table
    tables : of a plugin's, keys of the tables it may stand in
    measure : the size that a law may depend on; None where there is none
    column, unit : of a law that gives an amount, not a factor: "force" in "N"
    column_unit : of the column where it is no amount itself: "pressure" in "Pa"
    """

    __slots__ = ()
    key: ClassVar[str] = ""
    tables: ClassVar[tuple[str, ...]] = ()
    column: ClassVar[str] = "force"
    unit: ClassVar[str] = "N"
    column_unit: ClassVar[str] = ""
    measure: ClassVar[Measure | None] = None

    @classmethod
    def read(cls, data: Table, fill: Fill, points: Points, law: type[Law]) -> Self:
        """The pathway from the keys of a force's table, faults noted there."""
        found = read_record(cls, data, fill, **cls.left_out(law))
        check_names(data, found, points)
        return found

    @classmethod
    def left_out(cls, law: type[Law]) -> dict[str, Any]:
        """Fields that have no key beside a law, and their values."""
        return {}

    @classmethod
    def fill(cls, name: str, body: str) -> dict[str, str]:
        """What placeholders in the keys of a force with this pathway stand for."""
        found = {"NAME": name, "INDEX": upright(name), "BODY": body.replace("_", " "), "PLACE": f"the window of {name}"}
        found |= {
            "THE_COLUMN": cls.column.capitalize(),
            "COLUMN": cls.column,
            "COLUMN_UNIT": cls.column_unit or cls.unit,
        }
        measure = cls.measure
        if measure is not None:
            found |= {"THE_SIZE": measure.size.capitalize(), "SIZE": measure.size, "SIZE_UNIT": measure.size_unit}
            found |= {"THE_AMOUNT": measure.amount.capitalize(), "AMOUNT": measure.amount}
            found |= {"AMOUNT_UNIT": measure.amount_unit, "EXAMPLE": measure.example}
        return found

    @abstractmethod
    def act(self, force: Force, setting: Setting) -> Action:
        """Place it in the linkage."""

    def amounts(self, values: Sequence[SceneNumber], force: Force, setting: Setting) -> list[str]:
        """Names of the amounts that a column gives."""
        return [value.path for value in values]

    @abstractmethod
    def words(self) -> str:
        """Its name in texts: "force on slider.C"."""

    def usual(self, force: Force) -> Iterable[UsualInfo]:
        """Ranges in which what its motion depends on usually lies."""
        return ()


class Law(ABC):
    """How large a force is; a frozen record of the scene.

    Attributes
    ----------
    key : the key of the scene that selects it; empty for the default law
    tables : of a plugin's, keys of the tables it may stand in
    factor : it gives a factor [1] for the force or torque of the pathway, not an amount
    """

    __slots__ = ()
    key: ClassVar[str] = ""
    tables: ClassVar[tuple[str, ...]] = ()
    factor: ClassVar[bool] = False

    @classmethod
    def read(cls, data: Table, fill: Fill) -> Self:
        """The law from the keys of a force's table, faults noted there."""
        return read_record(cls, data, fill)

    @classmethod
    def inner(cls) -> type[Any] | None:
        """The record of a table, or of each of a list, at `key`; None where that is no table."""
        return None

    @abstractmethod
    def amount(self, force: Force, action: Action, setting: Setting) -> sp.Expr:
        """Factor [1], force [N] or torque [N*m]."""

    def words(self) -> str:
        """Its part of the description, after the pathway's."""
        return ""

    def check(self, checker: Checker) -> None:  # noqa: B027  most have no number that could be wrong
        """Note faults of its numbers, beyond their bounds."""

    def usual(self, driver: Driver) -> Iterable[UsualInfo]:
        """Ranges in which its numbers usually lie, beyond those of its keys."""
        return ()


@dataclass(frozen=True, slots=True)
class ForceTable:
    """A table of the scene file, ``[mechanism.<key>.<name>]``: name and example of an entry, its allowed pathways and
    laws.  An entry has the pathway and the law whose key is given, else the last one."""

    key: str
    word: str
    example: str
    own_pathways: tuple[type[Pathway], ...]
    own_laws: tuple[type[Law], ...]

    @property
    def pathways(self) -> tuple[type[Pathway], ...]:
        """With those of plugins, in front."""
        return (*(p for p in added("force_laws", Pathway, classes=True) if self.key in p.tables), *self.own_pathways)

    @property
    def laws(self) -> tuple[type[Law], ...]:
        """With those of plugins, in front."""
        return (*(law for law in added("force_laws", Law, classes=True) if self.key in law.tables), *self.own_laws)

    def read(self, data: Table, name: str, points: Points) -> Force:
        """One force of the table."""
        data.correct([*(p.key for p in self.pathways if p.key), *(law.key for law in self.laws if law.key)])
        pathway = next((p for p in self.pathways if p.key and data.has(p.key)), self.pathways[-1])
        asked = [law for law in self.laws if law.key and data.has(law.key)]
        law = asked[0] if asked else self.laws[-1]
        if len(asked) > 1:
            keys, column = [law.key for law in asked], pathway.column
            data.fault(
                keys[-1],
                f"{' and '.join(keys)} exclude each other",
                given=listing(keys),
                allowed=f"either {column} with a window, or a table",
                remedy="delete one of the two; rows of a table may be zero",
            )
            data.missing = True  # the missing keys depend on the key that stays
            law = next(law for law in asked if law.factor == (column in data.data))
        fill = pathway.fill(name, str(data.data.get("body", "")))
        if not asked and len(self.laws) > 1 and pathway.column not in data.data:  # a key of another law is not unknown
            data.know(*(key for kind in (*self.pathways, *self.laws) for key in keys_of(kind, fill)))
        return Force(name=name, table=self.key, pathway=pathway.read(data, fill, points, law), law=law.read(data, fill))
