"""Checks of the values of a scene: notes faults."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

from ballpass.derive.scene.errors import Fault
from ballpass.derive.scene.quantity import Quantity


class Checker:
    """Notes faults; a comparison with NaN is false, so every check asks for what is wrong."""

    def __init__(self, given: Mapping[str, str]) -> None:
        self.given = given
        self.faults: list[Fault] = []

    def show(self, quantity: Quantity) -> str:
        """The value as the file has it, else in SI."""
        unit = "" if quantity.unit == "1" else f" {quantity.unit}"
        return self.given.get(quantity.path, f"{quantity.value:.9g}{unit}")

    def fault(self, path: str, problem: str, given: str, allowed: str, remedy: str) -> None:
        """Note a fault."""
        self.faults.append(Fault(key=path, problem=problem, given=given, allowed=allowed, remedy=remedy))

    def within(self, quantity: Quantity) -> None:
        """A value within the bounds of its key."""
        bounds = quantity.limits.bounds
        problem = "" if bounds is None else bounds.problem(quantity.value)
        if bounds is not None and problem:
            self.fault(quantity.path, problem, self.show(quantity), bounds.allowed, quantity.limits.advice)

    def window(self, start: Quantity, end: Quantity) -> None:
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

    def rows(self, path: str, argument: Sequence[Quantity], values: Sequence[Quantity], word: str, remedy: str) -> bool:
        """Two columns of a table: one length, two rows or more, the first one increasing; whether there are rows.

        Parameters
        ----------
        path : of the table
        word : what the first column holds, "angle"
        remedy : for columns that differ in length, or are too short
        """
        counts = len(argument), len(values)
        if min(counts) == 0:  # reported when it was read
            return False
        if counts[0] != counts[1] or counts[0] < 2:
            self.fault(
                path,
                "the columns of the table differ in length" if counts[0] != counts[1] else "the table has too few rows",
                " and ".join(str(count) for count in counts),
                "two columns of one length, two rows or more",
                remedy,
            )
        for before, behind in pairwise(argument):
            if behind.value <= before.value:
                self.fault(
                    behind.path,
                    f"the {word} does not increase",
                    f"{self.show(behind)} after {self.show(before)}",
                    f"strictly increasing {word}s",
                    f"sort the rows by {word}; write a jump as two rows with a small step of {word} between them",
                )
        return True
