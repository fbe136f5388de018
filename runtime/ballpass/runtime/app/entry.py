"""Entry point of the ``ballpass`` command.

An interrupt (Ctrl-C) ends it with exit code 130, also while modules are imported.
"""

from __future__ import annotations

import sys

#: What an interrupted command says.
INTERRUPTED = "interrupted. Whatever files are there are whole."


def main() -> None:
    """Import the command line and run it."""
    try:
        from ballpass.runtime.app.cli import app

        app()
    except KeyboardInterrupt:
        print(f"error: {INTERRUPTED}", file=sys.stderr)
        sys.exit(130)
