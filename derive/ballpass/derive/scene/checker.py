"""Checks of the values of a scene: notes faults."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

from ballpass.derive.scene.errors import Fault
from ballpass.derive.scene.quantity import SceneNumber
from ballpass.runtime.contract.units import FAR_ANGLE, MOST_ANGLE


class Checker:
    """Notes faults.  Every check compares for the wrong case, because comparisons with NaN are false."""

    def __init__(self, given: Mapping[str, str]) -> None:
        self.given = given
        self.faults: list[Fault] = []

    def show(self, quantity: SceneNumber) -> str:
        """The value as the file has it, else in SI."""
        unit = "" if quantity.unit == "1" else f" {quantity.unit}"
        return self.given.get(quantity.path, f"{quantity.value:.9g}{unit}")

    def fault(self, path: str, problem: str, given: str, allowed: str, remedy: str) -> None:
        """Note a fault."""
        self.faults.append(Fault(key=path, problem=problem, given=given, allowed=allowed, remedy=remedy))

    def within(self, quantity: SceneNumber) -> None:
        """A value within the bounds of its key."""
        bounds = quantity.limits.bounds
        problem = "" if bounds is None else bounds.problem(quantity.value)
        if bounds is not None and problem:
            self.fault(quantity.path, problem, self.show(quantity), bounds.allowed, quantity.limits.advice)
        if quantity.unit == "rad" and abs(quantity.value) >= MOST_ANGLE:  # of a file, that is refused where it is read
            self.fault(quantity.path, FAR_ANGLE, self.show(quantity), "", "give the angle without its whole turns")

    def window(self, start: SceneNumber, end: SceneNumber) -> None:
        """Two angles that differ, by less than a turn."""
        span = end.value - start.value
        if span == 0.0 or abs(span) >= math.tau * (1.0 - 1e-12):
            self.fault(
                end.path,
                "the window is empty or as long as a whole turn",
                f"start {self.show(start)}, end {self.show(end)}",
                "two angles that differ, by less than a turn; from start counter-clockwise to end",
                "give another end, or delete the window for a load that always acts",
            )

    def rows(self, path: str, columns: Mapping[str, Sequence[SceneNumber]], remedy: str) -> bool:
        """Columns of a table: one length, two rows or more, the first one increasing; whether there are rows.

        Parameters
        ----------
        path : of the table
        columns : by name
        remedy : for columns that differ in length, or are too short
        """
        counts, word = {name: len(column) for name, column in columns.items()}, next(iter(columns))
        if min(counts.values()) == 0:  # reported when it was read
            return False
        differ = len(set(counts.values())) > 1
        if differ or counts[word] < 2:
            self.fault(
                path if differ else f"{path}.{word}",
                "the columns of the table differ in length" if differ else "the table has too few rows",
                ", ".join(f"{name}: {count}" for name, count in counts.items()),
                "columns of one length, two rows or more",
                remedy,
            )
        for before, behind in pairwise(columns[word]):
            if behind.value <= before.value:
                self.fault(
                    behind.path,
                    f"the {word} does not increase",
                    f"{self.show(behind)} after {self.show(before)}",
                    f"strictly increasing {word}s",
                    f"sort the rows by {word}; write a jump as two rows with a small step of {word} between them",
                )
        return True

    def within_a_turn(self, angles: Sequence[SceneNumber], turns: int = 1) -> None:
        """Angles of a table that is periodic over a turn, or several."""
        if angles[-1].value - angles[0].value >= turns * math.tau * (1.0 - 1e-12):
            period = "a turn" if turns == 1 else f"{turns} turns"
            self.fault(
                angles[-1].path,
                f"the angles of the table cover {'a whole turn' if turns == 1 else period}",
                f"{self.show(angles[0])} to {self.show(angles[-1])}",
                f"angles within less than {period}: the last row joins the first, {period.replace('a ', 'one ')} later",
                "leave the last row out; a table of a force over two turns has turns = 2",
            )
