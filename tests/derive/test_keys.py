"""Claims about the declared keys: page, schema and reader say the same of them."""

from __future__ import annotations

import importlib.util
import json
import math
import re
import tomllib
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jsonschema
import pytest
from scene_texts import PRESS, SCENES, edited

from ballpass.derive.reading.json_schema import json_schema
from ballpass.derive.reading.read import read_scene, scene_from_text
from ballpass.derive.reading.sections import sections
from ballpass.derive.scene.errors import SceneError
from ballpass.derive.scene.keys import (
    ChoiceKey,
    ColumnKey,
    Key,
    NamesKey,
    PairKey,
    QuantityKey,
    TextKey,
    VectorKey,
    WholeKey,
)
from ballpass.derive.scene.quantity import Bounds
from ballpass.derive.scene.read_keys import read_keys
from ballpass.derive.scene.table import MISSPELT, Collector, Table
from ballpass.derive.scene.toml_lines import LineIndex
from ballpass.derive.scene.units import COMMON, KINDS

DOCS = Path(__file__).parents[2] / "docs"
VALIDATOR = jsonschema.Draft202012Validator(json_schema())
KEYS = {
    f"{'.'.join((*section.path, name))}{'=' * bool(section.variant[1])}{section.variant[1]}": key
    for section in sections()
    for name, key in section.keys.items()
}


#: Neither stiff nor damped.
WITHOUT_LAW = '[mechanism.springs.s]\nbodies = ["frame", "rod"]\npoints = ["A", "B"]\npreload = "1 N"\n'


def refused(text: str) -> list[str]:
    """Places that the schema refuses, with the value of each."""
    return [".".join(map(str, error.absolute_path)) for error in VALIDATOR.iter_errors(tomllib.loads(text))]


def collected(data: dict[str, Any]) -> Table:
    return Table(Collector(lines=LineIndex(lines={})), (), data)


def test_schema_is_one_and_names_pages_by_their_files() -> None:
    jsonschema.Draft202012Validator.check_schema(VALIDATOR.schema)
    text = json.dumps(VALIDATOR.schema)
    pages = set(re.findall(r"docs/[\w/]+\.md", text))
    assert len(pages) > 4
    assert all((SCENES.parent / page).is_file() for page in pages)
    assert "{doc}" not in text


@pytest.mark.parametrize("file", sorted(SCENES.glob("*.toml")), ids=lambda file: file.stem)
def test_shipped_scenes_fit_the_schema(file: Path) -> None:
    assert refused(file.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ('clearance = "10 um"', 'clearence = "10 um"', "bearing.clearence"),
        ('mass = "2.55 kg"', 'mas = "2.55 kg"', "mechanism.bodies.rod.mas"),
        ("balls = 8", "balls = 2", "bearing.balls"),
        ("share = 0.5", 'share = "half"', "bearing.share"),
        ('law = "one-sided"\n', 'law = "twosided"\n', "bearing.damping.law"),
        ('law = "one-sided"\nratio', 'law = "hunt-crossley"\nratio', "bearing.damping.ratio"),
        ('pitch_diameter = "33.5 mm"', 'pitch_diameter = "wide"', "bearing.pitch_diameter"),
        ('pitch_diameter = "33.5 mm"', "pitch_diameter = 33.5", "bearing.pitch_diameter"),
        ("cycles = 4 ", 'cycles = 4\nduration = "1 s"\n#', "run"),
        ('title = "P', f'title = "{"P" * 200}', "title"),
        ("[bearing.initial]", "[bearing.inital]", "bearing.inital"),
        ("[mechanism.joints.A]", f"{WITHOUT_LAW}[mechanism.joints.A]", "mechanism.springs.s"),
    ],
)
def test_schema_marks_what_the_reader_refuses(old: str, new: str, place: str) -> None:
    text = edited(PRESS, old, new)
    assert place in refused(text)
    with pytest.raises(SceneError) as caught:
        scene_from_text(text, "press")
    assert place in [fault.key for fault in caught.value.faults]


@pytest.mark.parametrize("name", KEYS)
def test_example_and_default_of_a_key_are_what_it_takes(name: str) -> None:
    """Each is read without a fault, lies within the bounds, and fits the schema of its key."""
    key = KEYS[name]
    assert key.words
    values: list[Any] = []
    if not isinstance(key, ChoiceKey | VectorKey | NamesKey) and key.example != "":
        values.append(tomllib.loads(f"x = {key.sample}")["x"])
    if key.default not in (None, ""):
        values.append([key.default] * 2 if isinstance(key, PairKey) else key.default)
    for given in values:
        given = list(given) if isinstance(given, tuple) else given
        table = collected({"x": given})
        value = key.read(table, "x")
        assert table.collector.faults == []
        jsonschema.validate(given, key.schema())
        if isinstance(key, QuantityKey) and not isinstance(key, ColumnKey | PairKey):
            found = value if key.setting else value.value
            assert math.isfinite(found)
            assert key.bounds is None or key.bounds.problem(found) == ""


