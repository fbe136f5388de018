"""Entry point of the ``ballpass`` command.

An interrupt (Ctrl-C) ends it with exit code 130, also while modules are imported or objects destroyed, where Python
turns an interrupt into other faults or into a remark.  One that comes when all is done changes nothing.

Results that stdout does not take are a fault (exit code 2), as are files that cannot be written; a reader who has seen
enough (``| head``) is none, and ends it with exit code 1.  Messages that stderr does not take are lost, and the command
works on.
"""

from __future__ import annotations

import io
import os
import signal
import sys
import threading
from types import FrameType
from typing import Any

from ballpass.runtime.app.interrupted import has_said, say_interrupted


def main() -> None:
    """Import the command line and run it."""
    prepare_streams()
    interrupted = False

    def interrupt(_number: int, _frame: FrameType | None) -> None:
        nonlocal interrupted
        interrupted = True
        raise KeyboardInterrupt

    def ignored(fault: sys.UnraisableHookArgs) -> None:
        if issubclass(fault.exc_type, KeyboardInterrupt):  # in a destructor or callback: raise it again after that
            threading.Timer(0.01, signal.pthread_kill, (threading.get_ident(), signal.SIGINT)).start()
        else:
            sys.__unraisablehook__(fault)

    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # a shell may have set it to be ignored
        signal.signal(signal.SIGINT, interrupt)
        sys.unraisablehook = ignored
    try:
        from ballpass.runtime.app.cli import app

        try:
            app()
        finally:
            sys.stdout.flush()
    except OSError as fault:  # of stdout: commands handle those of files
        give_up_stdout()
        if isinstance(fault, BrokenPipeError):
            sys.exit(1)
        print(f"error: cannot write the results to stdout: {fault.strerror or fault}.", file=sys.stderr)
        sys.exit(2)
    except BaseException as end:
        if not interrupted or (isinstance(end, SystemExit) and not end.code):
            raise
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        if not has_said():
            say_interrupted()
        sys.exit(130)
    finally:
        # at its end Python restores the default handler, by which a late signal would kill a command that has succeeded
        signal.signal(signal.SIGINT, signal.SIG_IGN)


class _Unheard(io.FileIO):
    """A file that takes what it can; the rest is lost without a fault."""

    def write(self, data: Any) -> int:
        try:
            return super().write(data) or 0
        except OSError:  # full, or closed by its reader
            return len(data)


def prepare_streams() -> None:
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
