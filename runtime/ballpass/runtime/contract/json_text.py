"""Text of a record: deterministic JSON with a digest, and records read from it with every fault at its place."""

from __future__ import annotations

import hashlib
import json
import math
import types
from collections.abc import Callable, Mapping
from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

#: Last key of the file: sha256 of its text without this key.
DIGEST = "digest"


def text_of(document: Mapping[str, Any]) -> str:
    """JSON of a document, one entry a line, ending in a newline; ValueError for numbers that are not finite."""
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def text_digest(document: Mapping[str, Any]) -> str:
    """sha256 of a document's text, hexadecimal."""
    return hashlib.sha256(text_of(document).encode()).hexdigest()


def kind_of(value: object) -> str:
    """What a value from JSON is, in words for a message."""
    names = {dict: "an object", list: "a list", str: "a text", bool: "true/false", type(None): "null"}
    return names.get(type(value), f"the number {value!r}")


#: Types of a record's fields, found once: there are hundreds of records in a manifest, and few kinds.
_hints: Callable[[Any], dict[str, Any]] = cache(get_type_hints)


def read_record(hint: Any, value: Any, place: str, faults: list[str]) -> Any:
    """`value` from JSON as the type `hint`; what does not fit goes to `faults` with its place."""

    def refuse(expected: str) -> None:
        faults.append(f"{place or 'document'}: {expected} is expected, not {kind_of(value)}")

    if is_dataclass(hint):
        if not isinstance(value, Mapping):
            return refuse("an object")
        hints = _hints(hint)
        known = {item.name: item for item in fields(hint)}
        prefix = f"{place}." if place else ""
        for key in value:
            if key not in known:
                faults.append(f"{prefix}{key}: unknown key; known here: {', '.join(known)}")
        arguments = {}
        for name, item in known.items():
            if name in value:
                arguments[name] = read_record(hints[name], value[name], prefix + name, faults)
            elif item.default is MISSING or name == "schema":
                faults.append(f"{prefix}{name}: missing")
        return hint(**arguments) if not faults else None  # type: ignore[operator]
    origin, choices = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        if value is None:
            return None
        return read_record(next(choice for choice in choices if choice is not type(None)), value, place, faults)
    if origin is Literal:
        if value not in choices:
            faults.append(f"{place}: one of {', '.join(map(repr, choices))} is expected, not {value!r}")
        return value
    if origin is tuple:
        if not isinstance(value, list):
            return refuse("a list")
        if choices[-1] is Ellipsis:
            return tuple(read_record(choices[0], item, f"{place}[{i}]", faults) for i, item in enumerate(value))
        if len(value) != len(choices):
            faults.append(f"{place}: {len(choices)} entries are expected, not {len(value)}")
            return None
        return tuple(
            read_record(choice, item, f"{place}[{i}]", faults)
            for i, (choice, item) in enumerate(zip(choices, value, strict=True))
        )
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if hint is str:
        return value if isinstance(value, str) else refuse("a text")
    if hint is bool:
        return value if isinstance(value, bool) else refuse("true or false")
    if hint is int:
        return value if number and isinstance(value, int) else refuse("a whole number")
    if hint is float:
        return float(value) if number and math.isfinite(value) else refuse("a finite number")
    raise TypeError(f"{place}: no rule to read {hint}")  # a record of the manifest has a field of a new kind
