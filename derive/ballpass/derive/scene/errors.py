"""Faults of a scene: all are collected and raised once.

A `Fault` holds the key, what is wrong, what was given, what is allowed and what to do.  A `SceneError` carries one
or more of them; its message lists them all.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from ballpass.runtime.contract.errors import BallpassError

#: Most characters of a key that a message shows, and of each of its other parts.
LONGEST_KEY = 400
LONGEST_PART = 1200

#: Most faults that a message lists.
MOST_FAULTS = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One thing that is wrong with a scene.

    Attributes
    ----------
    key : dotted place in the scene file ("mechanism.joints.C"); empty when the whole file is meant
    problem : what is wrong, in one clause
    given : the value in the file (or computed from it); may be empty
    allowed : the allowed values; may be empty
    remedy : what to do
    line : line of the file, counted from 1, where it is known
    """

    key: str
    problem: str
    given: str
    allowed: str
    remedy: str
    line: int | None = None

    def render(self) -> str:
        """Text of the fault: a headline, then one indented line for each of given, allowed and remedy."""
        key = _shown(self.key, LONGEST_KEY)
        place = key if self.line is None else f"{key} (line {self.line})".lstrip()
        problem = _shown(self.problem, LONGEST_PART)
        headline = f"{place}: {problem}" if place else problem
        details = (("given", self.given), ("allowed", self.allowed), ("remedy", self.remedy))
        return "\n".join([headline, *(f"  {word}: {_shown(text, LONGEST_PART)}" for word, text in details if text)])

    def error(self, source: str | Path | None = None) -> SceneError:
        """An error of this fault alone."""
        return SceneError([self], source)

    def of_linkage(self) -> LinkageError:
        """The same of a linkage."""
        return LinkageError([self])


def _shown(text: str, most: int) -> str:
    """A text that is safe for a terminal: names in a file may be very long or hold escape sequences."""
    text = "".join(letter if letter.isprintable() else "?" for letter in text)
    return text if len(text) <= most else f"{text[:most]}..."


class SceneError(BallpassError, ValueError):
    """The scene is wrong.

    Parameters
    ----------
    faults : at least one fault
    source : the scene file, named in the message where it is known
    """

    def __init__(self, faults: Iterable[Fault], source: str | Path | None = None) -> None:
        self.faults: tuple[Fault, ...] = tuple(faults)
        self.source: str | None = None if source is None else str(source)
        if not self.faults:
            raise TypeError("an error of a scene needs at least one fault")
        count = "1 fault" if len(self.faults) == 1 else f"{len(self.faults)} faults"
        head = f"{self.source or 'the scene'}: {count}"
        listed = [fault.render() for fault in self.faults[:MOST_FAULTS]]
        if len(self.faults) > MOST_FAULTS:
            listed.append(f"... and {len(self.faults) - MOST_FAULTS} more; correct these first")
        super().__init__("\n".join([head, *listed]))


class LinkageError(SceneError):
    """The linkage cannot be derived or assembled: wrong mobility, no order of assembly, a position that locks."""
