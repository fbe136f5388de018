"""Checks of the values of a scene: notes faults, and the bounds that were checked."""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping, Sequence
from itertools import pairwise

from ballpass.derive.scene.errors import Fault
from ballpass.derive.scene.quantity import Bounds, Quantity, Vector


class Checker:
    """Notes faults, and the bounds it checks; a comparison with NaN is false, so every check asks for what is wrong."""

    def __init__(self, given: Mapping[str, str]) -> None:
        self.given = given
        self.faults: list[Fault] = []
        self.bounds: dict[str, Bounds] = {}

    def show(self, quantity: Quantity) -> str:
        """The value as the file has it, else in SI."""
        unit = "" if quantity.unit == "1" else f" {quantity.unit}"
        return self.given.get(quantity.path, f"{quantity.value:.9g}{unit}")

    def fault(self, path: str, problem: str, given: str, allowed: str, remedy: str) -> None:
        """Note a fault."""
        self.faults.append(Fault(key=path, problem=problem, given=given, allowed=allowed, remedy=remedy))

    def positive(self, quantity: Quantity | None, remedy: str = "give a positive value") -> None:
        """Above zero."""
        if quantity is None:
            return
        self.bounds[quantity.path] = Bounds(above=0.0)
        if quantity.value <= 0.0:
            what = "zero" if quantity.value == 0.0 else "negative"
            self.fault(quantity.path, f"the value is {what}", self.show(quantity), "a value above zero", remedy)

    def not_negative(self, quantity: Quantity | None, remedy: str = "give zero or a positive value") -> None:
        """Zero or above."""
        if quantity is None:
            return
        self.bounds[quantity.path] = Bounds(least=0.0)
        if quantity.value < 0.0:
            self.fault(quantity.path, "the value is negative", self.show(quantity), "zero or a value above it", remedy)

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

    def polar(self, vector: Vector) -> None:
        """The amount of a vector in polar form is not negative."""
        if vector.kind == "polar":
            self.not_negative(vector.first, "give the amount, and turn the angle by 180 deg")

    def within(self, quantity: Quantity, bounds: Bounds) -> None:
        """A value within bounds that its owner gives."""
        if bounds == Bounds(least=0.0):
            self.not_negative(quantity)
            return
        self.bounds[quantity.path] = bounds
        value = quantity.value
        checks = (
            (bounds.above, "above", operator.le),
            (bounds.least, "from", operator.lt),
            (bounds.most, "up to", operator.gt),
            (bounds.below, "below", operator.ge),
        )
        given = [(bound, words, wrong) for bound, words, wrong in checks if bound is not None]
        if any(wrong(value, bound) for bound, _, wrong in given):
            problem = "the value is negative" if value < 0.0 else "the value is out of its bounds"
            allowed = "a value " + " ".join(f"{words} {bound:g}" for bound, words, _ in given)
            self.fault(quantity.path, problem, self.show(quantity), allowed, "correct the value")

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
