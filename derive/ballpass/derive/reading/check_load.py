"""Values of a load: signs, and what they must be to each other."""

from __future__ import annotations

from ballpass.derive.scene.checker import Checker
from ballpass.derive.scene.records import Load, TableLoad


def check_load(checker: Checker, load: Load) -> None:
    """Note faults of the numbers of a load."""
    if isinstance(load.law, TableLoad):
        table = load.law
        remedy = f'give every row {table.over}, x and y; add rows, or write type = "constant"'
        checker.rows(load.path, {table.over: table.rows, "x": table.x, "y": table.y}, remedy)
        if table.over == "angle":
            checker.within_a_turn(table.rows)
    _check_windows(checker, load)


def _check_windows(checker: Checker, load: Load) -> None:
    window = load.angle_window
    if window is not None and window.end is not None:
        checker.window(window.start, window.end)
    window = load.time_window
    if window is not None and window.end is not None and window.end.value <= window.start.value:
        checker.fault(
            window.end.path,
            "the load ends before it begins",
            f"start {checker.show(window.start)}, end {checker.show(window.end)}",
            "an end behind the start",
            "give a later end, or none for a load that does not end",
        )
