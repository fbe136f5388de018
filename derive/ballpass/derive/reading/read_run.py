"""The table [run] of a scene file: how long and how exactly it is simulated, and what it gives.

In: the table.  Out: records, possibly with placeholders where faults were noted.
"""

from __future__ import annotations

from ballpass.derive.scene.read_keys import read_keys, read_record
from ballpass.derive.scene.records import OUTPUTS, Run
from ballpass.derive.scene.table import Table


def read_run(table: Table) -> tuple[Run, tuple[str, ...]]:
    """Length, samples and method of a run, and the names of its outputs."""
    with table:
        run = read_record(Run, table)
        if run.cycles is not None and 0.0 < run.cycles <= run.transient_cycles:
            table.fault(
                "transient_cycles",
                "the transient cycles fill the whole run",
                given=f"{run.transient_cycles:g} of {run.cycles:g} cycles",
                allowed="fewer than cycles",
                remedy="run more cycles, or drop fewer",
            )
        return run, read_keys(table, {"outputs": OUTPUTS})["outputs"]
