"""Entry point of the ``ballpass`` command: deaf to nothing while the rest is imported.

Imports take most of a second.  An interrupt (Ctrl-C) within them could surface as any exception of whatever is being
imported; here it ends the process at once, for nothing has been done yet.  Only the standard library is imported above.
"""

from __future__ import annotations

import os
import signal
from types import FrameType

#: What an interrupted command says.
INTERRUPTED = "interrupted. Whatever files are there are whole."


def leave_at_once(_number: int, _frame: FrameType | None) -> None:
    """Handler of an interrupt while nothing has been done: says so and ends the process with exit code 130."""
    os.write(2, f"error: {INTERRUPTED}\n".encode())
    os._exit(130)


def main() -> None:
    """Import the command line and run it."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # else somebody wants it ignored, as nohup does
        signal.signal(signal.SIGINT, leave_at_once)
    from ballpass.runtime.app import cli

    cli.main()
