"""The table [run] of a scene file: how long and how exactly it is simulated, and what it gives.

In: the table.  Out: records, possibly with placeholders where faults were noted.
"""

from __future__ import annotations

from ballpass.derive.scene.records import Run
from ballpass.derive.scene.schema import Table, listing
from ballpass.derive.scene.units import show

METHODS = (
    "auto",
    "stepper",
    "stepper-rodas4",
    "stepper-rodas5p",
    "stepper-dp54",
    "stepper-dop853",
    "cvodes",
)


def read_run(table: Table) -> tuple[Run, tuple[str, ...]]:
    """Length, samples and method of a run, and the names of its outputs."""
    with table as run:
        run.know("cycles", "duration", "transient_cycles", "samples_per_cycle", "method", "rtol", "outputs")
        both = [key for key in ("cycles", "duration") if key in run.data]
        if len(both) != 1 and not run.missing:
            run.fault(
                "",
                "the length of the run is given twice" if both else "the length of the run is missing",
                given=listing(both),
                allowed='either cycles, as in 4, or duration, as in "0.5 s"',
                remedy="delete one of the two" if both else "add cycles = 4",
            )
        cycles = run.number("cycles", example="4") if "cycles" in both else None
        duration = (
            run.quantity("duration", "s", "Duration of the run", "", example="0.5 s").value
            if "duration" in both
            else None
        )
        for key, length in (("cycles", cycles), ("duration", duration)):
            if length is not None and length <= 0.0:
                run.fault(
                    key,
                    "the run has no length",
                    given=show(run.data[key]),
                    allowed="a value above zero",
                    remedy="give a positive value",
                )
        transient = run.number("transient_cycles", example="2", default=0.0)
        _check_transient(run, transient, cycles)
        rtol = run.number("rtol", example="1e-6", default=1e-6)
        if rtol < 1e-13 or rtol > 1e-1:
            run.fault(
                "rtol",
                "the relative tolerance lies outside its bounds",
                given=show(run.data.get("rtol")),
                allowed="a number from 1e-13 to 0.1",
                remedy="write rtol = 1e-6 where nothing speaks for another value",
            )
        outputs = _read_outputs(run)
        return (
            Run(
                cycles=cycles,
                duration=duration,
                transient_cycles=transient,
                samples_per_cycle=run.integer("samples_per_cycle", 16, 1_000_000, example="2000", default=2000),
                method=run.choice("method", METHODS, default="auto") or "auto",
                rtol=rtol,
            ),
            outputs,
        )


def _check_transient(run: Table, transient: float, cycles: float | None) -> None:
    if transient < 0.0:
        run.fault(
            "transient_cycles",
            "the value is negative",
            given=show(run.data["transient_cycles"]),
            allowed="zero or a value above it",
            remedy="write 0 to keep the whole run",
        )
    elif cycles is not None and cycles > 0.0 and transient >= cycles:
        run.fault(
            "transient_cycles",
            "the transient cycles fill the whole run",
            given=f"{transient:g} of {cycles:g} cycles",
            allowed="fewer than cycles",
            remedy="run more cycles, or drop fewer",
        )


def _read_outputs(run: Table) -> tuple[str, ...]:
    example = '["inner.*", "ball.force"]'
    given = run.take("outputs", example)
    if given is None:
        return ()
    if not isinstance(given, list) or not given:
        run.fault(
            "outputs",
            "this is no list of names of outputs",
            given=show(given),
            allowed=f"a list of names and patterns, as in {example}",
            remedy=f"write outputs = {example}",
        )
        return ()
    patterns = []
    for number, pattern in enumerate(given, start=1):
        if isinstance(pattern, str) and pattern.strip() and len(pattern) <= 200:
            patterns.append(pattern.strip())
            continue
        run.fault(
            "outputs",
            f"entry {number} is no name of an output",
            given=show(pattern),
            allowed='a name or a pattern, as in "inner.y" or "inner.*"',
            remedy="delete the entry, or write a name",
        )
    return tuple(patterns)
