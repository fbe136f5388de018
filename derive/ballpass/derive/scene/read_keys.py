"""Keys at the fields of records, and a table of the scene file read by them.

In: a table, and a record whose fields are declared with keys.  Out: the record; faults are noted in the table.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from types import MappingProxyType
from typing import Any, TypeVar

from ballpass.derive.scene.keys import ColumnKey, Fill, Key, QuantityKey
from ballpass.derive.scene.quantity import NOT_NEGATIVE, POSITIVE
from ballpass.derive.scene.table import Table

Record = TypeVar("Record")
_NOTHING: Fill = MappingProxyType({})


@dataclass(frozen=True, slots=True, kw_only=True)
class Either:
    """Groups of keys of which a table gives exactly one.

    Attributes
    ----------
    what : name of what they give, "the coefficient"
    groups : of keys, the usual one first; the keys of the other groups are None
    at : key that a second group is reported at; the table itself by default
    optional : none may be given
    """

    what: str
    groups: tuple[tuple[str, ...], ...]
    at: str = ""
    optional: bool = False

    def choose(self, table: Table, keys: Mapping[str, Key]) -> tuple[str, ...]:
        """The group that is given; where there is none, none, with a fault unless optional; the first of several."""
        table.know(*(key for group in self.groups for key in group))
        given = [group for group in self.groups if any(key in table.data for key in group)]
        if table.missing or len(given) == 1 or (self.optional and not given):
            return given[0] if given else ()
        found = [[key for key in group if key in table.data] for group in given]
        samples = [[f"{key} = {keys[key].sample}" if key in keys else key for key in group] for group in self.groups]
        table.fault(
            self.at if given else "",
            f"{self.what} is given twice" if given else f"{self.what} is missing",
            given=" and ".join(key for group in found for key in group) or "neither",
            allowed="either " + ", or ".join(" and ".join(group) for group in samples),
            remedy="delete one of the two: " + ", or ".join(f"delete {' and '.join(group)}" for group in found)
            if given
            else f"add {' and '.join(samples[0])}",
        )
        return given[0] if given else ()


def declared(key: Key) -> Any:
    """A field of a record that the key fills; None where it may be left out."""
    metadata = {"key": key}
    return field(default=None, metadata=metadata) if key.optional else field(metadata=metadata)


def number(unit: str, words: str, symbol: str = "", example: Any = "", **more: Any) -> QuantityKey:
    """The key of a number; `more` as in `QuantityKey`."""
    return QuantityKey(unit=unit, words=words, symbol=symbol, example=example, **more)


def quantity(unit: str, words: str, symbol: str = "", example: Any = "", **more: Any) -> Any:
    """A field that a number fills."""
    return declared(number(unit, words, symbol, example, **more))


def positive(unit: str, words: str, symbol: str = "", example: Any = "", **more: Any) -> Any:
    """A field that a number above zero fills."""
    return quantity(unit, words, symbol, example, bounds=POSITIVE, **more)


def not_negative(unit: str, words: str, symbol: str = "", example: Any = "", **more: Any) -> Any:
    """A field that a number from zero on fills."""
    return quantity(unit, words, symbol, example, bounds=NOT_NEGATIVE, **more)


def column(unit: str, words: str, symbol: str, **more: Any) -> Any:
    """A field that the column of a table fills."""
    return declared(ColumnKey(unit=unit, words=words, symbol=symbol, **more))


def keys_of(kind: type[Any], fill: Fill = _NOTHING) -> dict[str, Key]:
    """Keys by their names in the file, in the order of a record's fields."""
    found = (key.filled(fill) for key in _keys(kind).values())
    return {key.name or name: key for name, key in zip(_keys(kind), found, strict=True)}


def _keys(kind: type[Any]) -> dict[str, Key]:
    return {f.name: f.metadata["key"] for f in fields(kind) if "key" in f.metadata}


def read_keys(table: Table, keys: Mapping[str, Key], either: Either | None = None) -> dict[str, Any]:
    """Values of all keys, by name."""
    table.know(*keys)
    chosen = either.choose(table, keys) if either is not None else ()
    left_out = {key for group in either.groups for key in group} - set(chosen) if either is not None else set()
    return {name: None if name in left_out else key.read(table, name) for name, key in keys.items()}


def read_record(kind: type[Record], table: Table, fill: Fill = _NOTHING, **known: Any) -> Record:
    """A record from its keys; fields that are `known` are not read."""
    keys = {name: key.filled(fill) for name, key in _keys(kind).items() if name not in known}
    names = {name: key.name or name for name, key in keys.items()}
    values = read_keys(table, {names[name]: key for name, key in keys.items()}, getattr(kind, "either", None))
    return kind(**{name: values[names[name]] for name in keys}, **known)
