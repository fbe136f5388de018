"""Reading tables of a scene file: every fault is noted, reading goes on.

A `Table` hands out what its keys hold and knows at its end which keys nobody asked for.  Where a value is missing or
wrong, a `Fault` is noted and a placeholder is handed out (NaN for a quantity), so that one pass over the file finds all
faults.  The records made of placeholders never leave `read.py`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from types import TracebackType
from typing import Any, TypeVar

from ballpass.derive.scene.errors import Fault
from ballpass.derive.scene.quantity import Quantity, Vector
from ballpass.derive.scene.records import FRAME
from ballpass.derive.scene.toml_lines import LineIndex
from ballpass.derive.scene.units import QuantityError, parse_quantity, show

MAX_NAME = 64
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
NAME_RULE = f'a letter (a to z, A to Z), then letters, digits and "_"; at most {MAX_NAME} characters; not "{FRAME}"'

Path = tuple[str, ...]
Choice = TypeVar("Choice", bound=str)


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
        self, path: Path, given: object, unit: str, description: str, latex: str, *, wrong_dimension: str = ""
    ) -> Quantity:
        """Quantity from what stands at `path`; its value is NaN where that is none.

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
        return Quantity(path=name, value=value, unit=unit, description=description, latex=latex)

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
    """Names as people read them: "a", "b"."""
    return ", ".join(show(name) for name in names) if names else "none"


@dataclass(frozen=True, slots=True, kw_only=True)
class VectorWords:
    """Description and symbols of a vector's numbers.

    `what` goes behind "x component of"; `axis` is the description of the form with one number, empty where that form is
    not allowed.  `latex` holds the symbols of axis, x, y, length and angle.
    """

    what: str
    axis: str = ""
    latex: tuple[str, str, str, str, str]
    polar: tuple[str, str] = ("distance", "angle")
    origin: bool = False

    def forms(self, unit: str) -> str:
        """The forms that may stand in the file."""
        sample = {"m": ("6 mm", "2 mm"), "N": ("0 N", "196 N")}.get(unit, (f"0 {unit}", f"9.81 {unit}"))
        forms = ['"origin"'] if self.origin else []
        if self.axis:
            forms.append(f'"{sample[0]}"')
        forms.append(f'["{sample[0]}", "{sample[1]}"]')
        forms.append(f'{{ {self.polar[0]} = "{sample[1]}", {self.polar[1]} = "30 deg" }}')
        return ", ".join(forms[:-1]) + " or " + forms[-1]


def words_of_force(what: str, symbol: str, index: str = "") -> VectorWords:
    """Words of a force: no single number, because nothing says along which axis it would act."""
    comma = "," if index else ""
    return VectorWords(
        what=what,
        latex=(
            "",
            f"{symbol}_{{{index}{comma}x}}",
            f"{symbol}_{{{index}{comma}y}}",
            f"{symbol}_{{{index}}}" if index else symbol,
            rf"\alpha_{{{index or symbol}}}",
        ),
        polar=("magnitude", "direction"),
    )


def upright(name: str) -> str:
    """A name of the scene as LaTeX text."""
    escaped = name.replace("_", r"\_")
    return rf"\mathrm{{{escaped}}}"


