"""Put a folder in the place of another: the old files or the new ones, whenever the process is stopped.

What both halves need for it: an exchange of two folders in one step where the system can (Linux, macOS), permissions,
and the removal of what killed processes left.
"""

from __future__ import annotations

import contextlib
import ctypes
import glob
import os
import shutil
import sys
import time
from pathlib import Path

#: Folders of this age, made to be moved, were left by a process that was killed [s].
LEFT_BEHIND = 86_400.0

#: How often a folder is looked at again that another process replaces meanwhile.
LOOKS = 20

_AT_CWD, _RENAME_EXCHANGE = -100, 2  # fcntl.h, stdio.h of Linux
_RENAME_SWAP = 2  # stdio.h of macOS


def state(folder: Path) -> tuple[int, int, int] | None:
    """What changes whenever a folder is replaced, or a file is moved into it; None where there is none."""
    try:
        found = folder.stat()
    except (OSError, ValueError):
        return None
    return found.st_ino, found.st_mtime_ns, found.st_ctime_ns


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
