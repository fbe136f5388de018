"""The contract between the two halves: what a generated folder holds and how to call it.

`derive` writes one `Manifest` beside the generated code; `runtime` reads it and needs nothing else from `derive`.
All numbers are SI.  Reading checks the schema and names what is wrong; writing is deterministic.

Every generated function of the model has the arguments ``t, x, u, p, c`` (those it lists in its signature):

=== ======================================================================================================
t   time since the reference time of the phases [s]
x   states: positions, then velocities, in the order of `Manifest.states`
u   inputs, constant between breakpoints, in the order of `Manifest.inputs`
p   parameters in the order of `Manifest.parameters`
c   derived constants in the order of `Manifest.constants`, from ``constants(p)``, evaluated once a run
=== ======================================================================================================
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import math
import os
import re
import tempfile
import types
from collections.abc import Callable, Mapping
from dataclasses import MISSING, asdict, dataclass, field, fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from raceway.runtime.errors import ArtefactError

SCHEMA = 2
FILE_NAME = "manifest.json"

#: Last key of the file: sha256 of its text without this key.
DIGEST = "digest"

#: Names of scenes, which become names of files, of make targets and of programs.
_SCENE_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")

#: Where a generated function lives: ``<library>.c`` and, serialised, ``<library>.casadi``.
MODEL, JACOBIANS = "model", "jacobians"


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterInfo:
    """A run-time number: name (its path in the scene file), SI unit, description, LaTeX symbol, default.

    A value must be > `above`, >= `least`, <= `most` and < `below`; None bounds nothing.
    """

    name: str
    unit: str
    description: str
    latex: str
    default: float
    above: float | None = None
    least: float | None = None
    most: float | None = None
    below: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class VariableInfo:
    """A derived constant, state or output: name, SI unit, description; `size` > 1 for one value per ball.

    `latex` is empty where no symbol exists.
    """

    name: str
    unit: str
    description: str
    latex: str = ""
    size: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class QuantityInfo:
    """Something the model can report and differentiate, whether a run reports it or not.

    `group` is the function of ``jacobians.c`` that computes it; the quantities of a group stand one below the other,
    in the order of `Manifest.quantities`, each with `size` rows.
    """

    name: str
    unit: str
    description: str
    size: int
    group: str


@dataclass(frozen=True, slots=True, kw_only=True)
class InputInfo:
    """A quantity the driver holds constant between breakpoints.

    kind ``phase``: the angle ``offset + rate * t_ref`` [rad] at the reference time; `offset` names a parameter, `rate`
    a parameter or derived constant [rad/s].
    kind ``gate``: 1 while ``offset + rate * t`` modulo a turn lies in one of `windows` (pairs of parameter names),
    else 0.
    kind ``table``: value at the reference time of the piecewise linear table with the knots `times` and `values`
    (names of parameters); kind ``table_rate``: its slope there.
    """

    name: str
    kind: Literal["phase", "gate", "table", "table_rate"]
    offset: str = ""
    rate: str = ""
    windows: tuple[tuple[str, str], ...] = ()
    times: tuple[str, ...] = ()
    values: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class FunctionInfo:
    """Signature and cost of a generated function: names with sizes (rows), and the number of SX operations.

    `library` is the generated file that holds it: `MODEL`, or `JACOBIANS`, compiled when first asked for.
    """

    name: str
    inputs: tuple[tuple[str, int], ...]
    outputs: tuple[tuple[str, int], ...]
    operations: int
    description: str
    library: str = MODEL


@dataclass(frozen=True, slots=True, kw_only=True)
class MarginInfo:
    """Row of ``assembly``: positive while the dyad at `joint` can be assembled [1]."""

    joint: str
    description: str


@dataclass(frozen=True, slots=True, kw_only=True)
class PointInfo:
    """Point (or centre of mass) of a body, pair of rows ``2k, 2k + 1`` of ``geometry`` [m]."""

    body: str
    point: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RunInfo:
    """Run settings of the scene file; exactly one of `cycles` and `duration` [s] is given."""

    cycles: float | None
    duration: float | None
    transient_cycles: float
    samples_per_cycle: int
    method: str
    rtol: float


@dataclass(frozen=True, slots=True, kw_only=True)
class BearingInfo:
    """What observables need of the bearing: balls, and the names of its kinematic parameters and constants."""

    balls: int
    joint: str
    shaft_speed: str
    outer_ring: bool
    damping_law: str


@dataclass(frozen=True, slots=True, kw_only=True)
class MechanismInfo:
    """What observables need of the linkage: driver joint, names of its parameters, joints, points for drawing.

    The components of an applied force are the parameters ``mechanism.forces.<name>.force.x`` and ``.y``, or
    ``.magnitude`` and ``.direction`` (see `force_components`).
    """

    driver_joint: str
    speed: str
    start_angle: str
    joints: tuple[tuple[str, str, str, str, str, str], ...]  # name, kind, body, point, body, point
    points: tuple[PointInfo, ...]
    margins: tuple[MarginInfo, ...]
    forces: tuple[tuple[str, str, str, str], ...] = ()  # name, body, point, input that gates it or "": acts always


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """Everything `runtime` knows of a model."""

    schema: int = SCHEMA
    scene: str
    title: str
    signature: str
    versions: tuple[tuple[str, str], ...]
    parameters: tuple[ParameterInfo, ...]
    constants: tuple[VariableInfo, ...]
    states: tuple[VariableInfo, ...]
    initial: tuple[str, ...]  # names of the parameters that hold the initial states
    inputs: tuple[InputInfo, ...]
    outputs: tuple[VariableInfo, ...]
    functions: tuple[FunctionInfo, ...]
    smoothness: tuple[tuple[str, str], ...]  # law -> smooth, kinked, discontinuous
    mechanism: MechanismInfo | None
    bearing: BearingInfo | None
    run: RunInfo
    quantities: tuple[QuantityInfo, ...] = ()
    relations: tuple[tuple[str, float, str], ...] = ()  # (name, factor, other): value > factor * value of the other
    files: tuple[tuple[str, str], ...] = field(default=())  # file name -> sha256

    def function(self, name: str) -> FunctionInfo:
        for info in self.functions:
            if info.name == name:
                return info
        raise KeyError(name)

    def to_json(self) -> str:
        """Deterministic text: the fields in the order of the records, one per line, ending in a newline.

        The last key is the digest of the text without it: who edits a number there by hand is told.
        """
        document = asdict(self)
        return _text({**document, DIGEST: _text_digest(document)})

    @classmethod
    def from_json(cls, text: str, *, source: str = FILE_NAME, verify: bool = True) -> Manifest:
        """Manifest from its JSON text; all faults are raised together.

        Parameters
        ----------
        text : what `to_json` wrote
        source : name of the text in messages
        verify : refuse a text that was edited after it was written

        Raises
        ------
        ArtefactError
            Not JSON, another schema, edited, or unknown or missing keys or values of a wrong type, each with its place.
        """
        try:
            document = json.loads(text)
        except (ValueError, RecursionError) as fault:  # no JSON, integers of thousands of digits, deep nesting
            raise ArtefactError(
                f"{source}: not JSON ({str(fault) or type(fault).__name__}). Write the folder again with "
                "`raceway derive`."
            ) from None
        if not isinstance(document, Mapping):
            raise ArtefactError(f"{source}: a JSON object is expected, not {_kind(document)}.")
        schema = document.get("schema")
        if schema != SCHEMA or isinstance(schema, bool):
            raise ArtefactError(
                f"{source}: schema {schema!r} was given, this version of raceway reads schema {SCHEMA}. "
                "Write the folder again with this version's `raceway derive`."
            )
        document = dict(document)
        digest = document.pop(DIGEST, None)
        faults: list[str] = []
        manifest = _read(cls, document, "", faults)
        if not faults:
            faults = _contradictions(manifest)
        if faults:
            raise ArtefactError(
                f"{source}: {len(faults)} fault(s):\n"
                + "\n".join(f"  - {fault}" for fault in faults)
                + "\nThe file is generated: write the folder again with `raceway derive` instead of editing it."
            )
        assert isinstance(manifest, cls)
        if verify and digest != _text_digest(document):
            raise ArtefactError(
                f"{source}: the digest in it, {digest!r:.20}, is not that of its content: edited or cut short. "
                "Write the folder again with `raceway derive`, or load it with verify=False if the edit is meant."
            )
        return manifest


def _text(document: Mapping[str, Any]) -> str:
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _text_digest(document: Mapping[str, Any]) -> str:
    return hashlib.sha256(_text(document).encode()).hexdigest()


def read_artefact(folder: str | Path, *, verify: bool = True) -> Manifest:
    """Manifest of a generated folder whose files are those it describes.

    Parameters
    ----------
    verify : False takes edited files as they are

    Raises
    ------
    ArtefactError
        See `read_manifest` and `check_files`; or the folder was written with another version of CasADi.
    """
    manifest = read_manifest(folder, verify=verify)
    if not verify:
        return manifest
    try:
        check_files(folder, manifest)
    except ArtefactError:
        # another process may have put a new folder in place between the two looks
        again = read_manifest(folder)
        if again == manifest:
            raise
        check_files(folder, again)
        manifest = again
    _check_version(folder, manifest)
    return manifest


def _check_version(folder: str | Path, manifest: Manifest) -> None:
    written, here = dict(manifest.versions).get("casadi", "none"), importlib.metadata.version("casadi")
    if written.split(".")[:2] != here.split(".")[:2]:
        raise ArtefactError(
            f"{folder}: written with CasADi {written}, while {here} is installed: its functions may mean something "
            "else there. Write the folder again with `raceway derive`, or load it with verify=False to try."
        )


def read_manifest(folder: str | Path, *, verify: bool = True) -> Manifest:
    """Read ``manifest.json`` of a generated folder.

    Parameters
    ----------
    verify : refuse a manifest that was edited after it was written

    Raises
    ------
    ArtefactError
        There is no such folder or file, or its content is wrong (see `Manifest.from_json`).
    """
    path = Path(folder) / FILE_NAME
    try:
        text = path.read_text(encoding="utf-8")
    except (FileNotFoundError, NotADirectoryError) as fault:
        what = "the folder has no" if Path(folder).is_dir() else "there is no folder with a"
        raise ArtefactError(
            f"{folder}: {what} {FILE_NAME}. A generated folder is expected; `raceway derive SCENE` writes one."
        ) from fault
    except (OSError, ValueError) as fault:  # no text in UTF-8, no path
        raise ArtefactError(
            f"{path}: cannot be read ({fault}). A folder that `raceway derive` wrote, and that you may read, "
            "is expected."
        ) from fault
    return Manifest.from_json(text, source=str(path), verify=verify)


def write(folder: str | Path, manifest: Manifest) -> Path:
    """Write ``manifest.json`` into `folder`: the old file or the new one, never half of it."""
    target = Path(folder) / FILE_NAME
    descriptor, temporary = tempfile.mkstemp(dir=target.parent, prefix=".manifest-")
    try:
        with os.fdopen(descriptor, "w", encoding="utf-8", newline="\n") as stream:
            stream.write(manifest.to_json())
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(temporary, 0o666 & ~mask)  # mkstemp's 0600 would shut out colleagues
        os.replace(temporary, target)
    except BaseException:
        os.unlink(temporary)
        raise
    return target


def check_files(folder: str | Path, manifest: Manifest) -> None:
    """Compare the digests of the files a manifest lists with those on disk.

    Raises
    ------
    ArtefactError
        A file is missing or was changed after it was generated; all such files are named.
    """
    faults = []
    for name, digest in manifest.files:
        try:
            found = file_digest(Path(folder) / name)
        except FileNotFoundError:
            faults.append(f"{name}: missing")
            continue
        except OSError as fault:
            faults.append(f"{name}: cannot be read ({fault.strerror})")
            continue
        if found != digest:
            faults.append(f"{name}: sha256 {found[:12]}... found, {digest[:12]}... expected: edited or cut short")
    if faults:
        raise ArtefactError(
            f"{folder}: the files are not those the manifest describes:\n"
            + "\n".join(f"  - {fault}" for fault in faults)
            + "\nWrite the folder again with `raceway derive`, or load it with verify=False if the edit is meant."
        )


def file_digest(path: str | Path) -> str:
    """sha256 of a file's bytes, hexadecimal."""
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def _kind(value: object) -> str:
    names = {dict: "an object", list: "a list", str: "a text", bool: "true/false", type(None): "null"}
    return names.get(type(value), f"the number {value!r}")


