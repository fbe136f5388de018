"""Keys of the scene file.  Each is declared once, at the field of the record that it fills.

A declaration holds a description of the key, and for a number its unit, symbol, bounds and plausible range.  The
reader, the checks of values, the warnings of unusual numbers, the reference page and the JSON Schema take it from
there.  A key says which others it needs (`Needs`), a record of which keys one is given (`Either`).

Text of a declaration may hold placeholders in capitals ("Mass of the NAME"), which the owner of a table fills in.
"""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, fields, replace
from difflib import get_close_matches
from typing import Any, ClassVar, Self

from ballpass.derive.scene.quantity import NO_LIMITS, Bounds, Limits, SceneNumber, UsualRange, Vector
from ballpass.derive.scene.table import MAX_NAME, MISSPELT, Table, listing, suggest
from ballpass.derive.scene.units import COMMON, show
from ballpass.runtime.contract.plugins import Registry
from ballpass.runtime.contract.units import unit_size

#: Values of placeholders.
Fill = Mapping[str, str]


#: How a quantity begins, in JSON Schema.
NUMBER = r"^\s*[-+]?(\d|\.\d)"


def _text(unit: str, bounds: Bounds | None = None) -> dict[str, Any]:
    """Schema of a quantity as a text: a usual unit of another dimension is refused, and a sign beyond the bounds."""
    base = unit_size(unit).base
    others = [name for name, size in COMMON.items() if name.isascii() and size.base != base]
    wrong = rf"{NUMBER}[\d.eE+-]*\s*({'|'.join(others)}){'?' if unit != '1' else ''}\s*$"
    if bounds is not None and any(end is not None and end >= 0.0 for end in (bounds.above, bounds.least)):
        wrong += r"|^\s*-[0.]*[1-9]"
    return {"type": "string", "pattern": NUMBER, "not": {"pattern": wrong}}


def filled(text: str, fill: Fill) -> str:
    """A text with its placeholders replaced, in one pass, because names of the scene may look like placeholders."""
    longest_first = sorted(fill, key=len, reverse=True)
    return re.sub("|".join(map(re.escape, longest_first)), lambda match: fill[match[0]], text) if fill else text


@dataclass(frozen=True, slots=True, kw_only=True)
class Needs:
    """What a scene must say where a key belongs to its table.

    Attributes
    ----------
    key, value : another key, and the value it has; any where empty.  Keys of other tables are given by their reader
    why : problem of the key without it
    words : what is needed, where key and value do not say it to people
    remedy : what to do, besides deleting the key
    """

    key: str
    value: str = ""
    why: str
    words: str = ""
    remedy: str = ""

    def __str__(self) -> str:
        return self.words or (f'{self.key} = "{self.value}"' if self.value else self.key)

    def met(self, table: Table, name: str, known: Mapping[str, Any]) -> bool:
        """Whether a scene says it; a fault where it does not, and the key is given.

        A value that is unknown has been reported, as have the keys of a table in which others are missing.
        """
        found = known.get(self.key)
        if found == self.value or (not self.value and found is not None):
            return True
        if table.missing or (self.value and found is None):
            return False
        remedy = self.remedy or f"delete the key, or write {self}"
        table.refuse((name,), self.why, allowed=f"{name} only with {self}", remedy=remedy)
        return False


