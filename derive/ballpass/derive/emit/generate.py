"""Bring the generated folder of a scene up to date.

In: a scene.  Out: its folder, derived anew where it is stale.  Whatever needs SymPy is imported only then.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from ballpass.derive.emit.signature import (
    deriving_sources,
    duty_info,
    folder_of,
    fresh_manifest,
    info_of,
    life_info,
    plugins_of,
    signature,
    source_key,
)
from ballpass.runtime.contract import manifest as mf
from ballpass.runtime.contract.arguments import typed
from ballpass.runtime.contract.cache import was_written
from ballpass.runtime.contract.errors import ArtefactError, RequestError
from ballpass.runtime.contract.folder import (
    ForeignFolderError,
    file_digest,
    intact_manifest,
    read_manifest,
    write_manifest,
)
from ballpass.runtime.contract.folders import locked, read_file, replace_files
from ballpass.runtime.contract.plugins import use
from ballpass.runtime.show.progress import shown

if TYPE_CHECKING:
    from ballpass.derive.lowering.functions import LoweredFunctions
    from ballpass.derive.scene.records import Scene
    from ballpass.derive.system import System

#: Every file that a derivation writes.
GENERATED = (
    *("EQUATIONS.md", mf.FILE_NAME, "ensemble_kernels.h", "kernels.h", "switches.h", "tangents.h"),
    *(f"{library}.{kind}" for library in (mf.MODEL, mf.EQUATIONS, mf.JACOBIANS) for kind in ("c", "casadi", "h")),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class FolderCheck:
    """Result of comparing a folder with a new derivation of its scene; `stale` names the files that differ."""

    folder: Path
    stale: tuple[str, ...]


@typed
def generate(
    scene: str | Path | Scene,
    out: str | Path | None = None,
    *,
    force: bool = False,
    plugins: Sequence[str] = (),
    progress: Callable[[str], None] | None = None,
    inspect: Callable[[mf.Manifest], None] | None = None,
) -> Path:
    """Write the generated folder of a scene unless it is there and fresh.

    Parameters
    ----------
    scene : path of a scene file, or a scene
    out : folder to write; ``./generated/<scene name>`` by default
    force : derive again even where nothing changed
    plugins : see `read_scene`
    progress : called with the name of each stage
    inspect : called with the model's manifest before C is generated; nothing is written where it raises

    Returns
    -------
    The folder.

    Raises
    ------
    SceneError
        The scene is wrong.  Nothing is written then.
    RequestError
        The folder holds only files that this function did not write.  Nothing is written then.

    Examples
    --------
    >>> folder = generate("scenes/punching_press.toml")  # done: it is fresh
    >>> load(folder).outputs[-1]
    'drive_torque'
    """
    use(plugins)
    say = progress or (lambda _: None)
    look = inspect or (lambda _: None)
    fresh = None if force else fresh_manifest(scene, out)
    if fresh is not None:
        look(fresh)
        return folder_of(scene, out)
    read, source = _read(scene)
    folder = folder_of(scene, out)
    present = None if force else _own_manifest(folder, say)
    if present is not None and present.signature == signature(read):
        look(present)
        _refresh(folder, present, read, source)
        return folder
    _refuse_foreign(folder)
    with shown("deriving equations, writing C"):
        system, functions = _derive_and_lower(read, say)
        from ballpass.derive.emit.folder import write_folder

        if inspect is not None:
            from ballpass.derive.emit.describe import describe

            inspect(describe(system, functions, source, ()))
        say("emit")
        replace_files(
            folder,
            lambda made: write_folder(made, system, functions, source),
            last=mf.FILE_NAME,
            owned=lambda: _written(folder),
        )
    return folder


@typed
def check(scene: str | Path | Scene, out: str | Path | None = None) -> FolderCheck:
    """Derive a scene afresh and compare with the folder, byte for byte; writes nothing to it.

    A missing file, as in a clean checkout, is compared by its digest in the folder's manifest.

    Examples
    --------
    >>> check("scenes/rotor.toml", "generated/rotor").stale[:2]  # nothing was generated yet
    ('EQUATIONS.md', 'ensemble_kernels.h')
    """
    from ballpass.derive.emit.folder import write_folder

    read, source = _read(scene)
    folder = folder_of(scene, out)
    present: dict[str, str] = {}
    with contextlib.suppress(ArtefactError):
        manifest = read_manifest(folder)
        source, present = source or manifest.source, dict(manifest.files)
    present |= _digests(folder)
    system, functions = _derive_and_lower(read, lambda _: None)
    with tempfile.TemporaryDirectory() as made:
        write_folder(Path(made), system, functions, source)
        fresh = _digests(Path(made))
    stale = sorted(name for name in fresh.keys() | present.keys() if fresh.get(name) != present.get(name))
    return FolderCheck(folder=folder, stale=tuple(stale))


def _own_manifest(folder: Path, say: Callable[[str], None]) -> mf.Manifest | None:
    """The folder's manifest where its digests fit the files, and this user's ballpass wrote them."""
    try:
        return intact_manifest(folder, own=True, made_by=deriving_sources())
    except ForeignFolderError:
        say(f"{folder} was not written by your ballpass: nothing of it is executed, it is derived anew")
    except ArtefactError:
        pass
    return None


def _read(scene: str | Path | Scene) -> tuple[Scene, str]:
    """A scene, and the digest of its file where there is one."""
    if not isinstance(scene, str | Path):
        return scene, ""
    from ballpass.derive.reading.read import read_scene

    read = read_scene(scene)
    return read, source_key(Path(scene), plugins_of(read))


def _derive_and_lower(scene: Scene, say: Callable[[str], None]) -> tuple[System, LoweredFunctions]:
    from ballpass.derive.lowering.functions import lower
    from ballpass.derive.system import derive

    say("derive")
    system = derive(scene)
    say("lower")
    return system, lower(system)


def _digests(folder: Path) -> dict[str, str]:
    """Digests of the files in a folder by name."""
    paths = folder.glob("[!.]*") if folder.is_dir() else ()
    return {path.name: file_digest(path) for path in paths if path.is_file()}


def _refresh(folder: Path, present: mf.Manifest, scene: Scene, source: str) -> None:
    """Bring the numbers of a fresh folder up to the scene's."""
    values = {q.path: q.value for q in scene.quantities}
    updated = replace(
        present,
        title=scene.title,
        parameters=tuple(replace(p, default=values[p.name]) for p in present.parameters),
        run=info_of(mf.RunInfo, scene.run),
        duty=duty_info(scene),
        bearings=tuple(
            replace(info, **life_info(bearing)) for info, bearing in zip(present.bearings, scene.bearings, strict=True)
        ),
    )
    if updated != present or source:
        updated = replace(updated, source=source)
    if updated == present:
        return
    if scene.mechanism is not None and updated.parameters != present.parameters:
        from ballpass.derive.system import derive

        derive(scene)  # refuses a linkage that locks with its new numbers
    with locked(folder):
        write_manifest(folder, updated, made_by=deriving_sources())


