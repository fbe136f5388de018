"""Standard streams made usable for a command: encodings, streams that are closed or full.

Messages that no stream takes are lost, and the command works on; results that cannot be written are a fault.
"""

from __future__ import annotations

import io
import os
import sys
from typing import Any


class _Unheard(io.FileIO):
    """A file that takes what it can; the rest is lost without a fault."""

    def write(self, data: Any) -> int:
        try:
            return super().write(data) or 0
        except OSError:  # full, or closed by its reader
            return len(data)


def prepare() -> None:
    """Make stdout and stderr usable: ASCII has no µ, pipes of Windows no rules of tables, and either may be closed."""
    # a number that is free would be that of the next file, and messages of libraries would go there
    for number, mode in ((0, os.O_RDONLY), (1, os.O_RDONLY), (2, os.O_WRONLY)):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, mode)  # takes the lowest that is free
    if sys.stdout is None:  # it was closed: what is written there is refused
        sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    encoding = "utf-8" if sys.stderr is None else sys.stderr.encoding
    if sys.stderr is None or isinstance(sys.stderr, io.TextIOWrapper):
        raw = io.BufferedWriter(_Unheard(2, "w", closefd=False))
        sys.stderr = io.TextIOWrapper(raw, encoding=encoding, errors="replace", line_buffering=True)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")


def give_up_stdout() -> None:
    """Let go what stdout has not taken, which Python would try to write again when it ends."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.close(nowhere)
