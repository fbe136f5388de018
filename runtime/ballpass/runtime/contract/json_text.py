"""Records from plain values, as JSON gives them, and plain values for JSON.  JSON has no infinity."""

from __future__ import annotations

import math
import types
from collections.abc import Callable
from dataclasses import is_dataclass
from functools import cache
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

#: Types of a record's fields, found once: there are hundreds of records in a manifest, and few kinds.
_hints: Callable[[Any], dict[str, Any]] = cache(get_type_hints)


def finite(value: Any) -> Any:
    """Plain values at any depth with None for numbers that are not finite."""
    if isinstance(value, dict):
        return {name: finite(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value


def from_plain(kind: Any, value: Any, place: str) -> Any:
    """A value from JSON as the type `kind`.

    Raises
    ------
    ValueError
        It is of another type, or has other keys; with its place.
    """
    origin, choices = get_origin(kind), get_args(kind)
    if is_dataclass(kind) and isinstance(value, dict):
        hints = _hints(kind)
        strange = value.keys() - hints.keys()
        if strange:
            raise ValueError(f"{place}: unknown keys {', '.join(sorted(strange))}")
        try:
            return kind(**{name: from_plain(hints[name], item, f"{place}.{name}") for name, item in value.items()})  # type: ignore[operator]
        except TypeError as fault:  # a key is missing
            raise ValueError(f"{place}: {fault}") from None
    if origin is tuple and isinstance(value, list):
        kinds = (choices[0],) * len(value) if choices[-1] is Ellipsis else choices
        if len(kinds) == len(value):
            return tuple(
                from_plain(one, item, f"{place}[{k}]") for k, (one, item) in enumerate(zip(kinds, value, strict=True))
            )
    if origin in (Union, types.UnionType):
        return None if value is None else from_plain(choices[0], value, place)
    if origin is Literal:
        fits = value in choices
    else:
        plain = (int, float) if kind is float else kind
        fits = origin is None and isinstance(value, plain) and (kind is bool or not isinstance(value, bool))
    if kind is str:  # of titles and names, which are printed: nothing that a terminal obeys
        kind, fits = "printable text", fits and value.isprintable()
    if not fits:
        raise ValueError(f"{place}: {kind} is expected, not {value!r:.80}")
    return float(value) if kind is float else value
