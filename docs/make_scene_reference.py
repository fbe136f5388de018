"""The tables of keys in the pages of docs/reference/scene/, from the declarations of the keys.

A table stands between two comments, of which the first names the tables of the scene file that it is made of.  Run it
after a change of a key: ``python docs/make_scene_reference.py``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from ballpass.derive.reading.json_schema import meaning
from ballpass.derive.reading.sections import Section, sections
from ballpass.derive.scene.keys import ChoiceKey, Key, QuantityKey, VectorKey, WholeKey
from ballpass.derive.scene.read_keys import Either

PAGES = sorted((Path(__file__).parent / "reference" / "scene").glob("*.md"))
TABLE = re.compile(r"(<!-- (keys|usual)(.*?) -->\n).*?(<!-- end -->)", re.DOTALL)


def page(text: str) -> str:
    """The page with its tables made anew."""
    known = sections()

    def made(match: re.Match[str]) -> str:
        rows = usual_rows(known) if match[2] == "usual" else key_rows(known, match[3].split())
        return f"{match[1]}{rows}\n{match[4]}"

    return TABLE.sub(made, text)


def key_rows(known: Sequence[Section], paths: Sequence[str]) -> str:
    """A table of the keys of some tables; those inside another one have its name in front."""
    found: dict[str, list[tuple[Section, Key]]] = {}
    bases = [path for path in paths if not any(path.startswith(f"{other}.") for other in paths)]
    tables: dict[str, list[Section]] = {}
    for path in paths:
        base = next(base for base in bases if path == base or path.startswith(f"{base}."))
        inside = path.removeprefix(base).removeprefix(".")
        for section in known:
            if ".".join(section.path) == ("" if path == "top" else path):
                tables.setdefault(inside, []).append(section)
                for name, key in section.keys.items():
                    name = {"*": "<name>", "#": "<number>"}.get(name, name)
                    found.setdefault(f"{inside}.{name}".lstrip(".").replace("#", "<number>"), []).append((section, key))
    lines = ["| key | unit | example | | meaning |", "| --- | --- | --- | --- | --- |"]
    for name, uses in found.items():
        inside = name.rpartition(".")[0].replace("<number>", "#")
        units = distinct(key.unit.replace("*", "·") for _, key in uses if isinstance(key, QuantityKey | VectorKey))
        examples = distinct(example(key) for _, key in uses)
        lines.append(
            f"| `{name}` | {' or '.join(units) if units != ['1'] else ''} | {' or '.join(examples)} | "
            f"{needed(uses, tables.get(inside, []))} | {'; '.join(distinct(words(key) for _, key in uses))} |"
        )
    return "\n".join(lines)


def distinct(texts: object) -> list[str]:
    """Texts once each, empty ones not at all."""
    return [text for text in dict.fromkeys(texts) if text]  # type: ignore[call-overload]


def example(key: Key) -> str:
    """What may stand there."""
    if isinstance(key, ChoiceKey | VectorKey) or key.example == "":
        return ""
    return f"`{key.sample}`"


def words(key: Key) -> str:
    """What it is; lower case, for it stands in a table."""
    text = re.sub(r"<(\w+)>", r"`<\1>`", meaning(key))
    if isinstance(key, ChoiceKey):
        text += ": " + ", ".join(f'`"{choice}"`' for choice in key.choices)
    if isinstance(key, WholeKey):
        text += f", {key.lowest} to {key.highest}" if key.highest < 2**62 else ""
    note = re.sub(r"<(\w+)>", r"`<\1>`", key.note) if "`" not in key.note else key.note
    return text + (f"; {note}" if note else "")


def needed(uses: Sequence[tuple[Section, Key]], tables: Sequence[Section]) -> str:
    """Whether the key is needed, and for which values of the key that decides it."""
    variants = distinct(section.variant[1] for section in tables)
    needed: dict[str, list[str]] = {}
    for section, key in uses:
        needed.setdefault(need(section, key), []).append(section.variant[1])
    texts = []
    for text, values in needed.items():
        some = distinct(values)
        whole = not variants or len(some) == len(variants) or not some
        texts.append(text if whole else f"{', '.join(f'`{value}`' for value in some)}: {text}")
    return "; ".join(texts)


def need(section: Section, key: Key) -> str:
    """Whether it is needed."""
    name = next(name for name, other in section.keys.items() if other is key)
    text = key.when or ("optional" if key.optional else "required")
    if not key.when and key.default is not None:
        text = f"default {key.default}"
    if not key.when and key.needs:
        text = f"{text} with {' and '.join(f'`{one}`' for one in key.needs)}, else refused"
    for rule in section.one_of:
        for group in rule.groups:
            if name in group and not key.when:
                text = choice(name, group, rule)
    return text + ("; setting" if isinstance(key, QuantityKey) and key.setting else "")


def choice(name: str, group: Sequence[str], rule: Either) -> str:
    """When a key of a group is needed, of which one is given."""
    others = [" and ".join(f"`{key}`" for key in one) for one in rule.groups if name not in one]
    if rule.several:
        return f"this, {', '.join(others)}, or both"
    beside = "".join(f" with `{other}`" for other in group if other != name)
    return f"this{beside} or {' or '.join(others)}" if others else f"optional,{beside}"


def usual_rows(known: Sequence[Section]) -> str:
    """A table of the ranges in which numbers usually lie."""
    found: dict[str, list[str]] = {}
    for section in known:
        for name, key in section.keys.items():
            usual = key.usual if isinstance(key, QuantityKey) else None
            if not isinstance(key, QuantityKey) or usual is None:
                continue
            unit = f" of `{usual.of}`" if usual.of else f" {key.unit}" * (key.unit != "1")
            span = f"{usual.least:.4g} to {usual.most:.4g}" if usual.least is not None else f"up to {usual.most:.4g}"
            path = ".".join((*section.path, name)).replace("*", "<name>").replace("#", "<number>")
            found.setdefault(span + unit, []).append(f"`{path}`")
    rows = (f"| {', '.join(distinct(names))} | {usual} |" for usual, names in found.items())
    return "\n".join(("| number | usual |", "| --- | --- |", *rows))


if __name__ == "__main__":
    for path in PAGES:
        path.write_text(page(path.read_text(encoding="utf-8")), encoding="utf-8")
