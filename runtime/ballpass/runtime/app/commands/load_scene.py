"""Read a scene with the numbers of ``--set`` and other options, all checked before anything is derived.

In: a scene file and texts.  Out: values in SI.  `ballpass.derive` is imported inside functions, where it is needed.
"""

from __future__ import annotations

import hashlib
import os
import warnings
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ballpass.runtime.contract.cache import CacheWarning, cache_folder
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.extras import can_derive
from ballpass.runtime.contract.folder import read_manifest
from ballpass.runtime.contract.folders import nearest
from ballpass.runtime.contract.units import QuantityError, parse_quantity, split_setting

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
    path: Path, settings: Sequence[str] | None, *length: float | None
) -> tuple[Scene | Manifest, dict[str, float]]:
    """A scene, or its fresh manifest, and the numbers of ``--set`` by path [SI].

    Where the generated folder is fresh its manifest has all that is needed; else, and where something is wrong, the
    scene is read, so that the message has the line of the file.  A generated folder may stand in place of the scene.

    Parameters
    ----------
    length : ``--cycles``, ``--duration`` [s] and ``--transient`` [turns], or nothing
    """
    if path.is_dir():
        present = read_manifest(path)
        return present, _overrides_of(present, settings)
    from ballpass.derive.emit.signature import fresh_manifest

    manifest = fresh_manifest(path, generated_folder(path))
    # ends of windows and knots of tables are checked against each other when a scene is read
    paths = [split_setting(text)[0] for text in settings or ()]
    if manifest is not None and not any("window" in one or one.startswith(("load.", "loads.")) for one in paths):
        with suppress(RequestError):
            return manifest, _overrides_of(manifest, settings)
    _, scene, overrides = read_with_settings(path, settings, *length)
    return scene, overrides


def _once(settings: Sequence[str] | None) -> dict[str, str]:
    """Texts of ``--set`` by path; RequestError for a setting of the run, and for a number that is set twice."""
    found: dict[str, str] = {}
    for text in settings or ():
        path = split_setting(text)[0]
        refuse_run_setting("--set", text)
        if path in found:
            values = " and ".join(split_setting(one)[2] for one in (found[path], text))
            raise RequestError(
                f"--set {path}: the number is set twice: {values}. Allowed: one value for a number. Omit one --set."
            )
        found[path] = text
    return found


def _overrides_of(manifest: Manifest, settings: Sequence[str] | None) -> dict[str, float]:
    """Numbers of ``--set`` by path, of a generated folder whose scene may not be here.

    Raises
    ------
    RequestError
        No number of the model, no quantity of its unit, a value out of its bounds; or see `_once`.
    """
    from ballpass.runtime.contract.parameters import resolve_parameters, unknown_name

    units = {info.name: info.unit for info in manifest.parameters}
    found: dict[str, float] = {}
    for path, text in _once(settings).items():
        if path not in units:
            raise RequestError(f"--set {text}: {unknown_name('parameter', path, units)}")
        found[path] = read_value(f"--set {path}", split_setting(text)[2], units[path])
    resolve_parameters(manifest, found)
    return found


def read_value(option: str, text: str, unit: str) -> float:
    """Value of an option [unit]; all units of pint where it is installed."""
    try:
        if can_derive():
            from ballpass.derive.scene.units import parse_quantity as parse_any

            return parse_any(text, unit)
        return parse_quantity(text, unit)
    except QuantityError as error:
        raise RequestError(f"{option}: {error}") from None


def read_with_settings(
    path: Path, settings: Sequence[str] | None, *length: float | None
) -> tuple[Scene, Scene, dict[str, float]]:
    """The scene as the file has it, the scene as asked for, and the overrides in SI; checked as if in the file.

    Parameters
    ----------
    length : as for `read_asked`
    """
    if path.is_dir():
        raise RequestError(
            f"{path} is a folder. Allowed: the scene file, which this command reads. A generated folder is enough for "
            f"commands that only simulate, as ballpass run {path}."
        )
    from ballpass.derive import SceneError, read_scene
    from ballpass.derive.reading.read import parse_override, with_values

    read = read_scene(path)
    faults: list[Fault] = []
    overrides: dict[str, float] = {}
    for name, text in _once(settings).items():
        try:
            _, overrides[name] = parse_override(read, text)
        except SceneError as error:
            faults += error.faults
    if faults:
        raise SceneError(faults, source="--set")
    run = read.run
    cycles, duration, transient = length or (None, None, None)
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


def refuse_run_setting(option: str, text: str) -> None:
    """Refuse a line of the run table, which holds no parameters of the model."""
    path, _, value = split_setting(text)
    if path.startswith("run."):
        flag, others = RUN_OPTIONS.get(path), ", ".join(RUN_OPTIONS.values())
        has = f"{flag} for it, as in {flag} {value or 'VALUE'}" if flag else f"{others}; for the rest edit [run]"
        raise RequestError(
            f"{option} {text}: this is a setting of the run, not a parameter of the model. Allowed: numbers of "
            f"mechanism, shaft, load and bearing. `ballpass run` has {has}."
        )
