"""Read the specification of a data set, for ``ballpass dataset``.

In: the path of a TOML file.  Out: a `DataSetSpec`: scenes, distributions and what is recorded, in SI, all checked.  The
schema is in `docs/reference/data_sets.md`.  `ballpass.derive` is imported inside functions.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.folders import read_file
from ballpass.runtime.many.distributions import Distribution, plain_arguments
from ballpass.runtime.many.signals import PRECISIONS, Signals
from ballpass.runtime.vibration.sensor import Sensor, read_sensor

if TYPE_CHECKING:
    from ballpass.derive import Scene
    from ballpass.derive.scene.errors import Fault
    from ballpass.derive.scene.table import Table

#: Largest seed, as long as integers of most programs.
MOST_SEED = 2**63 - 1

#: Bytes of a specification at most.
LARGEST_SPEC = 10_000_000

#: Most members of a class.
MOST_MEMBERS = 10_000_000

_EXAMPLE = '{ distribution = "uniform", loc = "5 um", scale = "10 um" }'


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassSpec:
    """One class: its scene, how many members, and what varies [SI]."""

    label: str
    scene: Scene
    members: int
    parameters: Mapping[str, Distribution | float]


@dataclass(frozen=True, slots=True, kw_only=True)
class DataSetSpec:
    """A file, read."""

    title: str
    seed: int
    chunk: int | None
    signals: Signals
    classes: tuple[ClassSpec, ...]


def read_spec(path: Path) -> DataSetSpec:
    """Read the specification of a data set, and the scenes it names; scenes lie in its folder unless a path is given.

    Raises
    ------
    SceneError
        With all faults of the file, or of a scene.
    """
    from ballpass.derive import SceneError
    from ballpass.derive.scene.errors import Fault
    from ballpass.derive.scene.keys import TextKey, WholeKey
    from ballpass.derive.scene.table import Collector, Table
    from ballpass.derive.scene.toml_lines import index_lines

    try:
        text = read_file(path, LARGEST_SPEC).decode("utf-8-sig")
        data = tomllib.loads(text)
    except (OSError, ValueError) as fault:
        problem = f"the file cannot be read: {getattr(fault, 'strerror', None) or fault}"
        remedy = "give the path of a TOML file; `ballpass new bearing-faults` copies one"
        one = Fault(key="", problem=problem, given=str(path), allowed="a specification of a data set", remedy=remedy)
        raise SceneError([one], source=path) from None
    collector = Collector(lines=index_lines(text))
    collector.check_name((), path.stem, "data set")
    with Table(collector, (), data) as root:
        title = TextKey(default="").read(root, "title") or path.stem
        seed = WholeKey(lowest=0, highest=MOST_SEED, example=1).read(root, "seed")
        chunk = WholeKey(lowest=1, highest=MOST_MEMBERS, example=32, optional=True).read(root, "chunk")
        signals, outputs = _read_signals(root, path.parent)
        members = WholeKey(lowest=1, highest=MOST_MEMBERS, example=1000, optional=True)
        default = members.read(root, "members")
        base = TextKey(example="scene.toml", optional=True).read(root, "scene") or None
        common = root.table("parameters", required=False)
        classes = root.table("classes", "a table for each class, as in [classes.healthy]")
        if not classes.missing and not classes.data:
            classes.fault("", "there is no class", allowed="[classes.NAME]", remedy="add [classes.healthy]")
        found = []
        for label in classes.names("class"):
            with classes.table(label) as table:
                found.append(_read_class(table, path, label, base, default, outputs, common))
    for name in common.data:
        if found and not any(scene is None or name in units for scene, _, _, units in found):
            known = sorted({key for _, _, _, units in found for key in units})
            collector.faults.append(_unknown(f'parameters."{name}"', name, known))
    if collector.faults or signals is None:  # a fault of shared keys is found with each class
        raise SceneError(dict.fromkeys(collector.lines.place(collector.faults)), source=path)
    specs = [
        ClassSpec(label=label, scene=scene, members=members, parameters=parameters)
        for label, (scene, members, parameters, _) in zip(classes.data, found, strict=True)
        if scene is not None
    ]
    return DataSetSpec(title=title, seed=seed, chunk=chunk, signals=signals, classes=tuple(specs))


def _read_signals(root: Table, folder: Path) -> tuple[Signals | None, list[str]]:
    """The signals to record, and the names of the outputs; None where something is wrong."""
    from ballpass.derive.scene.keys import ChoiceKey, QuantityKey

    before = len(root.collector.faults)
    outputs = _names(root, "outputs", '["inner.ax"]')
    quantities = _names(root, "quantities", '["peak_ball_force"]') if root.has("quantities") else []
    sample_rate = QuantityKey(unit="Hz", example="25.6 kHz", setting=True).read(root, "sample_rate")
    duration = QuantityKey(unit="s", example="1 s", setting=True).read(root, "duration")
    transient = QuantityKey(unit="s", example="0.2 s", default="0 s", setting=True).read(root, "transient")
    rtol = QuantityKey(unit="1", example=1e-6, setting=True, optional=True).read(root, "rtol")
    precision = ChoiceKey(choices=PRECISIONS, default=PRECISIONS[0]).read(root, "precision")
    snr = _read_value(root, "snr", root.data["snr"], "1") if root.has("snr") else None
    sensor = _read_sensor(root, folder)
    if len(root.collector.faults) > before or precision is None:
        return None, []
    try:
        signals = Signals(
            outputs=tuple(dict.fromkeys(outputs)),
            sample_rate=sample_rate,
            duration=duration,
            transient=transient,
            snr=snr,
            rtol=rtol,
            precision=precision,
            quantities=tuple(dict.fromkeys(quantities)),
            sensor=sensor,
        )
    except RequestError as fault:
        for line in str(fault).splitlines():
            name, _, rest = line.partition(": ")
            problem, _, allowed = rest.partition(" Allowed: ")
            root.fault(name, problem, allowed=allowed, remedy="correct the value")
        return None, []
    return signals, list(signals.outputs)


def _read_sensor(root: Table, folder: Path) -> Sensor | None:
    """The sensor; None where there is none, or where something is wrong with it."""
    given = root.table("sensor", required=False)
    if given.missing:
        return None
    try:
        return read_sensor(given.data, folder)
    except RequestError as fault:
        name, _, problem = str(fault).partition(": ")
        given.fault(name, problem, allowed="numbers of a sensor", remedy="see the reference of data sets")
        return None


def _names(root: Table, key: str, example: str) -> Any:
    """A list of names; anything else is reported."""
    given = root.take(key, example)
    if given is not None and not (isinstance(given, list) and given and all(isinstance(name, str) for name in given)):
        allowed = f"a list of names such as {example}"
        root.fault(key, "this is no list of names", given=repr(given), allowed=allowed, remedy="write names")
    return given


def _read_class(
    table: Table, path: Path, label: str, base: str | None, default: int | None, outputs: list[str], common: Table
) -> tuple[Scene | None, int, dict[str, Distribution | float], dict[str, str]]:
    """Scene (None where it is wrong), members, parameters, and the units of the scene's numbers."""
    from ballpass.derive import SceneError, read_scene
    from ballpass.derive.scene.keys import TextKey, WholeKey

    file = TextKey(example="scene.toml", default=base).read(table, "scene")
    members = WholeKey(lowest=1, highest=MOST_MEMBERS, example=1000, default=default).read(table, "members")
    changes = table.table("changes", required=False).data
    own = table.table("parameters", required=False)
    if not file:
        return None, members, {}, {}
    recorded = {"run": {**changes.get("run", {}), **({"outputs": outputs} if outputs else {})}}
    try:
        scene = read_scene(path.parent / file, changes={**changes, **recorded}, name=f"{path.stem}_{label}")
    except SceneError as error:
        for fault in error.faults:
            place = f"{file}, {fault.key}" if fault.line is None else f"{file}, line {fault.line}, {fault.key}"
            given, allowed = f"{place} {fault.given}", fault.allowed
            table.fault("", f"its scene: {fault.problem}", given=given, allowed=allowed, remedy=fault.remedy)
        return None, members, {}, {}
    units = {quantity.path: quantity.unit for quantity in scene.quantities}
    found: dict[str, Distribution | float] = {}
    for name in dict.fromkeys((*common.data, *own.data)):
        owner = own if name in own.data else common
        if name in units:
            value = _read_value(owner, name, owner.data[name], units[name])
            if value is not None:
                found[name] = value
        elif owner is own:
            table.collector.faults.append(_unknown(f'classes.{label}.parameters."{name}"', name, list(units)))
    return scene, members, found, units


