"""A JSON Schema of the scene file, by which editors complete and check it.

In: the declared keys.  Out: a schema (draft 2020-12) of the tables, their keys and the allowed values.  Of rules across
keys it has which of them are given (`Either`) and what a law or type decides: a file that it accepts may have faults
that are found only when the file is read.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from posixpath import normpath
from typing import Any

from ballpass.derive.reading.sections import Section, sections
from ballpass.derive.scene.keys import Key, QuantityKey, VectorKey
from ballpass.derive.scene.table import MAX_NAME

DRAFT = "https://json-schema.org/draft/2020-12/schema"
#: A schema that no value fits.  Editors then mark the key; with false Taplo would mark the whole table.
_UNKNOWN: dict[str, Any] = {"not": {}}
#: Keys that stand for a name or a number, as patterns.
_PATTERNS = {"*": rf"^[A-Za-z][A-Za-z0-9_]{{0,{MAX_NAME - 1}}}$", "#": "^[1-9][0-9]*$"}


def json_schema() -> dict[str, Any]:
    """The schema of scene files.

    Examples
    --------
    >>> schema = json_schema()
    >>> schema["properties"]["run"]["properties"]["samples_per_cycle"]["minimum"]
    16
    """
    schema = _table(sections(), ())
    found = schema["properties"]
    for one, several in (("bearing", "bearings"), ("load", "loads")):
        schema.setdefault("$defs", {})[one] = found[one]
        found[one] = {"$ref": f"#/$defs/{one}"}
        found[several] = {"type": "object", "patternProperties": {_PATTERNS["*"]: found[one]}}
        found[several]["additionalProperties"] = _UNKNOWN
    return {"$schema": DRAFT, "title": "Scene of ballpass", **schema}


def meaning(key: Key) -> str:
    """What a key means, and its bounds."""
    filled = key.filled({"row ROW": "each row", ", AXIS": "", "AXIS": "each"}).words
    words = f"{filled[:1].upper()}{filled[1:]}"
    return words if not isinstance(key, QuantityKey) or key.bounds is None else f"{words}, {key.bounds}"


def describe(key: Key) -> str:
    """Text that an editor shows for a key: meaning, unit, example, note."""
    unit = f" [{key.unit}]" if isinstance(key, QuantityKey | VectorKey) and key.unit != "1" else ""
    example = f", as in {key.sample}" if key.example != "" else ""
    text = f"{meaning(key)}{unit}{example}. {key.note[:1].upper()}{key.note[1:]}".rstrip(". ") + "."
    # pages are named as those of the reference name them
    return re.sub(r"\{doc\}`([^`]+)`", lambda page: normpath(f"docs/reference/scene/{page[1]}.md"), text)


def _table(known: Sequence[Section], path: tuple[str, ...]) -> dict[str, Any]:
    own = [section for section in known if section.path == path]
    inner = dict.fromkeys(s.path[len(path)] for s in known if s.path[: len(path)] == path and len(s.path) > len(path))
    entries: dict[str, list[dict[str, Any]]] = {}
    for section in own:
        for name, key in section.keys.items():
            entry = {"description": describe(key), **key.schema()}
            if entry not in entries.setdefault(name, []):
                entries[name].append(entry)
    for name in inner:
        entries.setdefault(name, []).append(_table(known, (*path, name)))
    named = {name: one[0] if len(one) == 1 else {"anyOf": one} for name, one in entries.items()}
    table: dict[str, Any] = {
        "type": "object",
        "properties": {name: entry for name, entry in named.items() if name not in _PATTERNS},
        "patternProperties": {_PATTERNS[name]: entry for name, entry in named.items() if name in _PATTERNS},
        "additionalProperties": {} if any(section.free for section in own) else _UNKNOWN,
    }
    always = [section for section in own if not section.variant[0]]
    required = [_required(section) for section in always]
    table["required"] = [name for name in (required[0] if required else ()) if all(name in one for one in required)]
    table["required"] += dict.fromkeys(section.variant[0] for section in own if section.variant[0])
    table["allOf"] = [rule for section in always for rule in _rules(section)]
    table["allOf"] += [_of_variant(own, value) for value in dict.fromkeys(s.variant for s in own) if value[0]]
    table = {word: value for word, value in table.items() if value or word == "additionalProperties"}
    return {"anyOf": [table, {"type": "array", "items": table}]} if any(s.many for s in own) else table


def _required(section: Section) -> list[str]:
    """Keys that are always needed."""
    some = {key for rule in section.one_of for group in rule.groups for key in group}
    return [
        name
        for name, key in section.keys.items()
        if not (key.optional or key.when or key.needs or key.default is not None or name in some or name in _PATTERNS)
    ]


def _rules(section: Section) -> list[dict[str, Any]]:
    """Of the groups of keys one is given, or one at least."""
    found = []
    for rule in section.one_of:
        given = [{"required": [*group]} for group in rule.groups]
        none = [{"not": {"anyOf": [{"required": [key]} for group in rule.groups for key in group]}}] * rule.optional
        found.append({"anyOf" if rule.several else "oneOf": [*given, *none]})
    return found


def _of_variant(own: Sequence[Section], variant: tuple[str, str]) -> dict[str, Any]:
    """Required and refused keys where a key has this value."""
    tag, value = variant
    chosen = [section for section in own if section.variant == variant]
    kept = {key for section in chosen for key in section.keys}
    others = dict.fromkeys(key for section in own for key in section.keys if key not in kept)
    then = {"required": _required(chosen[0]), "properties": dict.fromkeys(others, _UNKNOWN), "allOf": _rules(chosen[0])}
    then = {word: rules for word, rules in then.items() if rules or word != "allOf"}
    return {"if": {"properties": {tag: {"const": value}}, "required": [tag]}, "then": then}
