"""The tables [duty.<state>], [bearing.lubrication] and [bearing.alignment]: inputs of the rating life beside the model.

In: the tables.  Out: records, possibly with placeholders where faults were noted.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from ballpass.derive.reading.values import parse_override, with_values
from ballpass.derive.scene.errors import Fault, SceneError
from ballpass.derive.scene.rating_records import Alignment, Lubrication
from ballpass.derive.scene.read_keys import read_inner, read_record
from ballpass.derive.scene.records import DutyState, Scene
from ballpass.derive.scene.table import Table, listing
from ballpass.derive.scene.units import show
from ballpass.runtime.ratings.lubrication import FILTERS

#: Shares of all states add up to one within this [1].
SHARES = 1e-6


def read_duty(table: Table, scene: Scene) -> tuple[DutyState, ...]:
    """States of a duty cycle of a scene."""
    with table as duty:
        states = tuple(_read_state(duty.table(name, "share"), name, scene) for name in duty.names("state"))
        total = sum(state.share for state in states)
        if not duty.missing and not math.isnan(total) and abs(total - 1.0) > SHARES:
            duty.fault(
                "",
                "the shares of the states do not add up to one",
                given=f"{total:.6g} in {len(states)} states",
                allowed="shares of the time, 1 together",
                remedy="correct them, or add a state for the rest of the time",
            )
    return states


def duty_faults(scene: Scene) -> list[Fault]:
    """Faults of the numbers of the states, for a scene without other faults."""
    found = []
    for state in scene.duty:
        try:
            with_values(scene, dict(state.parameters))
        except SceneError as error:
            # a state at rest has no turns, and needs none
            faults = (fault for fault in error.faults if not fault.key.startswith("run."))
            found += [replace(fault, key=f"duty.{state.name}.set.{fault.key}") for fault in faults]
    return found


def _read_state(table: Table, name: str, scene: Scene) -> DutyState:
    with table as state:
        numbers: dict[str, float] = {}
        given = state.table("set", required=False).data
        for path, value in _leaves(given):
            if not isinstance(value, str | int | float) or isinstance(value, bool):
                state.fault(
                    f"set.{path}",
                    "this is not a value of a number",
                    given=show(value),
                    allowed='text with a unit, as in "20 um"',
                    remedy="write one number for one path",
                )
                continue
            try:
                _, numbers[path] = parse_override(scene, f"{path}={value}")
            except SceneError as error:
                for fault in error.faults:
                    words = {"given": fault.given, "allowed": fault.allowed, "remedy": fault.remedy}
                    state.fault(f"set.{path}", fault.problem, **words)
        return read_record(DutyState, state, name=name, parameters=tuple(numbers.items()))


def _leaves(data: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Paths and values: dotted keys stand in tables of tables, quoted ones do not."""
    for key, value in data.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def read_alignment(table: Table) -> Alignment | None:
    """Misalignment and shaft of a bearing; None where the scene says nothing of them."""
    example = "misalignment, or span and shaft_diameter"
    return read_inner(Alignment, table, "alignment", example) if table.has("alignment") else None


def read_lubrication(table: Table) -> Lubrication | None:
    """Lubricant film and contamination of a bearing; None where the scene does not give them."""
    if not table.has("lubrication"):
        return None
    with table.table("lubrication") as film:
        found = read_record(Lubrication, film)
        if found.oil_code is not None and found.oil_code not in FILTERS[found.filter or "off line"]:
            film.fault(
                "oil_code",
                "ISO 281 has no contamination factor for this code with a filter in line",
                given=show(found.oil_code),
                allowed=listing([*FILTERS["in line"]]),
                remedy='write filter = "off line", or name a cleaner oil',
            )
        return found
