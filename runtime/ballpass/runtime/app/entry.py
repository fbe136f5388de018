"""Entry point of the ``ballpass`` command.

An interrupt (Ctrl-C) ends it with exit code 130, also while modules are imported or objects destroyed, where Python
turns an interrupt into other faults or into a remark.  One that comes when all is done changes nothing.
"""

from __future__ import annotations

import io
import signal
import sys
import threading
from types import FrameType

from ballpass.runtime.app.interrupted import has_said, say_interrupted


def main() -> None:
    """Import the command line and run it."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # ASCII has no µ, and pipes of Windows no rules of tables
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

        app()
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
