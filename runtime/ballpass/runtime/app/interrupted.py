"""The message of an interrupted command.  Nothing heavy is imported here: an interrupt may come during imports."""

from __future__ import annotations

import sys

INTERRUPTED = "interrupted. Files written so far are complete."

#: Commands of this process that have printed it.
_said: list[str] = []


def say_interrupted() -> None:
    """Print it on stderr."""
    _said.append(INTERRUPTED)
    print(f"error: {INTERRUPTED}", file=sys.stderr)


def has_said() -> bool:
    """Whether it was printed: between our own commands typer handles an interrupt without a message."""
    return bool(_said)
