"""The message of an interrupted command.  Nothing heavy is imported here: an interrupt may come during imports."""

from __future__ import annotations

import sys

INTERRUPTED = "interrupted. Whatever files are there are whole."

#: Commands of this process that have said so.
_said: list[str] = []


def say_interrupted() -> None:
    """Say it on stderr."""
    _said.append(INTERRUPTED)
    print(f"error: {INTERRUPTED}", file=sys.stderr)


def has_said() -> bool:
    """Whether it was said: typer takes an interrupt between our own commands without a word."""
    return bool(_said)
