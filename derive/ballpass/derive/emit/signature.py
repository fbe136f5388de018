"""The signature of a generated folder: what it was made from, to find whether it is up to date.

Nothing here needs SymPy or CasADi, so that a fresh folder is found without waiting for them.  Numbers are not in the
signature: a changed number rewrites the manifest's defaults and nothing else.  Nor are the deriving sources, of which a
change may change nothing in a folder: the user's cache notes by which of them a folder was written.
"""

from __future__ import annotations

import contextlib
import hashlib
import tomllib
from collections.abc import Iterable
from dataclasses import fields
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from ballpass.derive.scene.file_columns import named_files
from ballpass.runtime.contract import manifest as mf
from ballpass.runtime.contract.folder import intact_manifest
from ballpass.runtime.contract.folders import read_file
from ballpass.runtime.contract.plugins import PLUGIN, digest_of, modules_of, used_modules
from ballpass.runtime.contract.version import __version__

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    from ballpass.derive.scene.bearing_records import Bearing
    from ballpass.derive.scene.records import Scene

T = TypeVar("T", bound="DataclassInstance")


def signature(scene: Scene) -> str:
    """Digest of everything but numbers and ballpass's own code that decides what is generated: structure, versions."""
    text = repr((mf.SCHEMA, scene.structure(), versions(plugins_of(scene))))
    return hashlib.sha256(text.encode()).hexdigest()


def source_key(path: Path, plugins: Iterable[tuple[str, str]] = ()) -> str:
    """Digest of a scene file and the files it names, whatever ends of lines; of versions and plugins.

    Raises
    ------
    OSError
        The file cannot be read.
    """
    digest = hashlib.sha256(repr((mf.SCHEMA, path.stem, versions(plugins))).encode())
    text = read_file(path).replace(b"\r\n", b"\n")
    digest.update(text)
    if b"file" in text:
        with contextlib.suppress(ValueError):  # a file that is not TOML has no digest
            for name in named_files(tomllib.loads(text.decode("utf-8-sig"))):
                with contextlib.suppress(OSError, ValueError):  # reading the scene reports the fault
                    digest.update(read_file(path.parent / name).replace(b"\r\n", b"\n"))
    return digest.hexdigest()


def versions(plugins: Iterable[tuple[str, str]]) -> tuple[tuple[str, str], ...]:
    """Names and versions of the packages that decide what is generated; of plugins the digests."""
    packages = (("ballpass", __version__), *((name, version(name)) for name in ("casadi", "sympy")))
    return (*packages, *((PLUGIN + name, digest) for name, digest in plugins))


def plugins_of(scene: Scene) -> tuple[tuple[str, str], ...]:
    """Modules of plugins that a scene takes laws, elements or effects from, and digests of their sources."""
    from ballpass.derive.bearing.effects import EFFECTS
    from ballpass.derive.bearing.elements import ELEMENTS
    from ballpass.derive.bearing.laws import LAWS
    from ballpass.runtime.ratings.elements import RATED

    used: list[object] = []
    for bearing in scene.bearings:
        used += [LAWS[bearing.damping.law], ELEMENTS[bearing.element], RATED[bearing.element]]
        used += [EFFECTS[effect.kind] for effect in bearing.effects]
    if (mechanism := scene.mechanism) is not None:
        used += [mechanism.driver.torque, *(part for force in mechanism.forces for part in (force.pathway, force.law))]
    return tuple((name, digest_of(name) or "") for name in modules_of(*used))


def is_of_file(manifest: mf.Manifest, path: Path) -> bool:
    """Whether a manifest is that of a scene file as it is now, with the plugins as they are.

    One that is not installed counts as unchanged: what it decided is generated.
    """
    recorded = {name.removeprefix(PLUGIN): key for name, key in manifest.versions if name.startswith(PLUGIN)}
    present = {name: digest_of(name) for name in recorded}
    return manifest.source == source_key(path, ((name, present[name] or recorded[name]) for name in recorded))


def folder_of(scene: str | Path | Scene, out: str | Path | None = None) -> Path:
    """The generated folder of a scene: `out`, or ``./generated/<scene name>``."""
    if out is not None:
        return Path(out)
    return Path("generated") / (Path(scene).stem if isinstance(scene, str | Path) else scene.name)


def fresh_manifest(scene: str | Path | Scene, out: str | Path | None = None) -> mf.Manifest | None:
    """Manifest of a scene file's folder where both are unchanged since this user's ballpass wrote it, else None."""
    if not isinstance(scene, str | Path):
        return None
    try:
        present = intact_manifest(folder_of(scene, out), own=True, made_by=deriving_sources())
        recorded = {name.removeprefix(PLUGIN) for name, _ in present.versions}
        if not used_modules() <= recorded:  # one may have a law of the same name
            return None
        return present if is_of_file(present, Path(scene)) else None
    except (OSError, ValueError):  # not written or not by this user; no such file, no path: the reader reports it
        return None


def info_of(kind: type[T], record: object, **others: Any) -> T:
    """A record of the manifest: the fields of a record of the scene or the system that have its names, and others."""
    names = [field.name for field in fields(kind) if field.name not in others]
    return kind(**{name: getattr(record, name) for name in names if hasattr(record, name)}, **others)


def life_info(bearing: Bearing) -> dict[str, Any]:
    """What a bearing's life needs and its equations do not: catalogue, lubricant, tilt, axial force, fits by class."""
    catalogue, lubrication, alignment = bearing.catalogue, bearing.lubrication, bearing.alignment
    least, most = (catalogue and catalogue.clearance_range) or (None, None)
    return {
        "catalogue": catalogue and info_of(mf.CatalogueInfo, catalogue, clearance_least=least, clearance_most=most),
        "lubrication": lubrication and info_of(mf.LubricationInfo, lubrication),
        "axial_force": bearing.axial_force,
        "shoulder_height": bearing.shoulder_height,
        "alignment": alignment and info_of(mf.AlignmentInfo, alignment),
        "fit": bearing.fit,
    }


def duty_info(scene: Scene) -> tuple[mf.DutyInfo, ...]:
    """The states of a scene's duty cycle."""
    return tuple(info_of(mf.DutyInfo, state) for state in scene.duty)


@cache
def deriving_sources() -> str:
    """Digest of the deriving modules and the table of bearings: a changed derivation makes every artefact stale."""
    digest = hashlib.sha256()
    folder = Path(__file__).parent.parent
    for path in sorted([*folder.rglob("*.py"), *folder.rglob("*.csv")]):
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()
