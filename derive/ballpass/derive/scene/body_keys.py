"""Keys that name bodies and their points: joints, forces and springs read them alike."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ballpass.derive.scene.keys import NamesKey, TextKey
from ballpass.derive.scene.table import FRAME, Table, listing, suggest
from ballpass.derive.scene.units import show

#: Names of the points of every body and of the frame; none, and no body, where their table has a fault.
Points = Mapping[str, Sequence[str]]


#: Keys of pathways, and of joints.
BODY = TextKey(words="The body it acts on", example="slider", note="a moving body")
BODIES = NamesKey(words="Its two bodies", example='["frame", "lever"]', note='different; `"frame"` may be one of them')
POINTS = NamesKey(words="A point of each body", example='["anchor", "tip"]')


def refuse_unknown_body(data: Table, key: str, body: str, points: Points) -> bool:
    """Note a fault where there is no such body; whether there is."""
    if body in points or len(points) == 1:  # that there are no bodies is a fault of their table
        return body in points
    names = list(points)
    data.fault(
        key,
        f"there is no body {show(body)}",
        given=show(data.data[key]),
        allowed=listing(names),
        remedy=suggest(body, names, f"add the table [mechanism.bodies.{body}], or name one of the bodies"),
    )
    return False


def refuse_unknown_points(data: Table, record: Any, points: Points) -> None:
    """Note a fault for each body that has no such point, for one where the points are not named."""
    for body, point in zip(record.bodies, getattr(record, "points", ()), strict=False):
        if refuse_unknown_point(data, "points", body, point, points) and "points" not in data.data:
            return


def refuse_unknown_point(data: Table, key: str, body: str, point: str, points: Points) -> bool:
    """Note a fault where a known body has points, but not this one; whether it is so."""
    if not points.get(body) or point in points[body]:
        return False
    place = "mechanism.frame.points" if body == FRAME else f"mechanism.bodies.{body}.points"
    near = suggest(point, points[body], "")
    data.fault(
        key,
        f"the body {show(body)} has no point {show(point)}",
        given=show(data.data[key]) if key in data.data else f"nothing, which means the joint's own name {show(point)}",
        allowed=listing(points[body]),
        remedy=f"{near + ' Or ' if near else ''}add {show(point)} to [{place}], or name its point",
    )
    return True


def check_names(data: Table, record: Any, points: Points) -> None:
    """Note faults of the names that a force's `body` and `point`, or `bodies` and `points`, hold."""
    if hasattr(record, "body"):
        known = check_moving_body(data, record.body, points)
        if known and hasattr(record, "point") and record.point:
            refuse_unknown_point(data, "point", record.body, record.point, points)
    if hasattr(record, "bodies"):
        check_two_bodies(data, record.bodies, points, "both ends are on one body")
        refuse_unknown_points(data, record, points)


def check_moving_body(data: Table, body: str, points: Points) -> bool:
    """Note a fault where there is no such body, or it does not move; whether it does."""
    if body != FRAME:
        return bool(body) and refuse_unknown_body(data, "body", body, points)
    data.fault(
        "body",
        "a load on the frame moves nothing",
        given=show(body),
        allowed=listing([name for name in points if name != FRAME]),
        remedy="name a moving body",
    )
    return False


def check_two_bodies(data: Table, bodies: Sequence[str], points: Points, problem: str) -> bool:
    """Note a fault for each body that does not exist, and for one body twice; whether there is none."""
    known = [refuse_unknown_body(data, "bodies", body, points) for body in bodies]
    if not bodies or bodies[0] != bodies[1]:
        return bool(bodies) and all(known)
    data.fault("bodies", problem, given=listing(bodies), allowed="two different bodies", remedy="name the other body")
    return False
