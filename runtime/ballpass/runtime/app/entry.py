"""Entry point of the ``ballpass`` command.

An interrupt (Ctrl-C) ends it with exit code 130, also while modules are imported.  One that comes when all is done
changes nothing.
"""

from __future__ import annotations

import signal
import sys

from ballpass.runtime.app.interrupted import has_said, say_interrupted


def main() -> None:
    """Import the command line and run it."""
    try:
        from ballpass.runtime.app.cli import app

        app()
    except KeyboardInterrupt:
        say_interrupted()
        sys.exit(130)
    except SystemExit as done:
        if done.code == 130 and not has_said():
            say_interrupted()
        raise
    finally:
        # Python gives the signal back to the system while it ends, and that would kill a command that has succeeded
        signal.signal(signal.SIGINT, signal.SIG_IGN)