def _unknown(key: str, name: str, known: list[str]) -> Fault:
    from ballpass.derive.scene.errors import Fault
    from ballpass.runtime.contract.parameters import unknown_name

    words = unknown_name("number of the scene", name, known)
    remedy = 'write the path of a number of the scene in quotes, as in "bearing.clearance"'
    return Fault(key=key, problem=words, given=name, allowed="numbers, as of ballpass run --set", remedy=remedy)


def _read_value(table: Table, key: str, written: Any, unit: str) -> Distribution | float | None:
    """A number or distribution of a unit; None, with a fault, where it is neither."""
    path = (*table.path, key)
    if not isinstance(written, dict):
        value = table.collector.quantity(path, written, unit, "", "").value
        return value if math.isfinite(value) else None
    rest = {name: value for name, value in written.items() if name != "distribution"}
    name = written.get("distribution")
    if not isinstance(name, str):
        problem = "the name of the distribution is missing"
        table.fault(key, problem, given=repr(written), allowed=_EXAMPLE, remedy='add distribution = "uniform"')
        return None
    try:
        plain = plain_arguments(name, rest)
        before = len(table.collector.faults)
        arguments = {
            word: table.collector.quantity((*path, word), value, "1" if word in plain else unit, "", "").value
            for word, value in rest.items()
        }
        if len(table.collector.faults) > before:
            return None
        return Distribution(name=name, arguments=arguments)
    except RequestError as fault:
        table.fault(key, str(fault), given=repr(written), allowed=_EXAMPLE, remedy="see scipy.stats for its arguments")
        return None
