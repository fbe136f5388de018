"""Parts of a long computation, kept in files until all of it is done, so that a call that was killed continues.

In: a folder, all that decides the results, a key and a function for each part.  Out: its arrays, read or computed.
"""

from __future__ import annotations

import hashlib
import io
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from ballpass.runtime.contract.folders import replace_file
from ballpass.runtime.contract.version import __version__
from ballpass.runtime.native.loaded_model import LoadedModel

#: Arrays of a part; texts as well, but no objects.
Arrays = tuple[np.ndarray, ...]


class KeptParts:
    """Parts that were computed, by all that decides them.

    Parameters
    ----------
    folder : of their files; None to keep nothing
    decides : what decides all of them
    """

    def __init__(self, folder: Path | None, decides: tuple[Any, ...]) -> None:
        self._folder, self._digest = folder, _digest(decides)

    def once(self, key: np.ndarray, compute: Callable[[], Arrays], what: str = "") -> Arrays:
        """Arrays of a part, from its file where there is one.

        Parameters
        ----------
        key : what decides this part beside that of all
        what : name of the part, where there are several of one key
        """
        if self._folder is None:
            return compute()
        path = self._folder / f"{_digest((self._digest, what, key))}.npz"
        try:
            with np.load(io.BytesIO(path.read_bytes())) as stored:
                return tuple(stored[f"arr_{k}"] for k in range(len(stored.files)))
        except (FileNotFoundError, BadZipFile):  # not there, or cut since: made again
            found = compute()
        written = io.BytesIO()
        np.savez(written, *found)
        replace_file(path, written.getvalue())
        return found


@contextmanager
def kept_parts(folder: str | Path | None, model: LoadedModel, *decides: Any) -> Iterator[KeptParts]:
    """Keep parts while this lasts; the folder is deleted where it ends without an error.

    Parameters
    ----------
    folder : None to keep nothing
    decides : what decides the results beside the model: arrays, and what has a faithful `repr`
    """
    if folder is None:
        yield KeptParts(None, ())
        return
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    yield KeptParts(place, (__version__, asdict(model.manifest), *decides))
    shutil.rmtree(place)


def _digest(parts: tuple[Any, ...]) -> str:
    found = hashlib.sha256()
    for part in parts:
        array = isinstance(part, np.ndarray)
        found.update(f"{part.dtype}{part.shape}".encode() + part.tobytes() if array else repr(part).encode())
        found.update(b"\0")
    return found.hexdigest()[:32]
