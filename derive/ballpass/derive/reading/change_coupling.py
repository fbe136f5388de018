"""The same scene with its bearings coupled the other way (one-way or two-way), for a trade to compare.

In: the data of a scene file.  Out: data of a scene whose bearings are all coupled one-way, as in the paper, or two-way.
"""

from __future__ import annotations

from typing import Any, Literal

from ballpass.derive.scene.errors import Fault
from ballpass.derive.scene.table import FRAME
from ballpass.derive.scene.units import parse_quantity

Coupling = Literal["one-way", "two-way"]

#: The paper's mass of the inner ring, Eq. (3), where ring and crankpin are part of the crank's mass: a ring has some
#: mass, and a milligramme adds nothing.
_LEVER_RULE = {"equivalent_mass": {"ring": "1 mg", "crankpin": "0 kg", "crank": "whole"}}


def recoupled(data: dict[str, Any], coupling: Coupling) -> dict[str, Any]:
    """Data of the scene with all bearings coupled so.

    One-way, a bearing at the driver's joint carries its share of the reaction of the ideal linkage and moves the mass
    of Eq. (3); bearings elsewhere become ideal joints.  Two-way, the inner ring moves with the driver.

    Raises
    ------
    SceneError
        No bearing changes, or none is left.
    """
    mechanism = data.get("mechanism", {})
    driver = mechanism.get("driver", {}).get("joint")
    several = "bearings" in data
    tables = data["bearings"] if several else {"": data.get("bearing", {})}
    changed = {
        name: table for name, table in tables.items() if table.get("coupling", "one-way") != coupling and mechanism
    }
    if not changed:
        _refuse(f"no bearing of the scene is coupled otherwise than {coupling}", "a scene with others")
    kept = {}
    joints = [table.get("joint") for table in changed.values()]
    side_by_side = sum(parse_quantity(t.get("count", 1), "1") for t in changed.values() if t.get("joint") == driver)
    for name, table in tables.items():
        if name not in changed:
            kept[name] = table
        elif coupling == "two-way":
            first = name == next(n for n, other in changed.items() if other.get("joint") == table.get("joint"))
            kept[name] = _two_way(table, alone=joints.count(table.get("joint")) == 1, first=first)
        elif table.get("joint") == driver:
            kept[name] = _one_way(table, side_by_side)
    if not kept:
        _refuse(f"no bearing is at the driver's joint {driver}", "a bearing there, which the paper's model can load")
    run = {**data.get("run", {}), "outputs": ["drive_torque"]}
    rest = {key: value for key, value in data.items() if key not in ("bearing", "bearings", "duty")}
    title = f"{data.get('title', 'The scene')}, {coupling}"
    return {**rest, "title": title, "run": run, **({"bearings": kept} if several else {"bearing": kept[""]})}


def _one_way(table: dict[str, Any], side_by_side: float) -> dict[str, Any]:
    if table.get("inner_ring", {}).get("body") == FRAME:
        _refuse("the inner ring does not turn with the driver", "an inner ring on the driven body")
    rest = {key: value for key, value in table.items() if key not in ("coupling", "count")}
    return {**rest, "share": 1.0 / side_by_side, "inner_ring": _LEVER_RULE}


def _two_way(table: dict[str, Any], *, alone: bool, first: bool) -> dict[str, Any]:
    if "position" in table:
        _refuse("coupled two-way, bearings stand in the plane of the linkage", "bearings with a share")
    share = parse_quantity(table.get("share", 1), "1") if alone else 1.0
    rest = {key: value for key, value in table.items() if key not in ("share", "inner_ring")}
    if not first and isinstance(rest.get("initial"), dict):  # its inner ring moves as that of the first
        rest["initial"] = {key: value for key, value in rest["initial"].items() if not key.startswith("inner")}
    return {**rest, "coupling": "two-way", "count": 1.0 / share}


def _refuse(problem: str, allowed: str) -> None:
    raise Fault(
        key="bearing",
        problem=f"there is no such variant of the scene: {problem}",
        given="this scene",
        allowed=allowed,
        remedy="write the simpler scene yourself and name its file",
    ).error()
