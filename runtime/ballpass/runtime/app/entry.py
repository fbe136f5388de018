"""Entry point of the ``ballpass`` command.

An interrupt (Ctrl-C) ends it with exit code 130, also while modules are imported or objects destroyed, where Python
turns an interrupt into other faults or into a remark.  One that comes when all is done changes nothing.

Results that stdout does not take are a fault (exit code 2), as are files that cannot be written; a reader who has seen
enough (``| head``) is none, and ends it with exit code 1.
"""

from __future__ import annotations

import signal
import sys
import threading
from types import FrameType

from ballpass.runtime.app import streams
from ballpass.runtime.app.interrupted import has_said, say_interrupted


def main() -> None:
    """Import the command line and run it."""
    streams.prepare()
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
        streams.give_up_stdout()
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
