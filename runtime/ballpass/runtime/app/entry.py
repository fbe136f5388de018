"""Entry point of the ``ballpass`` command.

An interrupt (Ctrl-C) ends it with exit code 130, also while modules are imported.  One that comes when all is done
changes nothing.
"""

from __future__ import annotations

import signal
import sys

from ballpass.runtime.app.interrupted import INTERRUPTED


def main() -> None:
    """Import the command line and run it."""
    try:
        from ballpass.runtime.app.cli import app

        app()
    except KeyboardInterrupt:
        print(f"error: {INTERRUPTED}", file=sys.stderr)
        sys.exit(130)
    finally:
        # Python gives the signal back to the system while it ends, and that would kill a command that has succeeded
        signal.signal(signal.SIGINT, signal.SIG_IGN)