class Table:
    """A table of the file; as a context it reports the keys nobody asked for.

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
        self._known: list[str] = []

    def __enter__(self) -> Table:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.report_unknown()

    def report_unknown(self) -> None:
        """Note a fault for every key that was not asked for."""
        absent = [key for key in self._known if key not in self.data]
        for key in self.data:
            if key not in self._known:
                self.fault(
                    key,
                    "unknown key",
                    given=show(key),
                    allowed=listing(self._known),
                    remedy=suggest(key, absent, "delete it, or move it to the table it belongs to"),
                )

    def fault(self, key: str, problem: str, *, given: str = "", allowed: str = "", remedy: str) -> None:
        """Note a fault at `key`; the empty key means the table itself."""
        path = (*self.path, key) if key else self.path
        self.collector.fault(path, problem, given=given, allowed=allowed, remedy=remedy)

    def know(self, *keys: str) -> None:
        """These keys belong here."""
        self._known.extend(key for key in keys if key not in self._known)

    def has(self, key: str) -> bool:
        """Whether the key is there; it belongs here from now on."""
        self.know(key)
        return key in self.data

    def names(self, what: str) -> list[str]:
        """All keys, where they are names the user chooses."""
        for key in self.data:
            self.know(key)
            self.collector.check_name((*self.path, key), key, what)
        return list(self.data)

    def take(self, key: str, example: str) -> Any:
        """What stands at a required key; None, with a fault, where nothing does."""
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

    def quantity(
        self,
        key: str,
        unit: str,
        description: str,
        latex: str,
        *,
        example: str,
        default: str | None = None,
        wrong_dimension: str = "",
    ) -> Quantity:
        """The quantity at `key`; without `default` it is required."""
        path = (*self.path, key)
        if not self.has(key):
            if default is None:
                self.take(key, example if unit == "1" else f'"{example}"')
                return Quantity(path=".".join(path), value=math.nan, unit=unit, description=description, latex=latex)
            return self.collector.quantity(path, default, unit, description, latex)
        return self.collector.quantity(path, self.data[key], unit, description, latex, wrong_dimension=wrong_dimension)

    def optional_quantity(self, key: str, unit: str, description: str, latex: str) -> Quantity | None:
        """The quantity at `key`; None where there is none."""
        if not self.has(key):
            return None
        return self.quantity(key, unit, description, latex, example="")

    def number(self, key: str, *, example: str, default: float | None = None) -> float:
        """A plain number; NaN, with a fault, where there is none."""
        if not self.has(key) and default is not None:
            return default
        given = self.take(key, example)
        return math.nan if given is None else self.collector.quantity((*self.path, key), given, "1", "", "").value

    def integer(self, key: str, lowest: int, highest: int, *, example: str, default: int | None = None) -> int:
        """A whole number between two bounds; `lowest`, with a fault, where there is none."""
        if not self.has(key) and default is not None:
            return default
        given = self.take(key, example)
        if given is None:
            return lowest
        if isinstance(given, bool) or not isinstance(given, int) or not lowest <= given <= highest:
            self.fault(
                key,
                "this is not a whole number within the bounds",
                given=show(given),
                allowed=f"a whole number from {lowest} to {highest}",
                remedy=f"write for example {key} = {example}",
            )
            return lowest
        return given

    def choice(self, key: str, choices: Sequence[Choice], *, default: Choice | None = None) -> Choice | None:
        """One of `choices`; None, with a fault, where it is none of them."""
        if not self.has(key) and default is not None:
            return default
        given = self.take(key, " or ".join(f'"{choice}"' for choice in choices))
        if given is None:
            return None
        for choice in choices:
            if given == choice:
                return choice
        self.fault(
            key,
            "this is none of the choices",
            given=show(given),
            allowed=listing(choices),
            remedy=suggest(given, choices, f'write for example {key} = "{choices[0]}"'),
        )
        return None

    def text(self, key: str, example: str) -> str | None:
        """A text; None, with a fault, where there is none."""
        given = self.take(key, f'"{example}"')
        if given is None or isinstance(given, str):
            return given
        self.fault(key, "this is not a text", given=show(given), allowed="a text", remedy=f'write {key} = "{example}"')
        return None

    def vector(self, key: str, unit: str, words: VectorWords) -> Vector:
        """The vector at a required key, in the form the file gives it."""
        zero = Vector(kind="zero")
        forms = words.forms(unit)
        if self.take(key, forms) is None:
            return zero
        given, path = self.data[key], (*self.path, key)
        read = self.collector.quantity
        if isinstance(given, list) and len(given) == 2:
            return Vector(
                kind="cartesian",
                first=read((*path, "x"), given[0], unit, f"x component of {words.what}", words.latex[1]),
                second=read((*path, "y"), given[1], unit, f"y component of {words.what}", words.latex[2]),
            )
        if isinstance(given, dict):
            with self.table(key) as polar:
                length, angle = words.polar
                return Vector(
                    kind="polar",
                    first=polar.quantity(
                        length, unit, f"{length.capitalize()} of {words.what}", words.latex[3], example=f"1 {unit}"
                    ),
                    second=polar.quantity(
                        angle, "rad", f"{angle.capitalize()} of {words.what}", words.latex[4], example="30 deg"
                    ),
                )
        if isinstance(given, str) and given.strip() == "origin" and words.origin:
            return zero
        if words.axis and not isinstance(given, list):
            return Vector(kind="axis", first=read(path, given, unit, words.axis, words.latex[0]))
        self.fault(
            key,
            f"this is not a vector with {len(given)} numbers" if isinstance(given, list) else "this is no vector",
            given=show(given),
            allowed=forms,
            remedy="write the components along x and y, each with its unit",
        )
        return zero

    def column(self, key: str, unit: str, description: str, latex: str) -> tuple[Quantity, ...]:
        """The quantities of a list, or of a list of numbers with one unit; empty, with a fault, where there is none.

        The number of a row, counted from 1, takes the place of ROW in description and symbol.
        """
        example = f'["0 {unit}", "1 {unit}"]'
        allowed = f'{example}, or {{ values = [0, 1], unit = "{unit}" }}'
        given = self.take(key, example)
        if given is None:
            return ()
        values: Any = given
        suffix = ""
        if isinstance(given, dict):
            with self.table(key) as column:
                values, column_unit = column.take("values", "[0, 1]"), column.text("unit", unit)
            if values is None or column_unit is None:
                return ()
            suffix = column_unit
        if not isinstance(values, list) or not values:
            self.fault(
                key,
                "this is no column of numbers",
                given=show(given),
                allowed=allowed,
                remedy="write a list with one value for each row",
            )
            return ()
        return tuple(
            self.collector.quantity(
                (*self.path, key, str(row)),
                f"{value!r} {suffix}" if suffix and isinstance(value, int | float) and abs(value) < 1e300 else value,
                unit,
                description.replace("ROW", str(row)),
                latex.replace("ROW", str(row)),
            )
            for row, value in enumerate(values, start=1)
        )
