"""Parts of a long computation, kept in files until all of it is done, so that a call that was killed continues.

In: a folder, all that decides the results, a key and a function for each part.  Out: its arrays, read or computed.
"""

from __future__ import annotations

import hashlib
import io
import os
import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any
from warnings import warn

import numpy as np

from ballpass.runtime.contract.errors import BallpassWarning, RequestError
from ballpass.runtime.contract.folders import replace_file
from ballpass.runtime.contract.plugins import digests
from ballpass.runtime.contract.version import __version__
from ballpass.runtime.native.loaded_model import LoadedModel

#: Ending of a part's file, and bytes of the digest at its end.
ENDING, SEAL = ".ballpass-part", 64

#: Names of parts, and of folders in which one was being written when the process was killed.
_PART = re.compile(rf"[0-9a-f]{{32}}{ENDING}")
_LEFT = re.compile(rf"\.{_PART.pattern}-[a-z0-9_]{{8}}")

#: Arrays of a part; texts as well, but no objects.
Arrays = tuple[np.ndarray, ...]


class KeptParts:
    """Parts that were computed, by all that decides them.

    Parameters
    ----------
    folder : of their files; None to keep nothing
    decides : what decides all of them

    Attributes
    ----------
    used : names of parts that were read or written
    """

    def __init__(self, folder: Path | None, decides: tuple[Any, ...]) -> None:
        self._folder, self._digest = folder, _digest(decides)
        self.used: set[str] = set()

    def once(self, key: np.ndarray, compute: Callable[[], Arrays], what: str = "") -> Arrays:
        """Arrays of a part, from its file where there is one.

        Parameters
        ----------
        key : what decides this part beside that of all
        what : name of the part, where there are several of one key
        """
        found = self.read(key, what)
        return self.write(key, compute(), what) if found is None else found

    def read(self, key: np.ndarray, what: str = "") -> Arrays | None:
        """Arrays of a part from its file; None where there is none, or where it was cut, emptied or overwritten."""
        if self._folder is None:
            return None
        name, path = self._place(key, what)
        content = path.read_bytes() if path.exists() else b""
        written, seal = content[:-SEAL], content[-SEAL:]
        if seal != _seal(name, written):
            return None
        with np.load(io.BytesIO(written)) as stored:
            return tuple(stored[f"arr_{k}"] for k in range(len(stored.files)))

    def write(self, key: np.ndarray, found: Arrays, what: str = "") -> Arrays:
        """Keep arrays of a part."""
        if self._folder is not None:
            (name, path), stream = self._place(key, what), io.BytesIO()
            np.savez(stream, *found)
            replace_file(path, stream.getvalue() + _seal(name, stream.getvalue()))
        return found

    def _place(self, key: np.ndarray, what: str) -> tuple[str, Path]:
        assert self._folder is not None
        name = _digest((self._digest, what, key))
        self.used.add(name)
        return name, self._folder / f"{name}{ENDING}"


@contextmanager
def kept_parts(folder: str | Path | None, model: LoadedModel, *decides: Any) -> Iterator[KeptParts]:
    """Keep parts while this lasts; those that were used are deleted where it ends without an error.

    Parameters
    ----------
    folder : None to keep nothing; deleted at the end where nothing else is in it, as parts of another request
    decides : what decides the results beside the model: arrays, and what has a faithful `repr`

    Raises
    ------
    RequestError
        The folder holds other files than parts, or is none.
    """
    if folder is None:
        yield KeptParts(None, ())
        return
    place = Path(folder)
    refuse_other_files(place)
    place.mkdir(parents=True, exist_ok=True)
    parts = KeptParts(place, (__version__, digests(), asdict(model.manifest), *decides))
    yield parts
    try:
        for path in place.iterdir():
            if path.name.removeprefix(".").partition(".")[0] in parts.used:
                if path.is_dir():
                    shutil.rmtree(path)
                else:
                    path.unlink(missing_ok=True)
        if not place.is_symlink() and not any(place.iterdir()):
            place.rmdir()
    except OSError as fault:
        warn(
            f"{place}: the kept parts could not be deleted ({fault.strerror}). The answer is complete; delete them.",
            BallpassWarning,
            stacklevel=3,
        )


def refuse_other_files(place: Path) -> None:
    """Refuse a folder for parts that holds files of others, before anything is computed."""
    if place.is_dir():
        others = sorted(p.name for p in place.iterdir() if not (_PART if p.is_file() else _LEFT).fullmatch(p.name))
    else:
        others = [place.name] if os.path.lexists(place) else []
    if others:
        raise RequestError(
            f"{place}: files that are no parts of a computation are there ({', '.join(others[:5])}). Allowed: a folder "
            "that is new, empty, or holds what a killed call kept. Nothing was changed. Move them, or give another one."
        )


def _seal(name: str, content: bytes) -> bytes:
    """Digest behind the content of a part, with the name of its file: another part is no substitute."""
    return hashlib.sha256(name.encode() + content).hexdigest().encode()


def _digest(parts: tuple[Any, ...]) -> str:
    found = hashlib.sha256()
    for part in parts:
        array = isinstance(part, np.ndarray)
        found.update(f"{part.dtype}{part.shape}".encode() + part.tobytes() if array else repr(part).encode())
        found.update(b"\0")
    return found.hexdigest()[:32]