@pytest.mark.parametrize("file", sorted(SCENES.glob("*.toml")), ids=lambda file: file.stem)
def test_every_number_of_a_shipped_scene_keeps_the_limits_of_its_key(file: Path) -> None:
    """Limits come with the number, so that --set, ensembles and the manifest meet those of the file."""
    unlimited = {"m", "rad", "rad/s", "N", "m/s^2", "m/s", "s", "Hz", "N*m"}  # coordinates, angles, forces, speeds
    for quantity in read_scene(file).quantities:
        free = quantity.unit in unlimited or quantity.path.endswith(".share")  # by levers any number
        free |= ".pressure" in quantity.path  # above that of the atmosphere it may be negative
        assert quantity.limits.bounds is not None or free, quantity.path


def test_placeholders_are_filled_once() -> None:
    """A body may be called like a placeholder."""
    assert (
        QuantityKey(unit="kg", words="Mass of the NAME").filled({"NAME": "INDEX", "INDEX": "x"}).words.endswith("INDEX")
    )


def test_pages_are_those_of_the_keys() -> None:
    """Made anew they are the same: python docs/make_scene_reference.py"""
    spec = importlib.util.spec_from_file_location("make_scene_reference", DOCS / "make_scene_reference.py")
    assert spec is not None
    assert spec.loader is not None
    maker = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(maker)
    assert len(maker.PAGES) > 20
    for path in maker.PAGES:
        text = path.read_text(encoding="utf-8")
        assert maker.page(text) == text, path


def test_pages_have_every_key_and_no_placeholder() -> None:
    text = "".join(path.read_text(encoding="utf-8") for path in (DOCS / "reference" / "scene").glob("*.md"))
    left = re.findall(r"\b(?!CSV|TOML|UTF|ISO|JSON|PATH|RRR|RRP|RPR|RPP|PRP|NetCDF)[A-Z_]{3,}\b", text)
    assert left == []
    missing = [
        path
        for path in KEYS
        if (name := path.partition("=")[0].rpartition(".")[2]) not in "*#" and f"{name}`" not in text
    ]
    assert missing == []


@pytest.mark.parametrize("key", [WholeKey(lowest=1, highest=3), TextKey(longest=3), ChoiceKey(choices=("a", "b"))])
@pytest.mark.parametrize("given", [0, 2, 4, True, "a", "abcd", "a\nb", 1.5, [], {}])
def test_key_and_its_schema_refuse_the_same(key: Key, given: object) -> None:
    table = collected({"x": given})
    key.read(table, "x")
    fits = jsonschema.Draft202012Validator(key.schema()).is_valid(given)
    assert fits or table.collector.faults, SimpleNamespace(key=key, given=given)


@pytest.mark.parametrize("unit", sorted(KINDS))
def test_schema_refuses_usual_units_of_another_dimension_and_signs_as_the_reader_does(unit: str) -> None:
    key = QuantityKey(unit=unit, setting=True, bounds=Bounds(least=0.0))
    validator = jsonschema.Draft202012Validator(key.schema())
    for name in ("", *COMMON, unit, "furlong"):
        for sign in ("", "-"):
            given = f"{sign}2.5 {name}".strip()
            table = collected({"x": given})
            key.read(table, "x")
            fits = validator.is_valid(given)
            assert fits or table.collector.faults, given
            if name != "furlong" and (sign or name.isascii()):
                assert not (fits and table.collector.faults), given


def test_no_key_is_taken_for_another_one_that_is_misspelt() -> None:
    """Those that are as like each other as misspelt ones become known together, so that none is unknown when read."""
    tables: dict[tuple[str, ...], set[str]] = {}
    for section in sections():
        tables.setdefault(section.path, set()).update(section.keys)
    like = {
        (*path, one): other
        for path, keys in tables.items()
        for one in keys
        for other in get_close_matches(one, sorted(keys - {one}), n=1, cutoff=MISSPELT)
    }
    together = {"fit", "contact", "equivalent_mass", "initial"}
    assert {path[-2] for path in like} == together, like


def test_schema_requires_the_law_that_decides_about_other_keys() -> None:
    text = (SCENES / "rotor.toml").read_text(encoding="utf-8")
    assert refused(text) == []
    assert refused(text.replace('law = "none"', "")) == ["bearing.damping"]


@pytest.mark.parametrize("name", [name for name, key in KEYS.items() if key.needs])
def test_a_key_is_refused_where_the_scene_does_not_say_what_it_needs(name: str) -> None:
    """And is no fault where a value that it needs is unknown, which has been reported, or where it is not given."""
    key, own = KEYS[name], name.rpartition(".")[2]
    given = {own: key.choices[0] if isinstance(key, ChoiceKey) else tomllib.loads(f"x = {key.sample}")["x"]}
    met: dict[str, Any] = {need.key: need.value or "given" for need in key.needs}

    def read(data: dict[str, Any], facts: dict[str, Any]) -> tuple[Any, list[Any]]:
        with collected(data) as table:
            value = read_keys(table, {own: replace(key, optional=True)}, facts=facts)[own]
        return value, table.collector.faults

    for need in key.needs:
        value, (fault,) = read(given, {**met, need.key: "another" if need.value else None})
        assert value is None
        assert (fault.key, fault.problem, fault.allowed) == (own, need.why, f"{own} only with {need}")
        assert fault.remedy
        assert read({}, {**met, need.key: "another" if need.value else None}) == (None, [])
        if need.value:
            assert read(given, {**met, need.key: None}) == (None, [])
    value, faults = read(given, met)
    assert value is not None
    assert faults == []
