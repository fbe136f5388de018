"""Columns of numbers with their names and units, as files and arrays have them.

In: heads and cells.  Out: a `ColumnFile`: a column by name, its numbers in SI, the times.  A unit stands in brackets
behind a name, ``time [ms]`` or ``time (ms)``, or after an underscore, ``time_ms``.  `column_files` reads the files.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.units import GrammarError, QuantityError, parse_quantity, show, unit_size

#: Names of a column of times, in small letters.
TIME_NAMES = ("time", "t")

#: A number with a decimal point or comma.
NUMBER = re.compile(r"[+-]?(?:(?:\d+(?:\.\d*|,\d+)?|[.,]\d+)(?:e[+-]?\d+)?|inf|nan)", re.IGNORECASE)

#: Names of units as other programs write them.
_ALIASES = {
    **dict.fromkeys(("sec", "second", "seconds"), "s"),
    **dict.fromkeys(("msec", "millisecond", "milliseconds"), "ms"),
    **dict.fromkeys(("meter", "meters", "metre", "metres"), "m"),
    **dict.fromkeys(("degree", "degrees"), "deg"),
    **dict.fromkeys(("radian", "radians"), "rad"),
}
_BRACKETS = re.compile(r"(.*?)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))")


class ColumnError(RequestError):
    """A file of columns cannot be read as it is.

    Parameters
    ----------
    problem, given, allowed, remedy : parts of the message
    """

    def __init__(self, problem: str, given: str, allowed: str, remedy: str) -> None:
        self.problem, self.given, self.allowed, self.remedy = problem, given, allowed, remedy
        super().__init__(f"{problem}: {given}. Allowed: {allowed}. {remedy[:1].upper()}{remedy[1:]}.")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Column:
    """A column of a file.

    Attributes
    ----------
    head : as written
    name : without its unit
    unit : empty where there is none
    stated : whether the unit is written as one, and not after an underscore
    cells : texts, or numbers
    """

    head: str
    name: str
    unit: str
    stated: bool
    cells: Sequence[str] | np.ndarray = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ColumnFile:
    """Columns of a file, or of arrays.

    Attributes
    ----------
    name : for messages
    columns : in their order
    lines : line of the file that each row ends on; empty where there are no lines
    decimal_comma : whether numbers are written with commas
    said : assignments in comments, or attributes
    layout : what was found about the file, in words; empty for a plain one
    """

    name: str
    columns: tuple[Column, ...]
    lines: tuple[int, ...] = ()
    decimal_comma: bool = False
    said: Mapping[str, str] = field(default_factory=dict)
    layout: str = ""

    def column(self, wanted: str) -> Column:
        """The column of this head, name or number; a unit in brackets behind a name is the column's.

        Raises
        ------
        ColumnError
            There is none or more than one, or the file states another unit.
        """
        found = [one for one in self.columns if wanted == one.head]
        unit = ""
        if not found:
            asked = headed(wanted)
            name, unit = (asked.name, asked.unit) if asked.stated else (wanted, "")
            found = [one for one in self.columns if one.name == name]
            if not found and name.isdigit() and 0 < int(name) <= len(self.columns):
                found = [self.columns[int(name) - 1]]
        heads = [one.head for one in self.columns]
        if not found:
            known = ", ".join(map(show, heads)) or "none: it is empty"
            near = get_close_matches(wanted, [*heads, *(one.name for one in self.columns)], n=1)
            remedy = f"did you mean {show(near[0])}?" if near else "name one of them, or give its number from 1 on"
            raise ColumnError(f"{self.name} has no such column", show(wanted), known, remedy.removesuffix("?"))
        if len(found) > 1:
            numbers = " and ".join(str(k) for k, one in enumerate(self.columns, start=1) if one in found)
            raise ColumnError(
                f"{self.name} has the column more than once", show(wanted), "a name once", f"give its number: {numbers}"
            )
        return self.in_unit(found[0], unit)

    def in_unit(self, column: Column, unit: str) -> Column:
        """The column in a unit that the caller gives; as it is for an empty one.

        Raises
        ------
        ColumnError
            The file states another one.
        """
        if not unit:
            return column
        if column.stated and column.unit and _differ(unit, column.unit):
            raise ColumnError(
                f"{self.name} and the request give different units for {show(column.name)}",
                f"{show(column.unit)} in the file, {show(unit)} asked for",
                "one unit",
                "omit the one asked for, or correct the file",
            )
        return replace(column, unit=unit, stated=True)

    def numbers(self, column: Column) -> np.ndarray:
        """Numbers of a column, NaN where a cell is empty [the column's unit].

        Raises
        ------
        ColumnError
            A cell holds something else.
        """
        if isinstance(column.cells, np.ndarray):
            return column.cells
        found = np.full(len(column.cells), np.nan)
        for k, cell in enumerate(column.cells):
            if not cell:
                continue
            if not NUMBER.fullmatch(cell) or ("." if self.decimal_comma else ",") in cell:
                mark = "with decimal commas" if self.decimal_comma else "with decimal points"
                raise ColumnError(
                    f"line {self.lines[k]} of {self.name} has no number in the column {show(column.head)}",
                    show(cell),
                    f"numbers {mark}, as in the rest of the file, without a unit",
                    "correct the line; a unit stands in the line of names, in brackets",
                )
            found[k] = float(cell.replace(",", "."))
        return found

    def si(self, column: Column, unit: str) -> np.ndarray:
        """Numbers of a column in an SI unit; those of a column without a unit are in it.

        Raises
        ------
        RequestError
            The column's unit is unknown or measures something else.
        """
        numbers = self.numbers(column)
        if column.unit in ("", unit):
            return numbers
        try:
            return numbers * parse_quantity(f"1 {column.unit}", unit)
        except QuantityError as error:
            remedy = "" if column.stated else ' Say the unit in brackets where the column is named: "NAME [UNIT]".'
            raise RequestError(f"{self.name}, column {show(column.head)}: {error}.{remedy}") from None

    def time(self, wanted: str | None = None, rate: float | None = None) -> np.ndarray:
        """Times of the samples [s].

        Parameters
        ----------
        wanted : name of their column; the one that has the name or the unit of a time if there is none
        rate : of the samples, in place of a column [Hz]

        Raises
        ------
        RequestError
            No column is, or more than one may be, that of the times; or its unit is none of time.
        """
        if rate is not None and wanted is not None:
            raise RequestError("--time and --rate were both given. Allowed: one of them. Omit one.")
        if rate is not None:
            return np.arange(len(self.columns[0].cells) if self.columns else 0) / rate
        return self.si(self.time_column(wanted), "s")

    def time_column(self, wanted: str | None = None) -> Column:
        """The column of the times; parameters and errors as of `time`."""
        if wanted is not None:
            return self.column(wanted)
        named = [one for one in self.columns if one.name.casefold() in TIME_NAMES]
        found = named or [one for one in self.columns if one.unit and not _differ(one.unit, "s", dimension=True)]
        if len(found) != 1:
            raise ColumnError(
                f"{self.name} has {'no column of times' if not found else 'several columns that may be the time'}",
                ", ".join(show(one.head) for one in found or self.columns) or "no columns",
                "one column called time or t, or with a unit of time, as in time [ms]",
                "name the column (--time), or give the rate of the samples (--rate)",
            )
        return found[0]


def unit_of(text: str) -> str:
    """A unit by the name that is known here; other programs write some otherwise."""
    return _ALIASES.get(text, text)


def headed(head: str, unit: str = "") -> Column:
    """A column from its head: name and unit."""
    if unit:
        return Column(head=head, name=head, unit=unit_of(unit), stated=True)
    if match := _BRACKETS.fullmatch(head):
        unit = (match[2] or match[3] or "").strip()
        return Column(head=head, name=match[1], unit="" if unit == "-" else unit_of(unit), stated=True)
    name, underscore, unit = head.rpartition("_")
    if underscore and name and is_known_unit(unit):
        return Column(head=head, name=name, unit=unit_of(unit), stated=False)
    return Column(head=head, name=head, unit="", stated=False)


def is_known_unit(text: str) -> bool:
    """Whether a text is a unit."""
    try:
        return bool(unit_size(unit_of(text)).base) or text == "%"
    except GrammarError:
        return False


def _differ(one: str, other: str, *, dimension: bool = False) -> bool:
    """Whether two units differ, in size or only in dimension; one that is not known is taken as equal in size."""
    try:
        first, second = (unit_size(unit_of(text)) for text in (one, other))
    except GrammarError:
        return dimension
    return first.base != second.base or (not dimension and first != second)
