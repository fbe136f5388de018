"""Check a Jacobian: generated derivatives beside extrapolated differences of the function itself.

In: a model, numbers, outputs and variables to differentiate by, an instant and a state.  Out: a `CheckedJacobian` with
a verdict for each entry.

The differences share only the values of the function with the derivatives: parameters are changed and everything is
computed anew, including the derived constants, phases and tables.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.certify.certificate import UNCHECKED, Check, Verdict, compare
from ballpass.runtime.certify.differences import richardson
from ballpass.runtime.contract.json_text import finite
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.contract.units import printed_unit
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.point.evaluate import neighbour, point
from ballpass.runtime.point.jacobian import (
    CRANK_ANGLE,
    TIME,
    Rows,
    directions_of,
    rows_of,
    turning_speed,
    values_of_rows,
)
from ballpass.runtime.point.linearize import onset_notes
from ballpass.runtime.point.slopes import slopes
from ballpass.runtime.report.report import Report, ReportTable
from ballpass.runtime.report.reported import Reported
from ballpass.runtime.time import timeline

#: A factor of a unit such as "N*s/m^1.5": the mark before it, its name, its power.
_FACTOR = re.compile(r"([*/]?)([A-Za-z]+)(?:\^([0-9.]+))?")

Array = NDArray[np.float64]

#: Relative disagreement that is allowed [1]: both routes are exact but for rounding.
AGREEMENT = 1e-6

#: Derivatives that count as zero, relative to the largest of the row times its step [1].
NOTHING = 1e-9

#: Largest step, relative to the value that is moved.
STEP = 1e-3

#: The same for values of zero, by unit.
STEP_FROM_ZERO = {"m": 1e-7, "m/s": 1e-4, "rad": 1e-3, "s": 1e-6, "N": 1.0}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CheckedJacobian(Reported):
    """Derivatives and, for each, the result of a second route.

    Attributes
    ----------
    rows, columns : labels
    row_units, column_units : SI units
    value : derivatives, or the mean of both sides where these differ, shape (rows, columns) [row's unit / column's
        unit]
    below, above : one-sided derivatives, same shape
    differ : where they are not equal, same shape
    at : values of the rows, shape (rows,)
    checks : one for each entry, row by row; all `UNCHECKED` where the check was turned off
    notes : where the laws have no derivative at this state, in words
    time, x : instant [s] and state
    """

    rows: tuple[str, ...]
    columns: tuple[str, ...]
    row_units: tuple[str, ...]
    column_units: tuple[str, ...]
    value: Array
    below: Array
    above: Array
    differ: NDArray[np.bool_]
    at: Array
    checks: tuple[tuple[Check, ...], ...]
    notes: tuple[str, ...]
    time: float
    x: Array

    @property
    def verdict(self) -> Verdict:
        """Verdict of all entries: the worst one; disagreement first, then unchecked."""
        all_of_them = [check.verdict for row in self.checks for check in row]
        for verdict in (Verdict.DISAGREES, Verdict.NOT_CHECKED):
            if verdict in all_of_them:
                return verdict
        return Verdict.VERIFIED

    def _entries(self) -> list[dict[str, Any]]:
        """Plain data of each derivative, row by row."""
        entries = []
        for i, row in enumerate(self.rows):
            for j, column in enumerate(self.columns):
                check = self.checks[i][j]
                entries.append(
                    {
                        "of": row,
                        "wrt": column,
                        "value": self.value[i, j],
                        "sides": [self.below[i, j], self.above[i, j]] if self.differ[i, j] else None,
                        "unit": _quotient(self.row_units[i], self.column_units[j]),
                        "second": check.value,
                        "second_uncertainty": check.uncertainty,
                        "verdict": check.verdict.value,
                        "reason": check.reason,
                    }
                )
        return entries

    def _report(self) -> Report:
        """Entries with their check, and the notes; entries that are structurally zero are left out and counted."""
        entries = finite(self._entries())
        shown = [
            entry
            for entry in entries
            if entry["verdict"] == Verdict.DISAGREES.value
            or entry["value"] != 0.0
            or entry["sides"]
            or len(self.rows) == 1
        ]
        agreed = all(entry["verdict"] == Verdict.VERIFIED.value for entry in shown)  # the title says so for all
        rows = []
        for entry in shown:
            value, second = (None if entry[key] is None else f"{entry[key]:z.7g}" for key in ("value", "second"))
            if entry["sides"]:
                value = "{:z.7g} or {:z.7g}".format(*entry["sides"])
            verdict = [] if agreed else [entry["verdict"]]
            unit = printed_unit(entry["unit"])
            rows.append((entry["of"], entry["wrt"], value or "not finite", second or "", unit, *verdict))
        table = ReportTable(
            title=f"Derivatives at t = {self.time:.6g} s: {self.verdict.value}",
            heads=("quantity", "parameter", "derivative", "by differences", "unit", *([] if agreed else ["verdict"])),
            rows=rows,
            right=("derivative", "by differences"),
        )
        still = len(entries) - len(shown)
        disagrees = "the two routes disagree; both numbers are shown. " + " ".join(self.notes)
        return Report(
            parts=(table, *([f"{still} more {'is' if still == 1 else 'are'} zero."] if still else []), *self.notes),
            facts={
                "time": {"value": self.time, "unit": "s"},
                "state": self.x.tolist(),
                "values": {
                    row: {"value": value, "unit": unit}
                    for row, value, unit in zip(self.rows, self.at, self.row_units, strict=True)
                },
                "jacobian": entries,
                "verdict": self.verdict.value,
                "notes": list(self.notes),
            },
            records=entries,
            index=("of", "wrt"),
            fault=disagrees if self.verdict is Verdict.DISAGREES else "",
        )


def checked_jacobian(
    model: LoadedModel,
    numbers: Numbers,
    of: str | Sequence[str],
    wrt: str | Sequence[str],
    *,
    t: float,
    x: Sequence[float] | np.ndarray | None,
    check: bool = True,
) -> CheckedJacobian:
    """Derivatives at one time and state with a verdict for each; arguments as for `Model.jacobian`.

    Raises
    ------
    RequestError
        Unknown names.

    Examples
    --------
    >>> speed, numbers = "mechanism.driver.speed", model.numbers()
    >>> found = checked_jacobian(model, numbers, "drive_torque", speed, t=0.01, x=None)
    >>> f"{found.value.item():.3g}", found.checks[0][0].verdict.value
    ('-0.0425', 'verified')
    """
    parts = rows_of(model, of)
    directions = directions_of(model, numbers, wrt, t)
    there = point(model, numbers, t, x)
    state = np.asarray(there["x"], dtype=float)
    found = slopes(model, parts, directions, there)
    value, differ = found.value, found.differ
    at = values_of_rows(model, parts, there)
    columns = []
    for j, (label, unit) in enumerate(zip(directions.labels, directions.units, strict=True)):
        if not check:
            columns.append([UNCHECKED] * len(at))
            continue
        base, step, moved = _motion(model, numbers, parts, label, unit, t, state)
        second = richardson(moved, base, step)
        quantum = NOTHING * np.maximum(np.abs(at), 1e-3 * float(np.max(np.abs(at), initial=0.0))) / step
        columns.append(
            [
                compare(
                    float(value[i, j]),
                    0.0,
                    float(second.value[i]),
                    float(second.error[i]),
                    route="differences",
                    quantum=float(quantum[i]),
                    agreement=AGREEMENT,
                )
                if not differ[i, j]
                else replace(UNCHECKED, reason="there is no derivative: the sides differ")
                for i in range(len(at))
            ]
        )
    return CheckedJacobian(
        rows=tuple(label for part in parts for label in part.labels),
        columns=directions.labels,
        row_units=tuple(unit for part in parts for unit in part.units),
        column_units=directions.units,
        value=value,
        below=found.below,
        above=found.above,
        differ=differ,
        at=at,
        checks=tuple(tuple(column[i] for column in columns) for i in range(len(at))),
        notes=(*found.notes(), *onset_notes(model, there)),
        time=t,
        x=state,
    )


def _motion(
    model: LoadedModel, numbers: Numbers, parts: Sequence[Rows], name: str, unit: str, t: float, x: Array
) -> tuple[float, float, Callable[[float], Array]]:
    """Where a name stands, the largest step for it, and the rows as a function of its value."""
    there = point(model, numbers, t, x)
    if name in (TIME, CRANK_ANGLE):
        rate = 1.0 if name == TIME else turning_speed(model, numbers, t)
        speed = abs(float(timeline.driver(model.manifest, numbers.values).at(t)[1]))
        step = STEP / speed if speed else STEP_FROM_ZERO["s"]
        # with the inputs of this instant, as between breakpoints: a gate's jump has no derivative
        return 0.0, step * abs(rate), lambda v: values_of_rows(model, parts, {**there, "t": v / rate})
    if name in model.states:
        k = model.states.index(name)
        alike = [
            info.unit == unit for info in model.manifest.states
        ]  # a driver's angle is no measure of a ring's place
        size = max(float(np.max(np.abs(x[alike]))), STEP_FROM_ZERO.get(unit, STEP))

        def with_state(v: float) -> Array:
            moved = x.copy()
            moved[k] = v
            return values_of_rows(model, parts, {**there, "x": moved})

        return float(x[k]), 0.1 * size, with_state
    base = numbers.parameters[name]

    def with_parameter(v: float) -> Array:
        return values_of_rows(model, parts, point(model, neighbour(model, numbers, {name: v}), t, x))

    return base, STEP * abs(base) or STEP_FROM_ZERO.get(unit, STEP), with_parameter


def _quotient(above: str, below: str) -> str:
    """Unit of a derivative: "m/s/s" by "m" is "1/s^2"."""
    powers: dict[str, float] = {}
    for unit, sign in ((above, 1.0), (below, -1.0)):
        for mark, name, power in _FACTOR.findall(unit):
            powers[name] = powers.get(name, 0.0) + (-sign if mark == "/" else sign) * float(power or 1.0)
    over = [f"{name}^{n:g}".removesuffix("^1") for name, n in powers.items() if n > 0.0]
    under = [f"{name}^{-n:g}".removesuffix("^1") for name, n in powers.items() if n < 0.0]
    if not under:
        return "*".join(over) or "1"
    return f"{'*'.join(over) or '1'}/{under[0] if len(under) == 1 else '(' + '*'.join(under) + ')'}"
