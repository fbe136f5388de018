"""A scene file to a `Scene`.

In: the path of a TOML file, or its text.  Out: the frozen record in SI, every value checked.  A scene is data: nothing
in it is evaluated.  All faults of a file are raised together, as one `SceneError`.

Keys are declared at the records that they fill (`ballpass.derive.scene.keys`).  Rules across them are in `read_*.py`;
those that need nothing but numbers are in `values.py`, since `--set` repeats them.
"""

from __future__ import annotations

import re
import shlex
import tomllib
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from ballpass.derive.mechanism.assembly import assemble
from ballpass.derive.reading.change_coupling import Coupling, recoupled
from ballpass.derive.reading.read_duty import duty_faults
from ballpass.derive.reading.read_tables import TABLES, read_tables
from ballpass.derive.reading.values import parse_override, value_faults, with_values
from ballpass.derive.scene.errors import Fault, SceneError
from ballpass.derive.scene.file_columns import with_columns
from ballpass.derive.scene.records import Scene
from ballpass.derive.scene.shipped import shipped_scenes
from ballpass.derive.scene.table import Collector, Table, listing
from ballpass.derive.scene.toml_lines import deep_key, index_lines
from ballpass.derive.scene.units import show
from ballpass.runtime.contract.arguments import typed
from ballpass.runtime.contract.folders import read_file
from ballpass.runtime.contract.plugins import use

__all__ = ["parse_override", "read_scene", "scene_from_text", "with_values"]

#: Largest file that is read [bytes]; the largest sensible one is a table of loads.
MAX_FILE_SIZE = 8_000_000

#: What to do with a measured signal in the place of a scene.
_RECORDED = (
    "a measured signal goes with a scene: `ballpass spectrum SCENE --recording FILE` names its lines, "
    "`ballpass fit SCENE FILE` finds numbers"
)


@typed
def read_scene(
    path: str | Path,
    coupling: Coupling | None = None,
    changes: Mapping[str, Any] | None = None,
    name: str | None = None,
    *,
    plugins: Sequence[str] = (),
) -> Scene:
    """Read a scene file.

    With a `coupling` it is the variant of the scene whose bearings are all coupled so (see `recouple`), and of another
    name.

    Parameters
    ----------
    changes : tables and values that replace those of the file or are added; None removes one
    name : of the scene; the file's stem by default
    plugins : modules, or files of them, with laws and more of your own; known from then on

    Raises
    ------
    SceneError
        With all faults of the file.

    Examples
    --------
    >>> scene = read_scene("scenes/rotor.toml")
    >>> scene.name, scene.bearing.balls
    ('rotor', 8)
    """
    use(plugins)
    file = Path(path)
    try:
        data = read_file(file, MAX_FILE_SIZE)
    except OSError as error:
        raise _unreadable(
            file, error.strerror or type(error).__name__, f"give the path of a scene file (TOML){_copy_of(file)}"
        ) from None
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise _unreadable(file, "the file is not text in UTF-8", "save the file as UTF-8", line) from None
    return _scene(
        text, name or name_of_file(file), str(file), coupling, {str(key): item for key, item in (changes or {}).items()}
    )


def name_of_file(file: Path) -> str:
    """Name of a scene in code and messages: the file's without ending, other characters than ASCII letters as "_".

    Examples
    --------
    >>> name_of_file(Path("scenes/3rd test-prüfung.toml"))
    'scene_3rd_test_pruefung'
    """
    written = re.sub("[äöüÄÖÜ]", lambda letter: f"{letter[0]}e", file.stem).replace("ß", "ss")
    plain = unicodedata.normalize("NFKD", written).encode("ascii", "ignore").decode()
    name = re.sub(r"\W+", "_", plain)
    return name if name[:1].isalpha() else f"scene_{name}"


def scene_from_text(text: str, name: str) -> Scene:
    """Read a scene from the text of its file.

    Raises
    ------
    SceneError
        With all faults of the text.
    """
    return _scene(text, name, None)