@dataclass(frozen=True, slots=True, kw_only=True)
class Key(ABC):
    """One key of a table.

    Attributes
    ----------
    words : description in one line without unit; also that of its parameter
    name : in the file, where it differs from that of its field
    example : as the file has it; a text without its quotes
    default : value of a key that is not given, in the same form
    optional : it may be left out, and is None then
    when : text on when it is needed, where other keys decide this, and not by `needs` or an `Either`
    needs : it is read only where these are met, and is None elsewhere
    note : more for the reference page, in Markdown
    """

    words: str = ""
    name: str = ""
    example: Any = ""
    default: Any = None
    optional: bool = False
    when: str = ""
    needs: tuple[Needs, ...] = ()
    note: str = ""

    quoted: ClassVar[bool] = True

    def filled(self, fill: Fill) -> Self:
        """The key with its placeholders filled in."""
        values = {f.name: getattr(self, f.name) for f in fields(self)} if fill else {}
        texts: dict[str, Any] = {name: filled(v, fill) for name, v in values.items() if isinstance(v, str)}
        texts |= {name: tuple(filled(t, fill) for t in v) for name, v in values.items() if _texts(v)}
        texts |= {"needs": tuple(replace(one, key=filled(one.key, fill)) for one in self.needs)} if self.needs else {}
        return replace(self, **texts) if texts else self

    def declared(self) -> Any:
        """A field of a record that the key fills; None where it may be left out."""
        metadata = {"key": self}
        return field(default=None, metadata=metadata) if self.optional else field(metadata=metadata)

    @property
    def sample(self) -> str:
        """The allowed values in the file."""
        return f'"{self.example}"' if self.quoted else str(self.example)

    def read(self, table: Table, name: str) -> Any:
        """The value in a table at this key; a placeholder, with a fault, where none fits."""
        if not table.has(name) and (self.optional or self.default is not None):
            return self.absent(table, name)
        given = table.take(name, self.sample)
        return self.placeholder(table, name) if given is None else self.value(table, name, given)

    def absent(self, table: Table, name: str) -> Any:
        """Value of a key that is not given."""
        return self.default

    def placeholder(self, table: Table, name: str) -> Any:
        """Value in place of a missing or wrong one; such a record never leaves the reader."""
        return None

    @abstractmethod
    def value(self, table: Table, name: str, given: Any) -> Any:
        """The value; faults are noted."""

    @abstractmethod
    def schema(self) -> dict[str, Any]:
        """The allowed values, as JSON Schema."""

    def refuse(self, table: Table, name: str, problem: str, given: Any, allowed: str = "", remedy: str = "") -> Any:
        """Note a fault; return the placeholder."""
        remedy = remedy or f"write {name} = {self.sample}"
        table.fault(name, problem, given=show(given), allowed=allowed or self.sample, remedy=remedy)
        return self.placeholder(table, name)


def _texts(value: object) -> bool:
    return isinstance(value, tuple) and all(isinstance(item, str) for item in value)


