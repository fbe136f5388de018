"""Replace a generated folder by another: the old one or the new one, whenever the process is stopped.

In: a folder, and a function that writes its files into a folder beside it.  Out: nothing; the folder holds the new
files.

Where the system can swap two folders in one step (Linux, macOS), that is done.  Elsewhere, and where somebody keeps
files of his own in the folder, the files are moved one by one, the manifest last: a break in between leaves digests
that do not match, which every reader refuses and the next derivation mends.  Files of others are never touched.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from ballpass.runtime import contract as mf
from ballpass.runtime.contract.errors import ArtefactError, RequestError
from ballpass.runtime.contract.folders import clear, permit, swap, turn

#: Every file that a derivation writes.
GENERATED = (
    "EQUATIONS.md",
    "ensemble_kernels.h",
    "jacobians.c",
    "jacobians.casadi",
    "jacobians.h",
    "kernels.h",
    mf.FILE_NAME,
    "methods.h",
    "model.c",
    "model.casadi",
    "model.h",
    "switches.h",
    "tangents.h",
)


def refuse_foreign(folder: Path) -> None:
    """Refuse what is no folder, or holds files but none that a derivation wrote: somebody gave the wrong path.

    Raises
    ------
    RequestError
    """
    if not folder.is_dir():
        if os.path.lexists(folder):
            raise RequestError(
                f"{folder} cannot be written: it is no folder. Allowed: a folder that is empty, new, or was written by "
                "ballpass derive. Nothing was changed. Give another folder."
            )
        return
    names = sorted(path.name for path in folder.iterdir())
    if names and not any(name in GENERATED for name in names):
        raise RequestError(
            f"The folder {folder} holds other files ({', '.join(names[:5])}{', ...' if len(names) > 5 else ''}), and "
            "none that ballpass derive wrote. Allowed: a folder that is empty, new, or was written by ballpass derive. "
            "Nothing was changed. Give another folder, for example one inside it."
        )


def replace_folder(folder: Path, label: str, write: Callable[[Path], None]) -> None:
    """Write a folder beside `folder` and put it in its place.

    Parameters
    ----------
    folder : to be replaced, or made
    label : start of the name of the folder beside it
    write : writes all files into the folder it is called with, the manifest among them
    """
    # of a link, what it points to: the link itself stays
    place = Path(os.path.realpath(folder))
    place.parent.mkdir(parents=True, exist_ok=True)
    clear(place.parent, label, ".new")
    made = Path(tempfile.mkdtemp(prefix=f".{label}-", suffix=".new", dir=place.parent))
    try:
        write(made)
        with turn(place.parent):
            permit(made, place)
            _put(made, place)
    finally:
        # what was made and could not be put there, or what was there before
        shutil.rmtree(made, ignore_errors=True)


def _put(made: Path, place: Path) -> None:
    if not place.exists():
        with contextlib.suppress(OSError):  # another process was faster
            os.rename(made, place)
            return
    foreign = _names(place) - _written(place)
    if not foreign and swap(made, place):
        return
    place.mkdir(exist_ok=True)
    new = _names(made)
    for name in sorted(_names(place) - new - foreign):
        (place / name).unlink()
    for name in sorted(new, key=lambda name: (name == mf.FILE_NAME, name)):
        os.replace(made / name, place / name)


def _written(place: Path) -> set[str]:
    """Names of the files in a folder that a derivation wrote, this version's or the one that left the manifest."""
    names = set(GENERATED)
    with contextlib.suppress(ArtefactError):
        names |= {name for name, _ in mf.read_manifest(place).files}
    return {name for name in names if (place / name).is_file() and not (place / name).is_symlink()}


def _names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()} if folder.is_dir() else set()
