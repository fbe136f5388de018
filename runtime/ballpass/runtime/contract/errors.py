"""The errors this package raises on purpose, and the base of its warnings."""

from __future__ import annotations

import re

#: What a terminal obeys, or what turns the order of text round, apart from ends of lines and tabs.
_CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200b-\u200f\u2028-\u202e\u2066-\u2069\ufeff\ud800-\udfff]")


def printable(text: str) -> str:
    """Text for a terminal: control characters, as names in files may hold, are written as Python writes them."""
    return _CONTROL.sub(lambda found: ascii(found[0])[1:-1], text)


class BallpassError(Exception):
    """Base of every error raised on purpose: what, what was given, what is allowed, what to do."""

    def __str__(self) -> str:
        """The message, in which what was given is not longer than people read, and nothing that a terminal obeys."""
        return printable(re.sub(r"\S{500,}", lambda word: f"{word[0][:200]}...", super().__str__()))


class RequestError(BallpassError, ValueError):
    """The request was wrong (exit code 2): an unknown name, a value out of range, a bad artefact folder."""


class ArtefactError(RequestError):
    """The generated folder is missing, of another schema, or its files differ from the manifest's digests."""


class CompileError(BallpassError, RuntimeError):
    """The C compiler failed; the message carries command and its output."""


class SimulationError(BallpassError, RuntimeError):
    """The computation failed (exit code 1): cause, time, crank angle, remedy."""


class BallpassWarning(UserWarning):
    """Base of every warning."""
