"""Read a scene with the numbers of ``--set`` and other options, all checked before anything is derived.

In: a scene file and texts.  Out: values in SI.  `ballpass.derive` is imported inside functions, where it is needed.
"""

from __future__ import annotations

import hashlib
import math
import os
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from ballpass.runtime.contract.cache import CacheWarning, cache_folder
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.extras import can_derive
from ballpass.runtime.contract.folder import read_manifest
from ballpass.runtime.contract.folders import nearest
from ballpass.runtime.contract.units import split_setting
from ballpass.runtime.plot import FORMATS

if TYPE_CHECKING:
    from ballpass.derive import Scene
    from ballpass.derive.scene.errors import Fault
    from ballpass.runtime.contract.manifest import Manifest

#: Lines of a scene's run table that have an option of ``ballpass run``.
RUN_OPTIONS = {
    "run.cycles": "--cycles",
    "run.duration": "--duration",
    "run.transient_cycles": "--transient",
    "run.rtol": "--rtol",
    "run.method": "--method",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """Data of a scene that a command needs before it has a model.

    Attributes
    ----------
    method : of the scene
    integrated, bearings : whether it has states, and bearings
    overrides : numbers of ``--set`` by path [SI]
    """

    method: str
    integrated: bool
    bearings: bool
    overrides: dict[str, float]


def generated_folder(scene: Path) -> Path:
    """The generated folder of a scene file, in the user's cache where that cannot be written; a folder itself."""
    if scene.is_dir():
        return scene
    from ballpass.derive.emit.signature import folder_of

    folder = folder_of(scene)
    if os.access(nearest(folder), os.W_OK):
        return folder
    place = hashlib.sha256(os.fsencode(folder.absolute())).hexdigest()[:16]
    instead = cache_folder() / "generated" / place / folder.name
    warnings.warn(f"{folder} cannot be written: the scene is derived into {instead}.", CacheWarning, stacklevel=2)
    return instead


def read_asked(
    path: Path,
    settings: Sequence[str] | None,
    cycles: float | None = None,
    duration: float | None = None,
    transient: float | None = None,
) -> Asked:
    """Read a scene with ``--set``, ``--cycles``, ``--duration`` [s] and ``--transient`` [turns] applied.

    Where the generated folder is fresh its manifest has all that is needed; else, and where something is wrong, the
    scene is read, so that the message has the line of the file.  A generated folder may stand in place of the scene.
    """
    if path.is_dir():
        present = read_manifest(path)
        return asked_of(present, _overrides_of(present, settings or []))
    from ballpass.derive.emit.signature import fresh_manifest

    manifest = fresh_manifest(path, generated_folder(path))
    overrides = _plain_overrides(manifest, settings or []) if manifest is not None else None
    if manifest is not None and overrides is not None:
        return asked_of(manifest, overrides)
    _, scene, overrides = read_with_settings(path, settings, cycles, duration, transient)
    return asked_of(scene, overrides)


def asked_of(of: Scene | Manifest, overrides: dict[str, float]) -> Asked:
    """Data of a scene as read, or of a fresh manifest."""
    return Asked(method=of.run.method, integrated=of.integrated, bearings=bool(of.bearings), overrides=overrides)


def _overrides_of(manifest: Manifest, settings: Sequence[str]) -> dict[str, float]:
    """Numbers of ``--set`` by path, of a generated folder whose scene may not be here.

    Raises
    ------
    RequestError
        No number of the model, no quantity of its unit, a value out of its bounds, or a number set twice.
    """
    from ballpass.runtime.contract.parameters import resolve_parameters, unknown_name

    units = {info.name: info.unit for info in manifest.parameters}
    found: dict[str, float] = {}
    for text in settings:
        path, _, value = split_setting(text)
        if path.startswith("run."):
            raise RequestError(
                f"--set {text}: a setting of the run, not a parameter of the model. Allowed: {', '.join(RUN_OPTIONS)} "
                f"by the options {', '.join(RUN_OPTIONS.values())}."
            )
        if path not in units:
            raise RequestError(f"--set {text}: {unknown_name('parameter', path, units)}")
        if path in found:
            raise RequestError(f"--set {path}: the number is set twice. Allowed: one value. Omit one --set.")
        found[path] = read_value(f"--set {path}", value, units[path])
    resolve_parameters(manifest, found)
    return found


def read_value(option: str, text: str, unit: str) -> float:
    """Value of an option [unit]; all units of pint where it is installed."""
    from ballpass.runtime.contract.units import QuantityError, parse_quantity

    try:
        if can_derive():
            from ballpass.derive.scene.units import parse_quantity as parse_any

            value = parse_any(text, unit)
        else:
            value = parse_quantity(text, unit)
    except QuantityError as error:
        raise RequestError(f"{option}: {error}") from None
    if not math.isfinite(value):
        raise RequestError(f"{option}: {text!r} is no finite quantity.")
    return value


def _plain_overrides(manifest: Manifest, settings: Sequence[str]) -> dict[str, float] | None:
    """Numbers of ``--set`` by path, where the manifest's bounds alone show that they are right; else None."""
    # ends of windows and knots of tables are checked against each other when a scene is read
    paths = [text.partition("=")[0].strip() for text in settings]
    if any("window" in path or path.startswith(("load.", "loads.")) for path in paths):
        return None
    try:
        return _overrides_of(manifest, settings)
    except RequestError:
        return None


def read_with_settings(
    path: Path,
    settings: Sequence[str] | None,
    cycles: float | None = None,
    duration: float | None = None,
    transient: float | None = None,
) -> tuple[Scene, Scene, dict[str, float]]:
    """The scene as the file has it, the scene as asked for, and the overrides in SI; checked as if in the file."""
    if path.is_dir():
        raise RequestError(
            f"{path} is a folder. Allowed: the scene file, which this command reads. A generated folder is enough for "
            f"commands that only simulate, as ballpass run {path}."
        )
    from ballpass.derive import SceneError, read_scene
    from ballpass.derive.reading.read import parse_override, with_values
    from ballpass.derive.scene.errors import Fault
    from ballpass.runtime.request.request import refuse_two_lengths

    read = read_scene(path)
    faults: list[Fault] = []
    texts: dict[str, str] = {}
    overrides: dict[str, float] = {}
    for text in settings or []:
        try:
            refuse_run_setting(text)
            name, value = parse_override(read, text)
        except SceneError as error:
            faults += error.faults
            continue
        given = text.partition("=")[2].strip()
        if name in overrides:
            faults.append(
                Fault(
                    key=name,
                    problem="the number is set twice",
                    given=f"{texts[name]} and {given}",
                    allowed="one value for a number",
                    remedy="omit one --set",
                )
            )
        overrides[name], texts[name] = value, given
    if faults:
        raise SceneError(faults, source="--set")
    run = read.run
    refuse_two_lengths(cycles, duration)
    if cycles is not None or duration is not None:
        run = replace(run, cycles=cycles, duration=duration)
    if transient is not None:
        run = replace(run, transient_cycles=transient)
    if run is read.run and not overrides:
        return read, read, overrides
    try:
        return read, with_values(replace(read, run=run), overrides), overrides
    except SceneError as error:
        raise SceneError(error.faults, source="--set" if overrides else "options") from None


def read_formats(given: Sequence[str] | None) -> tuple[str, ...]:
    """Kinds of the figures: each once, the first one where none was named."""
    return tuple(dict.fromkeys(given or FORMATS[:1]))


def refuse_run_setting(text: str) -> None:
    """Refuse ``--set`` of a line of the run table, which holds no parameters of the model."""
    from ballpass.derive.scene.errors import Fault, SceneError

    path, _, value = (part.strip() for part in text.partition("="))
    if not path.startswith("run."):
        return
    option = RUN_OPTIONS.get(path)
    if option is not None:
        remedy = f"`ballpass run` has {option} for it, as in {option} {value or 'VALUE'}"
    else:
        remedy = f"`ballpass run` has {', '.join(RUN_OPTIONS.values())}; for the rest edit [run] in the scene"
    fault = Fault(
        key=path,
        problem="is a setting of the run, not a parameter of the model",
        given=text,
        allowed="paths of numbers of mechanism, shaft, load and bearing",
        remedy=remedy,
    )
    raise SceneError([fault])
