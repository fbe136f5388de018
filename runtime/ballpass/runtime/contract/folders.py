"""Put a folder in the place of another: the old files or the new ones, whenever the process is stopped.

What both halves need for it: an exchange of two folders in one step where the system can (Linux, macOS), permissions,
turns of processes that write the same folder, readers beside them, and the removal of what killed processes left.
"""

from __future__ import annotations

import contextlib
import ctypes
import glob
import os
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

#: Folders of this age, made to be moved, were left by a process that was killed [s].
LEFT_BEHIND = 86_400.0

#: How often a folder is looked at again that another process replaces meanwhile.
LOOKS = 20

#: A file system's clock may stand for as long [s]: two changes within it leave the same times.
_TICK = 0.1

#: How long a process waits for its turn [s].  Files are put in place within milliseconds: who holds a lock for longer
#: is another program, perhaps the one that started this process (``flock results ballpass run ...``).
_PATIENCE = 10.0

_AT_CWD, _RENAME_EXCHANGE = -100, 2  # fcntl.h, stdio.h of Linux
_RENAME_SWAP = 2  # stdio.h of macOS

try:
    import fcntl
except ModuleNotFoundError:  # Windows
    fcntl = None  # type: ignore[assignment]

_Content = TypeVar("_Content")


def state(folder: Path) -> tuple[int, int, int] | None:
    """What changes whenever a folder is replaced, or a file is moved into it; None where there is none."""
    try:
        found = folder.stat()
    except (OSError, ValueError):
        return None
    return found.st_ino, found.st_mtime_ns, found.st_ctime_ns


def read_settled(folder: Path, read: Callable[[], _Content], fault: type[Exception]) -> _Content:
    """What `read` gives of a folder; read again where another process replaced files between its looks.

    Parameters
    ----------
    fault : what `read` raises where files do not belong together

    Raises
    ------
    fault
        Nobody writes there, and they do not belong together; or the folder is written anew all the time.
    """
    for _ in range(LOOKS):
        before = state(folder)
        try:
            return read()
        except fault:
            if state(folder) == before:
                if before is None or time.time() - before[1] * 1e-9 > _TICK:
                    raise
                time.sleep(2 * _TICK)  # it may have changed twice within a tick; nobody can once the tick is over
                if state(folder) == before:
                    return read()
    raise fault(f"{folder}: is written anew all the time. Read it when no process writes there.")


@contextlib.contextmanager
def turn(parent: Path) -> Iterator[None]:
    """Let one process or thread at a time put files in place below a folder.

    Where the system or its file system has no locks, and where somebody holds one for long, nothing is waited for: the
    files are then whole as well, but the slower of two processes may find its own gone.
    """
    if fcntl is None:
        yield
        return
    try:
        descriptor = os.open(parent, os.O_RDONLY)
    except OSError:  # may be written, not read
        yield
        return
    try:
        end = time.monotonic() + _PATIENCE
        while time.monotonic() < end:
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                time.sleep(0.01)
            except OSError:  # no locks on this file system
                break
        yield
    finally:
        os.close(descriptor)  # and the lock with it, also where the process is killed


def swap(first: Path, second: Path) -> bool:
    """Exchange two folders of one file system in one step; False where the system cannot."""
    names = (os.fsencode(first), os.fsencode(second))
    try:
        library = ctypes.CDLL(None, use_errno=True)
        if sys.platform == "linux":
            done: int = library.renameat2(_AT_CWD, names[0], _AT_CWD, names[1], ctypes.c_uint(_RENAME_EXCHANGE))
        elif sys.platform == "darwin":
            done = library.renamex_np(*names, ctypes.c_uint(_RENAME_SWAP))
        else:
            return False
    except (AttributeError, OSError, TypeError):  # no such function in this C library
        return False
    return done == 0


def permit(made: Path, place: Path) -> None:
    """Give a new folder the permissions of the old one, or those of any new folder: mkdtemp's shut out colleagues."""
    mask = os.umask(0)
    os.umask(mask)
    os.chmod(made, place.stat().st_mode & 0o7777 if place.is_dir() else 0o777 & ~mask)


def clear(parent: Path, label: str, ending: str) -> None:
    """Delete folders ``.<label>-*<ending>`` that processes which were killed left long ago."""
    for path in parent.glob(f".{glob.escape(label)}-*{ending}"):
        with contextlib.suppress(OSError):
            if time.time() - path.stat().st_mtime > LEFT_BEHIND:
                shutil.rmtree(path, ignore_errors=True)
