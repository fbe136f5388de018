"""Values of a load: signs, and what they must be to each other."""

from __future__ import annotations

import math

from ballpass.derive.scene.checker import Checker
from ballpass.derive.scene.records import Load, TableLoad


def check_load(checker: Checker, load: Load) -> None:
    """Note faults of the numbers of a load."""
    if isinstance(load.law, TableLoad):
        _check_table(checker, load.path, load.law)
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


def _check_table(checker: Checker, path: str, table: TableLoad) -> None:
    rows = {table.over: len(table.rows), "x": len(table.x), "y": len(table.y)}
    if min(rows.values()) == 0:  # reported when it was read
        return
    if min(rows.values()) != max(rows.values()):
        checker.fault(
            path,
            "the columns of the table differ in length",
            ", ".join(f"{name}: {count}" for name, count in rows.items()),
            "three columns of one length",
            f"give every row a {table.over}, x and y",
        )
    elif len(table.rows) < 2:
        checker.fault(
            f"{path}.{table.over}",
            "the table has too few rows",
            str(len(table.rows)),
            "two rows or more",
            'add rows, or write type = "constant"',
        )
    for before, behind in zip(table.rows, table.rows[1:], strict=False):
        if behind.value <= before.value:
            checker.fault(
                behind.path,
                f"the {table.over} does not increase",
                f"{checker.show(behind)} after {checker.show(before)}",
                f"strictly increasing {table.over}s",
                f"sort the rows by {table.over}; write a jump as two rows with a short {table.over} between them, or "
                "as a load with a window",
            )
    if table.over == "angle" and table.rows[-1].value - table.rows[0].value >= math.tau * (1.0 - 1e-12):
        checker.fault(
            table.rows[-1].path,
            "the angles of the table cover a whole turn",
            f"{checker.show(table.rows[0])} to {checker.show(table.rows[-1])}",
            "angles within less than a turn: the last row joins the first, one turn later",
            "leave the last row out",
        )
