"""A generated folder and its manifest: reading, writing, and whether the files are those the manifest describes."""

from __future__ import annotations

import hashlib
import importlib.metadata
from dataclasses import replace
from pathlib import Path

from ballpass.runtime.contract.arguments import typed
from ballpass.runtime.contract.cache import note_written, was_written
from ballpass.runtime.contract.errors import ArtefactError
from ballpass.runtime.contract.folders import read_file, read_whole, replace_file
from ballpass.runtime.contract.manifest import FILE_NAME, Manifest


class ForeignFolderError(ArtefactError):
    """A folder in the place of a scene's that this user's ballpass did not write: it is not executed."""


def read_artefact(folder: str | Path, *, verify: bool = True, own: bool = False) -> Manifest:
    """Manifest of a generated folder whose files are those it describes.

    Parameters
    ----------
    verify : False takes edited files as they are: the manifest then has the digests of the files
    own : refuse a folder that this user's ballpass did not write

    Raises
    ------
    ArtefactError
        See `read_manifest` and `check_files`; or the folder was written with another version of CasADi.
    ForeignFolderError
        The folder must be the user's own, and is not.
    """
    place = Path(folder)
    if not verify:
        manifest = read_manifest(folder, verify=False)
        present = [name for name, _ in manifest.files if (place / name).exists()]
        return replace(manifest, files=tuple((name, file_digest(place / name)) for name in present))

    manifest = read_whole(place, lambda: intact_manifest(folder, own=own), ArtefactError)
    _check_version(folder, manifest)
    return manifest


def _check_version(folder: str | Path, manifest: Manifest) -> None:
    written, here = dict(manifest.versions).get("casadi", "none"), importlib.metadata.version("casadi")
    if written.split(".")[:2] != here.split(".")[:2]:
        raise ArtefactError(
            f"{folder}: written with CasADi {written}, while {here} is installed: its functions may mean something "
            "else there. Write the folder again with `ballpass derive`, or load it with verify=False to try."
        )


@typed
def read_manifest(folder: str | Path, *, verify: bool = True) -> Manifest:
    """Read ``manifest.json`` of a generated folder.

    Parameters
    ----------
    verify : refuse a manifest that was edited after it was written

    Raises
    ------
    ArtefactError
        There is no such folder or file, or its content is wrong (see `Manifest.from_json`).

    Examples
    --------
    >>> read_manifest("generated/punching_press").scene
    'punching_press'
    """
    return _parsed(folder, _manifest_bytes(folder), verify=verify)


def intact_manifest(folder: str | Path, *, own: bool, made_by: str | None = None) -> Manifest:
    """Manifest of a folder whose files have its digests; see `read_artefact`, and `was_written` for `made_by`."""
    content = _manifest_bytes(folder)
    manifest = _parsed(folder, content)
    check_files(folder, manifest)
    if own and not was_written(content):
        raise ForeignFolderError(
            f"{folder}: your ballpass did not write this folder, or its cache was emptied since. It is a program: "
            "nothing of it was executed. Write it again with `ballpass derive`, or name the folder itself in place of "
            "the scene if you trust it."
        )
    if made_by is not None and not was_written(content, made_by):
        raise ArtefactError(f"{folder}: it was derived by other code than this. Write it again with `ballpass derive`.")
    return manifest


def _parsed(folder: str | Path, content: bytes, *, verify: bool = True) -> Manifest:
    return Manifest.from_json(content.decode(), source=str(Path(folder) / FILE_NAME), verify=verify)


def _manifest_bytes(folder: str | Path) -> bytes:
    """Content of the manifest, which is text in UTF-8; errors as for `read_manifest`."""
    path = Path(folder) / FILE_NAME
    try:
        content = read_file(path)
        content.decode()
    except (FileNotFoundError, NotADirectoryError) as fault:
        what = "the folder has no" if Path(folder).is_dir() else "there is no folder with a"
        raise ArtefactError(
            f"{folder}: {what} {FILE_NAME}. A generated folder is expected; `ballpass derive SCENE` writes one."
        ) from fault
    except (OSError, ValueError) as fault:  # not text in UTF-8, or not a path
        raise ArtefactError(
            f"{path}: cannot be read ({fault}). A folder that `ballpass derive` wrote, and that you may read, "
            "is expected."
        ) from fault
    return content


def write_manifest(folder: str | Path, manifest: Manifest, *, made_by: str = "") -> Path:
    """Write ``manifest.json`` into `folder`: the old file or the new one, never half of it.

    Parameters
    ----------
    made_by : note that this user's ballpass wrote the folder, with these deriving sources
    """
    target, content = Path(folder) / FILE_NAME, manifest.to_json().encode()
    replace_file(target, content)
    if made_by:
        note_written(content, made_by)
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
        except OSError as fault:
            missing = isinstance(fault, FileNotFoundError)
            faults.append(f"{name}: " + ("missing" if missing else f"cannot be read ({fault.strerror})"))
        else:
            if found != digest:
                faults.append(f"{name}: sha256 {found[:12]}... found, {digest[:12]}... expected: edited or cut short")
    if faults:
        raise ArtefactError(
            f"{folder}: the files are not those the manifest describes:\n"
            + "\n".join(f"  - {fault}" for fault in faults)
            + "\nWrite the folder again with `ballpass derive`, or load it with verify=False if the edit is intended."
        )


def read_unchanged(path: Path, digest: str) -> bytes:
    """Content of a file of a generated folder with the sha256 that its manifest gives it.

    Raises
    ------
    ArtefactError
        The folder was written anew, or edited, since the model was loaded.
    """
    try:
        content = read_file(path)
    except OSError as fault:
        raise ArtefactError(f"{path}: cannot be read ({fault.strerror}). Write the folder again.") from fault
    if hashlib.sha256(content).hexdigest() != digest:
        raise ArtefactError(
            f"{path}: the file is not the one that its manifest described when the model was loaded: it was written "
            "anew or edited since. Load the folder again."
        )
    return content


def file_digest(path: str | Path) -> str:
    """sha256 of a file's bytes, hexadecimal."""
    return hashlib.sha256(read_file(path)).hexdigest()