def _copy_of(file: Path) -> str:
    """How to get a missing file, in words: with its own name where it comes with ballpass."""
    if file.exists():
        return ""
    name = next((name for name, scene in shipped_scenes().items() if scene.name == file.name), None)
    if name is None:
        return "; `ballpass new --list` names those that come with ballpass"
    folder = "" if file.parent == Path() else f" {shlex.quote(str(file.parent))}"
    return f"; this one comes with ballpass: `ballpass new {name}{folder}` copies it"


def _unreadable(file: Path, problem: str, remedy: str, line: int | None = None) -> SceneError:
    return Fault(
        key="",
        problem=f"the scene file cannot be read: {problem}",
        given=show(str(file), 200),
        allowed="",
        remedy=remedy,
        line=line,
    ).error(file)


def _merged(data: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Tables with changes applied, at any depth."""
    found = dict(data)
    for key, value in changes.items():
        if isinstance(value, Mapping):
            before = found.get(key)
            value = _merged(before if isinstance(before, Mapping) else {}, value)
        found[key] = value
    return {key: value for key, value in found.items() if value is not None}


def _scene(
    text: str,
    name: str,
    source: str | None,
    coupling: Coupling | None = None,
    changes: Mapping[str, Any] = MappingProxyType({}),
) -> Scene:
    data = _merged(_parse(text, source), changes)
    if coupling is not None:
        data, name = recoupled(data, coupling), f"{name}_{coupling.replace('-', '_')}"
    collector = Collector(lines=index_lines(text))
    collector.check_name((), name, "scene file")
    if not any(key in data for key in TABLES):
        collector.fault(
            (),
            "the file describes nothing" if data else "the file is empty",
            given=listing(list(data)[:10]),
            allowed="tables " + listing(TABLES),
            remedy="copy one of the files in scenes/ and change it",
        )
        raise SceneError(collector.faults, source=source)
    notes: list[str] = []
    data = with_columns(data, None if source is None else Path(source).parent, collector.faults, notes)
    scene = read_tables(Table(collector, (), data), name)
    faults = [*collector.faults, *value_faults(scene, collector.given)]
    faults = faults or duty_faults(scene)
    if not faults:
        return replace(scene, lines=collector.lines, notes=tuple(notes))
    topology, none = ("mechanism.joints", "mechanism.gears", "mechanism.driver"), ("mechanism", "mechanism.bodies")
    places = [fault.key for fault in collector.faults]
    if scene.mechanism is not None and not any(key.startswith(topology) or key in none for key in places):
        # faults that the derivation would find next are reported with the rest
        try:
            assemble(scene.mechanism)
        except SceneError as error:
            faults += error.faults
    raise SceneError(collector.lines.place(faults), source=source)


def _parse(text: str, source: str | None) -> dict[str, Any]:
    deep = deep_key(text)
    if deep is not None:
        raise Fault(
            key="",
            problem="a key with more than 64 dots",
            given=show(text.split("\n")[deep - 1].strip()),
            allowed="keys of a few parts, as in mechanism.bodies.crank",
            remedy="check whether this is a scene file (TOML)",
            line=deep,
        ).error(source)
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        # tomllib raises ValueError itself for integers of more than 4300 digits.
        message = str(error) if isinstance(error, tomllib.TOMLDecodeError) else type(error).__name__
        place = re.search(r"\(at line (\d+), column (\d+)\)", message)
        lines = text.split("\n")
        line = int(place.group(1)) if place else max(len(lines), 1)
        raise Fault(
            key="",
            problem=f"this is not TOML: {message}",
            given=show(lines[line - 1].strip()) if 0 < line <= len(lines) else "",
            allowed='key = "value", [table], comments after "#"',
            remedy=_RECORDED
            if Path(source or "").suffix in (".csv", ".dat", ".tsv", ".txt")
            else "check quotes, brackets and commas in this line and in the one before it",
            line=line,
        ).error(source) from None