@dataclass(frozen=True, slots=True, kw_only=True)
class QuantityKey(Key):
    """A number with a unit; "1": a plain number.

    Attributes
    ----------
    unit, symbol : SI unit, and symbol in the equations
    bounds, remedy, usual : see `Limits`
    setting : it is read once and is no parameter of the model: the value is a float
    wrong_dimension : remedy where number and unit can be read, but measure something else
    groups : words that may stand there instead
    """

    unit: str
    symbol: str = ""
    bounds: Bounds | None = None
    remedy: str = ""
    usual: UsualRange | None = None
    setting: bool = False
    wrong_dimension: str = ""
    groups: tuple[str, ...] = ()

    @property
    def sample(self) -> str:
        """Text with a unit, or a plain number."""
        return str(self.example) if self.unit == "1" else f'"{self.example}"'

    @property
    def limits(self) -> Limits:
        """Of its value."""
        return Limits(bounds=self.bounds, remedy=self.remedy, usual=self.usual)

    def schema(self) -> dict[str, Any]:
        """A text with a unit, or a plain number within its bounds."""
        text = _text(self.unit, self.bounds)
        if self.unit != "1":
            return {"anyOf": [text, {"enum": [*self.groups]}]} if self.groups else text
        bounds = self.bounds or Bounds()
        ends = {"exclusiveMinimum": bounds.above, "minimum": bounds.least, "maximum": bounds.most}
        ends["exclusiveMaximum"] = bounds.below
        number = {"type": "number", **{word: bound for word, bound in ends.items() if bound is not None}}
        return {"anyOf": [number, text]}

    def absent(self, table: Table, name: str) -> Any:
        """The default with its unit."""
        return None if self.default is None else self.value(table, name, self.default)

    def placeholder(self, table: Table, name: str) -> Any:
        """Not a number."""
        if self.setting:
            return math.nan
        path = ".".join((*table.path, name))
        return SceneNumber(path=path, value=math.nan, unit=self.unit, description=self.words, latex=self.symbol)

    def value(self, table: Table, name: str, given: Any) -> Any:
        """The quantity, whose bounds are checked with those of all others; of a setting the number, checked here."""
        quantity = self.at((*table.path, name), table, given)
        problem = self.bounds.problem(quantity.value) if self.bounds is not None and self.setting else ""
        if self.bounds is not None and problem:
            self.refuse(table, name, problem, given, self.bounds.allowed, self.limits.advice)
        return quantity.value if self.setting else quantity

    def at(self, path: tuple[str, ...], table: Table, given: Any) -> SceneNumber:
        """The quantity of a path."""
        return table.collector.quantity(
            path, given, self.unit, self.words, self.symbol, limits=self.limits, wrong_dimension=self.wrong_dimension
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class PairKey(QuantityKey):
    """Two components, ``["0 um", "0 um"]``; AXIS in words and symbol stands for x and y."""

    @property
    def sample(self) -> str:
        """Both components."""
        return f'["{self.example}", "{self.example}"]'

    def schema(self) -> dict[str, Any]:
        """A list of two."""
        return {"type": "array", "items": QuantityKey.schema(self), "minItems": 2, "maxItems": 2}

    def absent(self, table: Table, name: str) -> Any:
        """Twice the default."""
        return None if self.optional else self.value(table, name, [self.default, self.default])

    def placeholder(self, table: Table, name: str) -> Any:
        """No component."""
        return ()

    def value(self, table: Table, name: str, given: Any) -> Any:
        """The quantities with x and y behind their paths."""
        if not isinstance(given, list) or len(given) != 2:
            return self.refuse(table, name, "these are not two components", given)
        pairs = zip("xy", given, strict=True)
        return tuple(self.filled({"AXIS": axis}).at((*table.path, name, axis), table, item) for axis, item in pairs)


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnKey(QuantityKey):
    """A column of a table: a list of quantities, or numbers with one unit.

    The number of a row, counted from 1, takes the place of ROW in words and symbol.
    """

    @property
    def sample(self) -> str:
        """Two rows."""
        return f'["0 {self.unit}", "1 {self.unit}"]'

    def schema(self) -> dict[str, Any]:
        """A list, a list of numbers with one unit, or a column of a file."""
        unit, numbers = {"type": "string"}, {"type": "array", "items": {"type": "number"}, "minItems": 1}
        written = {"properties": {"values": numbers, "unit": unit}, "required": ["values", "unit"]}
        named = {"properties": {"file": unit, "column": unit, "unit": unit}, "required": ["file", "column"]}
        tables = [{"type": "object", **table, "additionalProperties": False} for table in (written, named)]
        return {"anyOf": [{"type": "array", "items": QuantityKey.schema(self), "minItems": 1}, *tables]}

    def placeholder(self, table: Table, name: str) -> Any:
        """No row."""
        return ()

    def value(self, table: Table, name: str, given: Any) -> Any:
        """The quantity of each row."""
        values, suffix = given, ""
        if isinstance(given, dict):
            with table.table(name) as column:
                column.know("values", "unit")
                values = column.take("values", "[0, 1]")
                suffix = TextKey(example=self.unit).read(column, "unit")
                if suffix and not table.collector.is_unit((*table.path, name, "unit"), suffix, self.unit):
                    return ()
            if values is None or not suffix:
                return ()
        if not isinstance(values, list) or not values:
            allowed = f'{self.sample}, or {{ values = [0, 1], unit = "{self.unit}" }}'
            remedy = "write a list with one value for each row"
            return self.refuse(table, name, "this is not a column of numbers", given, allowed, remedy)
        return tuple(
            self.filled({"ROW": str(row)}).at(
                (*table.path, name, str(row)),
                table,
                f"{value!r} {suffix}" if suffix and isinstance(value, int | float) and abs(value) < 1e300 else value,
            )
            for row, value in enumerate(values, start=1)
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class WholeKey(Key):
    """A whole number from `lowest` to `highest`."""

    lowest: int
    highest: int
    quoted = False

    def schema(self) -> dict[str, Any]:
        """A number between both."""
        return {"type": "integer", "minimum": self.lowest, "maximum": self.highest}

    def placeholder(self, table: Table, name: str) -> int:
        """The lowest."""
        return self.lowest

    def value(self, table: Table, name: str, given: Any) -> int:
        """The number."""
        if isinstance(given, int) and not isinstance(given, bool) and self.lowest <= given <= self.highest:
            return given
        allowed = f"a whole number from {self.lowest} to {self.highest}"
        remedy = f"write for example {name} = {self.sample}"
        return int(self.refuse(table, name, "this is not a whole number within the bounds", given, allowed, remedy))


@dataclass(frozen=True, slots=True, kw_only=True)
class WholePairKey(WholeKey):
    """Two whole numbers within the same bounds."""

    def schema(self) -> dict[str, Any]:
        """A list of two."""
        return {"type": "array", "items": WholeKey.schema(self), "minItems": 2, "maxItems": 2}

    def value(self, table: Table, name: str, given: Any) -> Any:
        """Both numbers."""
        if not isinstance(given, list) or len(given) != 2:
            self.refuse(table, name, "this is not a list of two whole numbers", given)
            return self.lowest, self.lowest
        return tuple(WholeKey.value(self, table, name, item) for item in given)


@dataclass(frozen=True, slots=True, kw_only=True)
class ChoiceKey(Key):
    """One of some words; with a fault the one that it is like, None where it is like none of them."""

    choices: Collection[str]

    @property
    def sample(self) -> str:
        """All of them."""
        return " or ".join(f'"{choice}"' for choice in self.choices)

    def schema(self) -> dict[str, Any]:
        """The words."""
        return {"enum": [*self.choices]}

    def value(self, table: Table, name: str, given: Any) -> str | None:
        """The word."""
        if isinstance(given, str) and given in self.choices:
            return given
        remedy = suggest(given, choices := [*self.choices], f'write for example {name} = "{next(iter(self.choices))}"')
        if isinstance(self.choices, Registry):
            remedy += "; of a package of yours: install it, or give its module by --plugin"
        self.refuse(table, name, "this is none of the choices", given, listing(choices), remedy)
        return next(iter(get_close_matches(str(given)[:MAX_NAME], choices, n=1, cutoff=MISSPELT)), None)


@dataclass(frozen=True, slots=True, kw_only=True)
class TextKey(Key):
    """A text; empty, with a fault, where there is none.  With `longest`, one line of at most as many characters.

    Empty is what stands for a text that is missing or wrong, and is checked no further: a text that is written may be
    empty only where that is the default.
    """

    longest: int = 0

    def schema(self) -> dict[str, Any]:
        """A text."""
        least = {} if self.default == "" else {"minLength": 1}
        return {"type": "string", **least, **({"maxLength": self.longest} if self.longest else {})}

    def placeholder(self, table: Table, name: str) -> str:
        """Nothing."""
        return ""

    def value(self, table: Table, name: str, given: Any) -> Any:
        """The text."""
        if not isinstance(given, str):
            number = isinstance(given, int | float) and not isinstance(given, bool)
            remedy = f'write {name} = "{show(given)}"' if number else ""
            return self.refuse(table, name, "this is not a text", given, "a text", remedy)
        if not given.strip() and self.default != "":
            return self.refuse(table, name, "the text is empty", given, "a text that is not empty")
        if self.longest and (not given.isprintable() or len(given) > self.longest):
            allowed, remedy = f"at most {self.longest} printable characters", "shorten it; put the rest into a comment"
            return self.refuse(table, name, "this is not a single line", given, allowed, remedy)
        return given


@dataclass(frozen=True, slots=True, kw_only=True)
class NamesKey(Key):
    """A list of names, of two where `two`; empty, with a fault, where there is none."""

    two: bool = True
    quoted = False

    def schema(self) -> dict[str, Any]:
        """A list of texts."""
        counts = {"minItems": 2, "maxItems": 2} if self.two else {"minItems": 1}
        return {"type": "array", "items": {"type": "string"}, **counts}

    def placeholder(self, table: Table, name: str) -> Any:
        """No name."""
        return ()

    def value(self, table: Table, name: str, given: Any) -> Any:
        """The names."""
        if self.two:
            if isinstance(given, list) and len(given) == 2 and all(isinstance(item, str) for item in given):
                return tuple(given)
            return self.refuse(table, name, "this is not a list of two names", given)
        allowed = f"a list of names and patterns, as in {self.sample}"
        if not isinstance(given, list) or not given:
            return self.refuse(table, name, "this is not a list of names", given, allowed)
        names = []
        for number, item in enumerate(given, start=1):
            if isinstance(item, str) and item.strip() and len(item) <= 200:
                names.append(item.strip())
            else:
                remedy = "delete the entry, or write a name"
                self.refuse(table, name, f"entry {number} is not a name", item, allowed, remedy)
        return tuple(names)


@dataclass(frozen=True, slots=True, kw_only=True)
class VectorKey(Key):
    """A plane vector, in one of the forms of the reference page.

    Attributes
    ----------
    words : what goes behind "x component of"
    axis : description of the form with one number, empty where that form is not allowed
    symbols : of axis, x, y, length and angle
    polar : keys of the form with an angle
    origin : whether the zero vector may be written as a word
    axis_limits, length_limits : of the number alone, and of the length
    """

    unit: str
    axis: str = ""
    symbols: tuple[str, str, str, str, str]
    polar: tuple[str, str] = ("distance", "angle")
    origin: bool = False
    axis_limits: Limits = NO_LIMITS
    length_limits: Limits = NO_LIMITS

    @property
    def _numbers(self) -> tuple[str, str]:
        unit = self.unit
        return {"m": ("6 mm", "2 mm"), "N": ("0 N", "196 N")}.get(unit, (f"0 {unit}", f"9.81 {unit}"))

    @property
    def sample(self) -> str:
        """The forms that may stand in the file."""
        first, second = self._numbers
        forms = ['"origin"'] if self.origin else []
        if self.axis:
            forms.append(f'"{first}"')
        forms += [f'["{first}", "{second}"]', f'{{ {self.polar[0]} = "{second}", {self.polar[1]} = "30 deg" }}']
        return ", ".join(forms[:-1]) + " or " + forms[-1]

    def schema(self) -> dict[str, Any]:
        """Its forms."""
        number, length = _text(self.unit), _text(self.unit, self.length_limits.bounds)
        alone = [_text(self.unit, self.axis_limits.bounds)] if self.axis else []
        polar = {"properties": dict(zip(self.polar, (length, _text("rad")), strict=True)), "required": [*self.polar]}
        forms = [
            {"type": "array", "items": number, "minItems": 2, "maxItems": 2},
            {"type": "object", **polar, "additionalProperties": False},
        ]
        return {"anyOf": [*([{"const": "origin"}] * self.origin), *alone, *forms]}

    def placeholder(self, table: Table, name: str) -> Vector:
        """Zero."""
        return Vector(kind="zero")

    def value(self, table: Table, name: str, given: Any) -> Vector:
        """The vector in the form the file gives it."""
        path, read = (*table.path, name), table.collector.quantity
        if isinstance(given, list) and len(given) == 2:
            first, second = (
                read((*path, axis), item, self.unit, f"{axis} component of {self.words}", symbol)
                for axis, item, symbol in zip("xy", given, self.symbols[1:3], strict=True)
            )
            return Vector(kind="cartesian", first=first, second=second)
        if isinstance(given, dict):
            limits = self.length_limits
            length, angle = (f"{part.capitalize()} of {self.words}" for part in self.polar)
            keys = (
                QuantityKey(
                    unit=self.unit,
                    words=length,
                    symbol=self.symbols[3],
                    example=self._numbers[1],
                    bounds=limits.bounds,
                    remedy=limits.remedy,
                ),
                QuantityKey(unit="rad", words=angle, symbol=self.symbols[4], example="30 deg"),
            )
            with table.table(name) as polar:
                polar.know(*self.polar)
                first, second = (key.read(polar, part) for key, part in zip(keys, self.polar, strict=True))
            return Vector(kind="polar", first=first, second=second)
        if isinstance(given, str) and given.strip() == "origin" and self.origin:
            return Vector(kind="zero")
        if self.axis and not isinstance(given, list):
            only = read(path, given, self.unit, self.axis, self.symbols[0], limits=self.axis_limits)
            return Vector(kind="axis", first=only)
        problem = f"this is not a vector with {len(given)} numbers" if isinstance(given, list) else "this is no vector"
        remedy = "write the components along x and y, each with its unit"
        return self.refuse(table, name, problem, given, remedy=remedy)  # type: ignore[no-any-return]
