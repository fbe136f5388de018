"""Read tables of a scene file: every fault is noted, and reading continues.

A `Table` returns the values of its keys, and at its end reports the keys that were never read.  Where a value is
missing or wrong, a `Fault` is noted and a placeholder is handed out (NaN for a quantity), so that one pass over the
file finds all faults.  The records made of placeholders never leave `read.py`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from types import TracebackType
from typing import Any

from ballpass.derive.scene.errors import Fault
from ballpass.derive.scene.quantity import NO_LIMITS, Limits, SceneNumber
from ballpass.derive.scene.toml_lines import LineIndex
from ballpass.derive.scene.units import QuantityError, parse_quantity, show

#: Name of the body that does not move.
FRAME = "frame"
MAX_NAME = 64
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
NAME_RULE = f'a letter (a to z, A to Z), then letters, digits and "_"; at most {MAX_NAME} characters; not "{FRAME}"'

Path = tuple[str, ...]


@dataclass(slots=True, kw_only=True)
class Collector:
    """The faults found so far; `given` keeps the text of each quantity for the checks that follow."""

    lines: LineIndex
    faults: list[Fault] = field(default_factory=list)
    given: dict[str, str] = field(default_factory=dict)

    def fault(self, path: Path, problem: str, *, given: str = "", allowed: str = "", remedy: str) -> None:
        """Note a fault, with its line where the file has one."""
        self.faults.append(
            Fault(
                key=".".join(path),
                problem=problem,
                given=given,
                allowed=allowed,
                remedy=remedy,
                line=self.lines.find(path),
            )
        )

    def quantity(
        self,
        path: Path,
        given: object,
        unit: str,
        description: str = "",
        latex: str = "",
        *,
        limits: Limits = NO_LIMITS,
        wrong_dimension: str = "",
    ) -> SceneNumber:
        """Quantity from the value at `path`; NaN where that is not a quantity.

        `wrong_dimension` replaces the remedy where number and unit can be read, but measure something else.
        """
        name = ".".join(path)
        self.given[name] = show(given)
        try:
            value = parse_quantity(given, unit)
        except QuantityError as error:
            value = math.nan
            remedy = wrong_dimension if wrong_dimension and "wrong dimension" in error.problem else error.remedy
            self.fault(path, error.problem, given=error.given, allowed=error.allowed, remedy=remedy)
        return SceneNumber(path=name, value=value, unit=unit, description=description, latex=latex, limits=limits)

    def is_unit(self, path: Path, given: str, unit: str) -> bool:
        """Whether the unit of a column measures what `unit` does; noted once, at the unit, where not."""
        noted = len(self.faults)
        self.quantity(path, f"1 {given}", unit)
        return len(self.faults) == noted

    def check_name(self, path: Path, name: str, what: str) -> None:
        """Note a fault where `name` cannot be the name of a body, joint, point or force."""
        if name == FRAME:
            self.fault(
                path,
                f'"{FRAME}" is the name of the body that does not move',
                given=show(name),
                allowed=NAME_RULE,
                remedy=f"give the {what} another name",
            )
        elif len(name) > MAX_NAME or not _NAME.fullmatch(name):
            self.fault(
                path, f"this is no name for a {what}", given=show(name), allowed=NAME_RULE, remedy=f"rename the {what}"
            )


def suggest(given: object, known: Sequence[str], otherwise: str) -> str:
    """Remedy that names the nearest of `known`."""
    near = get_close_matches(str(given)[:MAX_NAME], known, n=3, cutoff=0.5)
    if not near:
        return otherwise
    return "did you mean " + " or ".join(f'"{name}"' for name in near) + "?"


def listing(names: Sequence[str]) -> str:
    """Names as a text: "a", "b"."""
    return ", ".join(show(name) for name in names) if names else "none"


def upright(name: str) -> str:
    """A name of the scene as LaTeX text."""
    escaped = name.replace("_", r"\_")
    return rf"\mathrm{{{escaped}}}"


#: Likeness from which an unknown key is a missing one, misspelt: one fault, not two.  Above that of stiffness and
#: cubic_stiffness [1].
MISSPELT = 0.76


class Table:
    """A table of the file; as a context it reports the keys that were not read.

    Parameters
    ----------
    collector : takes the faults
    path : place of the table
    data : its keys; None where the table is missing, which has been reported: then missing keys are not reported again
    """

    def __init__(self, collector: Collector, path: Path, data: dict[str, Any] | None) -> None:
        self.collector = collector
        self.path = path
        self.missing = data is None
        self.data: dict[str, Any] = data or {}
        self._written = frozenset(self.data)  # a designation adds others
        self._known: list[str] = []

    def __enter__(self) -> Table:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is not None:
            return
        for key in self.data:
            if key not in self._known:
                self._refuse_unknown(key, [known for known in self._known if known not in self._written])

    def _refuse_unknown(self, key: str, absent: Sequence[str]) -> None:
        remedy = suggest(key, absent, "delete it, or move it to the table it belongs to")
        self.fault(key, "unknown key", given=show(key), allowed=listing(self._known or absent), remedy=remedy)

    def fault(self, key: str, problem: str, *, given: str = "", allowed: str = "", remedy: str) -> None:
        """Note a fault at `key`; the empty key means the table itself."""
        path = (*self.path, key) if key else self.path
        self.collector.fault(path, problem, given=given, allowed=allowed, remedy=remedy)

    def refuse(self, keys: Iterable[str], problem: str, *, allowed: str = "", remedy: str) -> None:
        """Note a fault at each of some keys that is given although others exclude it."""
        for key in keys:
            if self.has(key):
                self.fault(key, problem, given=show(self.data[key]), allowed=allowed, remedy=remedy)

    def know(self, *keys: str) -> None:
        """These keys belong here; `correct` those that are misspelt."""
        new = [key for key in keys if key not in self._known]
        self._known += new
        self.correct(new)

    def correct(self, keys: Collection[str]) -> None:
        """Read an unknown key that is like a missing one of some keys as that, with one fault."""
        meant: dict[str, str] = {}
        missing = [key for key in keys if key not in self.data]
        for key in (key for key in self.data if key not in self._known and key not in keys):
            absent = [one for one in missing if one not in meant.values()]
            near = get_close_matches(key, absent, n=1, cutoff=MISSPELT)
            if near:
                self._refuse_unknown(key, absent)
                meant[key] = near[0]
        if meant:
            self.data = {meant.get(key, key): value for key, value in self.data.items()}

    def has(self, key: str) -> bool:
        """Whether the key is there; it belongs here from now on."""
        if key not in self._known:
            self._known.append(key)
        return key in self.data

    def names(self, what: str, example: str = "") -> list[str]:
        """All keys, where they are names that the user chooses; with an example at least one is required."""
        for key in self.data:
            self.has(key)
            self.collector.check_name((*self.path, key), key, what)
        if example and not self.missing and not self.data:
            self.fault("", f"there is no {what} here", allowed=example, remedy=f"add {example}")
        return list(self.data)

    def take(self, key: str, example: str) -> Any:
        """The value of a required key; None, with a fault, where it is missing."""
        if self.has(key):
            return self.data[key]
        if not self.missing:
            self.fault(key, "this key is missing", allowed=f"{key} = {example}", remedy=f"add {key} = {example}")
        return None

    def table(self, key: str, example: str = "", *, required: bool = True) -> Table:
        """The table at `key`."""
        path = (*self.path, key)
        if not self.has(key):
            if required and not self.missing:
                name = ".".join(path)
                self.fault(
                    key,
                    "this table is missing",
                    allowed=f"[{name}] with {example}" if example else f"[{name}]",
                    remedy=f"add the table [{name}]",
                )
            return Table(self.collector, path, None)
        data = self.data[key]
        if not isinstance(data, dict):
            self.fault(
                key,
                "this is not a table",
                given=show(data),
                allowed=f"[{'.'.join(path)}]" + (f" with {example}" if example else ""),
                remedy=f"write a table instead of {show(data, 30)}",
            )
            return Table(self.collector, path, None)
        return Table(self.collector, path, data)