def _refuse_foreign(folder: Path) -> None:
    """Refuse a path that is no folder, or a folder with other files only: probably the path is wrong."""
    if not folder.is_dir():
        if os.path.lexists(folder):
            raise RequestError(
                f"{folder} cannot be written: it is no folder. Allowed: a folder that is empty, new, or was written by "
                "ballpass derive. Nothing was changed. Give another folder."
            )
        return
    names = sorted(path.name for path in folder.iterdir() if not path.name.startswith(".ballpass"))
    if names and not any(name in GENERATED for name in names):
        raise RequestError(
            f"The folder {folder} holds other files ({', '.join(names[:5])}{', ...' if len(names) > 5 else ''}), and "
            "none written by ballpass derive. Allowed: a folder that is empty, new, or was written by ballpass derive. "
            "Nothing was changed. Give another folder, for example one inside it."
        )


def _written(folder: Path) -> set[str]:
    """Names of the files in a folder that a derivation wrote, this version's or the one that left the manifest."""
    names = set(GENERATED)
    with contextlib.suppress(OSError, ArtefactError):
        if was_written(read_file(folder / mf.FILE_NAME)):  # another's may name files of the user
            names |= {name for name, _ in read_manifest(folder).files}
    return {name for name in names if (folder / name).is_file() and not (folder / name).is_symlink()}