#: Types of a record's fields, found once: there are hundreds of records in a manifest, and few kinds.
_hints: Callable[[Any], dict[str, Any]] = cache(get_type_hints)


def _read(hint: Any, value: Any, place: str, faults: list[str]) -> Any:
    """`value` from JSON as the type `hint`; what does not fit goes to `faults` with its place."""

    def refuse(expected: str) -> None:
        faults.append(f"{place or 'document'}: {expected} is expected, not {_kind(value)}")

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
                arguments[name] = _read(hints[name], value[name], prefix + name, faults)
            elif item.default is MISSING or name == "schema":
                faults.append(f"{prefix}{name}: missing")
        return hint(**arguments) if not faults else None  # type: ignore[operator]
    origin, choices = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        if value is None:
            return None
        return _read(next(choice for choice in choices if choice is not type(None)), value, place, faults)
    if origin is Literal:
        if value not in choices:
            faults.append(f"{place}: one of {', '.join(map(repr, choices))} is expected, not {value!r}")
        return value
    if origin is tuple:
        if not isinstance(value, list):
            return refuse("a list")
        if choices[-1] is Ellipsis:
            return tuple(_read(choices[0], item, f"{place}[{i}]", faults) for i, item in enumerate(value))
        if len(value) != len(choices):
            faults.append(f"{place}: {len(choices)} entries are expected, not {len(value)}")
            return None
        return tuple(
            _read(choice, item, f"{place}[{i}]", faults)
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
    raise TypeError(f"{place}: no rule to read {hint}")  # a record of this module has a field of a new kind


def _contradictions(manifest: Manifest) -> list[str]:
    """Faults between the parts: names used twice, names that do not exist, sizes that disagree."""
    faults = []
    if not _SCENE_NAME.fullmatch(manifest.scene):
        faults.append(f"scene: a letter, then letters, digits and _, is expected, not {manifest.scene[:80]!r}")
    for name, _ in manifest.files:
        if name in ("", ".", "..") or re.search(r"[/\\\0]", name):
            faults.append(f"files: {name[:80]!r} is no name of a file in the folder")
    for group in ("parameters", "constants", "states", "inputs", "outputs", "functions", "quantities"):
        names = [item.name for item in getattr(manifest, group)]
        for name in dict.fromkeys(name for name in names if names.count(name) > 1):
            faults.append(f"{group}: the name {name!r} occurs {names.count(name)} times")
    parameters = {item.name for item in manifest.parameters}
    values = parameters | {item.name for item in manifest.constants}
    if len(manifest.initial) != len(manifest.states):
        faults.append(f"initial: {len(manifest.states)} names are expected, one per state, not {len(manifest.initial)}")
    used = [("initial", name, parameters) for name in manifest.initial]
    for item in manifest.inputs:
        place = f"inputs[{item.name}]"
        if item.kind in ("phase", "gate"):
            used += [(f"{place}.{key}", getattr(item, key), values) for key in ("offset", "rate")]
        used += [(f"{place}.windows", edge, values) for window in item.windows for edge in window]
        used += [(f"{place}.times", name, values) for name in item.times]
        used += [(f"{place}.values", name, values) for name in item.values]
        if item.kind in ("table", "table_rate") and (len(item.times) != len(item.values) or len(item.times) < 2):
            faults.append(f"{place}: as many times as values are expected, at least two")
    if manifest.mechanism is not None:
        used += [(f"mechanism.{k}", getattr(manifest.mechanism, k), values) for k in ("speed", "start_angle")]
        faults += _force_faults(manifest, manifest.mechanism, parameters)
    if manifest.bearing is not None:
        used.append(("bearing.shaft_speed", manifest.bearing.shaft_speed, values))
    faults += [f"{place}: {name!r} is no parameter or constant" for place, name, known in used if name not in known]
    if (manifest.run.cycles is None) == (manifest.run.duration is None):
        faults.append("run: exactly one of cycles and duration must be a number")
    return faults


def force_components(name: str) -> tuple[tuple[str, str], tuple[str, str]]:
    """Names of the parameters that hold an applied force: x and y [N], or magnitude [N] and direction [rad]."""
    path = f"mechanism.forces.{name}.force"
    return (f"{path}.x", f"{path}.y"), (f"{path}.magnitude", f"{path}.direction")


def _force_faults(manifest: Manifest, mechanism: MechanismInfo, parameters: set[str]) -> list[str]:
    faults = []
    points = {(item.body, item.point) for item in mechanism.points}
    gates = {item.name for item in manifest.inputs if item.kind == "gate"}
    for name, body, point, gate in mechanism.forces:
        place = f"mechanism.forces[{name}]"
        if (body, point) not in points:
            faults.append(f"{place}: {point!r} of {body!r} is no point of the mechanism")
        if gate and gate not in gates:
            faults.append(f"{place}: {gate!r} is no gate among the inputs")
        forms = force_components(name)
        if not any(parameters.issuperset(form) for form in forms):
            faults.append(f"{place}: the parameters {' or '.join(' and '.join(form) for form in forms)} are missing")
    return faults
