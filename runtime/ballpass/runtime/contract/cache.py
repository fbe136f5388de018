"""The user's cache folder, and in it the record of the generated folders that this user's ballpass wrote.

A generated folder is a program, and the digests in its manifest are public formulas: they do not say who wrote it.
The record does: a file for each manifest, named by the sha256 of its bytes, which hold the digests of all other
files; in it is the digest of the deriving sources that wrote them.  So a folder that was copied or moved is still the
user's own, and no secret is needed.
"""

from __future__ import annotations

import errno
import hashlib
import os
import warnings
from pathlib import Path

import platformdirs

from ballpass.runtime.contract.errors import BallpassWarning

#: Environment variable that moves the cache.
CACHE_VARIABLE = "BALLPASS_CACHE_DIR"

#: Folder of the record, in the cache.
WRITTEN = "written"

#: The record of what this process wrote or found, also where the cache cannot be written.
_known: dict[str, str] = {}


class CacheWarning(BallpassWarning):
    """The cache cannot be written, or a library in it was damaged: libraries are compiled anew."""


def cache_folder() -> Path:
    """The cache, which need not exist; absolute."""
    return Path(os.environ.get(CACHE_VARIABLE) or platformdirs.user_cache_dir("ballpass")).absolute()


def refuse_shared(folder: Path) -> None:
    """OSError where others may put files into a folder: what is read from the cache is executed."""
    if os.name != "posix" or not folder.exists():
        return
    found = folder.stat()
    if found.st_uid not in (0, os.geteuid()) or found.st_mode & 0o002:
        raise OSError(errno.EPERM, "other users may write into it", str(folder))


def note_written(manifest: bytes, made_by: str) -> None:
    """Note the bytes of a manifest as written by this user; a warning where the cache cannot be written.

    Parameters
    ----------
    made_by : digest of the deriving sources
    """
    name = hashlib.sha256(manifest).hexdigest()
    _known[name] = made_by
    folder = cache_folder() / WRITTEN
    try:
        refuse_shared(folder.parent)
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        (folder / name).touch(mode=0o600)
        (folder / name).write_text(made_by, encoding="ascii")
    except OSError as fault:
        warnings.warn(
            f"The cache {folder.parent} cannot be written ({fault.strerror}): each process derives its scenes anew, as "
            f"nothing notes there that you wrote their folders. Set {CACHE_VARIABLE} to a folder you may write.",
            CacheWarning,
            stacklevel=2,
        )


def was_written(manifest: bytes, made_by: str | None = None) -> bool:
    """Whether this user's ballpass wrote a manifest of these bytes; with `made_by` by the deriving sources of it."""
    name = hashlib.sha256(manifest).hexdigest()
    if name not in _known:
        folder = cache_folder() / WRITTEN
        try:
            refuse_shared(folder.parent)
            _known[name] = (folder / name).read_text(encoding="ascii")
        except (OSError, UnicodeDecodeError):  # no record, or none that can be read: derived anew
            return False
    return made_by in (None, _known[name])
