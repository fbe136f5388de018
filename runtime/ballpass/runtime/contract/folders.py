"""Put files in the place of others: whole files, one process at a time.

A file is written beside its place and moved there, so that it is the old one or the new one.  A folder's files are
moved one by one, the one with the digests of all others last: where a process ends in between, the digests do not
fit, and readers refuse the folder.  Files of others are not touched.
"""

from __future__ import annotations

import contextlib
import errno
import os
import shutil
import stat
import tempfile
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import TypeVar

from ballpass.runtime.contract.errors import RequestError

#: File that a process holds while it writes into a folder; it stays, empty.
LOCK = ".ballpass.lock"

#: Start of the name of the folder, within, in which new files are made.
NEW = ".ballpass-new-"

#: How long a process waits for another one that writes into the same folder [s].
PATIENCE = 300.0

#: Largest file that is read as a whole; solutions may be large.
MOST_BYTES = 2**36

_Content = TypeVar("_Content")


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Let one process or thread at a time write into a folder.

    Raises
    ------
    RequestError
        Another one has been writing there for minutes.
    """
    import filelock  # here: most processes write nothing

    try:
        with filelock.FileLock(folder / LOCK, timeout=PATIENCE):
            yield
    except filelock.Timeout:
        raise RequestError(
            f"{folder}: another process has been writing there for {PATIENCE:g} s. Wait for it, or give another folder."
        ) from None


def read_whole(folder: Path, read: Callable[[], _Content], fault: type[Exception]) -> _Content:
    """Result of `read` for a folder; where its files do not fit together, read again when no process writes there.

    Parameters
    ----------
    fault : what `read` raises where files do not fit together
    """
    try:
        return read()
    except fault:
        if not ((folder / LOCK).exists() and os.access(folder, os.W_OK)):
            raise
        with locked(folder):
            return read()


def refuse_other(path: Path) -> None:
    """OSError where a pipe or device is, whose place a file would take."""
    if path.exists() and not path.is_file():
        raise OSError(errno.EINVAL, "this is no regular file", str(path))


def replace_file(path: Path, content: bytes) -> None:
    """Write a file: the old one or the new one, never half of it."""
    with replaced(path) as made:
        made.write_bytes(content)


@contextlib.contextmanager
def replaced(path: Path) -> Iterator[Path]:
    """A place for a large file on the disk of another one, to be put in its place when all went well."""
    refuse_other(path)
    with tempfile.TemporaryDirectory(dir=path.absolute().parent, prefix=f".{path.name}-") as folder:
        made = Path(folder) / path.name
        yield made
        os.replace(made, path)


def replace_files(
    folder: Path, write: Callable[[Path], _Content], *, last: str, owned: Callable[[], Collection[str]]
) -> _Content:
    """Replace the files in a folder by new ones; files of others stay.

    Parameters
    ----------
    folder : made where it is missing, and deleted again where `write` fails
    write : writes all files into the folder it is called with
    last : name of the file that is put in place last
    owned : names of files that are deleted unless a new one has the name; called while no other process writes there

    Returns
    -------
    What `write` returned.
    """
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise RequestError(
            f"{folder}: this folder cannot be made ({fault.strerror}). Allowed: one that is there, or a place where "
            "you may make one. Give another."
        ) from fault
    try:
        with locked(folder):
            for left in folder.glob(f"{NEW}{8 * '[a-z0-9_]'}"):  # by processes that were killed
                shutil.rmtree(left, ignore_errors=True)
            made = Path(tempfile.mkdtemp(prefix=NEW, dir=folder))
            try:
                result = write(made)
                names = {path.name for path in made.iterdir()}
                for name in sorted(names - {last}):
                    os.replace(made / name, folder / name)
                for name in sorted(set(owned()) - names):
                    (folder / name).unlink(missing_ok=True)
                os.replace(made / last, folder / last)
            finally:
                shutil.rmtree(made, ignore_errors=True)
    except BaseException:
        if missing:
            with contextlib.suppress(OSError):  # another process wrote there meanwhile
                (folder / LOCK).unlink(missing_ok=True)
                for path in missing:
                    path.rmdir()
        raise
    return result


def nearest(path: Path) -> Path:
    """The path, absolute, or what is nearest above it and exists."""
    place = path.absolute()
    while not os.path.lexists(place):
        place = place.parent
    return place


def refuse_full_disk(path: Path, size: float, remedy: str) -> None:
    """Refuse what the disk of a path, that need not exist, has no room for, before any of it is computed.

    Parameters
    ----------
    size : bytes

    Raises
    ------
    RequestError
        It has not.
    """
    free = shutil.disk_usage(nearest(path)).free
    if not size <= free:
        raise RequestError(
            f"{path}: {size / 1e9:.3g} GB would be written, and its disk has {free / 1e9:.3g} GB free. Allowed: what "
            f"fits. {remedy}"
        )


def read_file(path: str | Path, most: int = MOST_BYTES) -> bytes:
    """Content of a regular file: a pipe or device would be waited for, or read without end.

    Raises
    ------
    OSError
        It cannot be read, is no regular file, or is larger than `most` bytes.
    """
    opened = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    with os.fdopen(opened, "rb", closefd=True) as stream:
        found = os.fstat(opened)
        if stat.S_ISDIR(found.st_mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        if not stat.S_ISREG(found.st_mode):
            raise OSError(errno.EINVAL, "this is no regular file", str(path))
        if found.st_size > most:
            raise OSError(errno.EFBIG, f"the file is larger than {most} bytes", str(path))
        return stream.read()
