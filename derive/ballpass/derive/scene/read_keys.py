"""Keys at the fields of records, and a table of the scene file read by them.

In: a table, and a record whose fields are declared with keys.  Out: the record; faults are noted in the table.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from types import MappingProxyType
from typing import Any, TypeVar

from ballpass.derive.scene.keys import ColumnKey, Fill, Key, QuantityKey, VectorKey, filled
from ballpass.derive.scene.quantity import NOT_NEGATIVE, POSITIVE
from ballpass.derive.scene.table import Table

Record = TypeVar("Record")
_NOTHING: Fill = MappingProxyType({})


@dataclass(frozen=True, slots=True, kw_only=True)
class Either:
    """Groups of keys of which a table gives exactly one, or at least one.

    Attributes
    ----------
    what : name of what they give, "the coefficient"
    groups : of keys, the usual one first; the keys of the other groups are None
    at : key that a second group is reported at; the table itself by default
    optional : none may be given
    several : more than one may be given
    """

    what: str = ""
    groups: tuple[tuple[str, ...], ...]
    at: str = ""
    optional: bool = False
    several: bool = False

    def filled(self, fill: Fill) -> Either:
        """The rule with the placeholders in its keys filled in."""
        return replace(self, groups=tuple(tuple(filled(key, fill) for key in group) for group in self.groups))

    def choose(self, table: Table, keys: Mapping[str, Key]) -> tuple[str, ...]:
        """Keys of the group that is given; none where there is none, with a fault unless optional; the first of two."""
        table.know(*(key for group in self.groups for key in group))
        given = [group for group in self.groups if any(key in table.data for key in group)]
        if self.several and given:
            return tuple(key for group in given for key in group)
        if table.missing or len(given) == 1 or (self.optional and not given):
            return given[0] if given else ()
        found = [[key for key in group if key in table.data] for group in given]
        samples = [" and ".join(f"{k} = {keys[k].sample}" if k in keys else k for k in group) for group in self.groups]
        problem = f"{self.what} is given twice" if given else f"{self.what} is missing"
        if self.several:
            problem = f"neither {' nor '.join(' and '.join(group) for group in self.groups)}"
        table.fault(
            self.at if given else "",
            problem,
            given=" and ".join(key for group in found for key in group) or "neither",
            allowed=f"{', '.join(samples)}, or both" if self.several else f"either {', or '.join(samples)}",
            remedy="delete one of the two: " + ", or ".join(f"delete {' and '.join(group)}" for group in found)
            if given
            else f"add {samples[0]}",
        )
        table.missing = table.missing or self.several  # which of the keys that need one of these belong here is open
        return given[0] if given else ()


def number(unit: str, words: str, symbol: str = "", example: Any = "", **more: Any) -> QuantityKey:
    """The key of a number; `more` as in `QuantityKey`."""
    return QuantityKey(unit=unit, words=words, symbol=symbol, example=example, **more)


def force_key(words: str, symbol: str, index: str = "", **more: Any) -> VectorKey:
    """The key of a force: a single number is not enough, because its axis would be unknown."""
    x, y = (f"{symbol}_{{{index}{',' * bool(index)}{axis}}}" for axis in "xy")
    length, angle = f"{symbol}_{{{index}}}" if index else symbol, rf"\alpha_{{{index or symbol}}}"
    return VectorKey(unit="N", words=words, symbols=("", x, y, length, angle), polar=("magnitude", "direction"), **more)


def quantity(unit: str, words: str, symbol: str = "", example: Any = "", **more: Any) -> Any:
    """A field that a number fills."""
    return number(unit, words, symbol, example, **more).declared()


def positive(unit: str, words: str, symbol: str = "", example: Any = "", **more: Any) -> Any:
    """A field that a number above zero fills."""
    return quantity(unit, words, symbol, example, bounds=POSITIVE, **more)


def not_negative(unit: str, words: str, symbol: str = "", example: Any = "", **more: Any) -> Any:
    """A field that a number from zero on fills."""
    return quantity(unit, words, symbol, example, bounds=NOT_NEGATIVE, **more)


def column(unit: str, words: str, symbol: str, **more: Any) -> Any:
    """A field that the column of a table fills."""
    return ColumnKey(unit=unit, words=words, symbol=symbol, **more).declared()


def keys_of(kind: type[Any], fill: Fill = _NOTHING) -> dict[str, Key]:
    """Keys by their names in the file, in the order of a record's fields."""
    found = (key.filled(fill) for key in _keys(kind).values())
    return {key.name or name: key for name, key in zip(_keys(kind), found, strict=True)}


def _keys(kind: type[Any]) -> dict[str, Key]:
    return {f.name: f.metadata["key"] for f in fields(kind) if "key" in f.metadata}


def read_keys(
    table: Table, keys: Mapping[str, Key], one_of: Sequence[Either] = (), facts: Mapping[str, Any] = _NOTHING
) -> dict[str, Any]:
    """Values of all keys, by name; None for those that others exclude.

    Parameters
    ----------
    facts : values of keys of other tables that the keys here may need
    """
    table.know(*keys)
    left_out = {k for rule in one_of for group in rule.groups for k in group}
    left_out -= {k for rule in one_of for k in rule.choose(table, keys)}
    values: dict[str, Any] = {}
    for name, key in keys.items():
        belongs = name not in left_out and all(one.met(table, name, {**facts, **values}) for one in key.needs)
        values[name] = key.read(table, name) if belongs else None
    return values


def read_record(
    kind: type[Record], table: Table, fill: Fill = _NOTHING, facts: Mapping[str, Any] = _NOTHING, **known: Any
) -> Record:
    """A record from its keys; fields that are `known` are not read."""
    keys = {name: key.filled(fill) for name, key in _keys(kind).items() if name not in known}
    names = {name: key.name or name for name, key in keys.items()}
    values = read_keys(table, {names[name]: key for name, key in keys.items()}, choices_of(kind, fill), facts)
    return kind(**{name: values[names[name]] for name in keys}, **known)


def read_inner(
    kind: type[Record], table: Table, key: str, example: str = "", fill: Fill = _NOTHING, **known: Any
) -> Record:
    """A record from the keys of the table at a key."""
    with table.table(key, example) as inner:
        return read_record(kind, inner, fill, **known)


def choices_of(kind: type[Any], fill: Fill = _NOTHING) -> tuple[Either, ...]:
    """Rules of a record on which of its keys are given."""
    return tuple(rule.filled(fill) for rule in getattr(kind, "one_of", ()))
