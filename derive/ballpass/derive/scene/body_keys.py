"""Keys that name bodies and their points: joints, forces and springs read them alike."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ballpass.derive.scene.records import FRAME
from ballpass.derive.scene.schema import Table, listing, suggest
from ballpass.derive.scene.units import show

#: Names of the points of every body and of the frame.
Points = Mapping[str, Sequence[str]]


def read_pair(data: Table, key: str, example: str) -> tuple[str, str] | None:
    """A list of two names; None, with a fault, where there is none."""
    given = data.take(key, example)
    if given is None:
        return None
    if isinstance(given, list) and len(given) == 2 and all(isinstance(item, str) for item in given):
        return given[0], given[1]
    data.fault(
        key, "this is not a list of two names", given=show(given), allowed=example, remedy=f"write {key} = {example}"
    )
    return None


def refuse_unknown_body(data: Table, key: str, body: str, points: Points) -> bool:
    """Note a fault where there is no such body; whether there is."""
    if body in points:
        return True
    names = list(points)
    data.fault(
        key,
        f"there is no body {show(body)}",
        given=show(data.data[key]),
        allowed=listing(names),
        remedy=suggest(body, names, f"add the table [mechanism.bodies.{body}], or name one of the bodies"),
    )
    return False


def refuse_unknown_point(data: Table, key: str, body: str, point: str, points: Points) -> None:
    """Note a fault where a known body has no such point."""
    if body not in points or point in points[body]:
        return
    place = "mechanism.frame.points" if body == FRAME else f"mechanism.bodies.{body}.points"
    near = suggest(point, points[body], "")
    data.fault(
        key,
        f"the body {show(body)} has no point {show(point)}",
        given=show(data.data[key]) if key in data.data else f"nothing, which means the joint's own name {show(point)}",
        allowed=listing(points[body]),
        remedy=f"{near + ' Or ' if near else ''}add {show(point)} to [{place}], or name its point",
    )


def read_two_points(data: Table, points: Points) -> tuple[tuple[str, str], tuple[str, str]]:
    """Two different bodies and a point of each, of the keys bodies and points; empty names, with faults noted."""
    bodies = read_two_bodies(data, points)
    ends = read_pair(data, "points", '["anchor", "tip"]') or ("", "")
    for body, point in zip(bodies, ends, strict=True):
        if point:
            refuse_unknown_point(data, "points", body, point, points)
    return bodies, ends


def read_moving_body(data: Table, points: Points) -> str:
    """The moving body a load acts on; empty, with a fault, where there is none."""
    body = data.text("body", "slider")
    if not body:
        return ""
    if body == FRAME:
        data.fault(
            "body",
            "a load on the frame moves nothing",
            given=show(body),
            allowed=listing([name for name in points if name != FRAME]),
            remedy="name a moving body",
        )
        return ""
    return body if refuse_unknown_body(data, "body", body, points) else ""


def read_two_bodies(data: Table, points: Points) -> tuple[str, str]:
    """The two different bodies of the key bodies; empty names, with a fault, where there are none."""
    bodies = read_pair(data, "bodies", '["frame", "lever"]')
    if bodies is None:
        return "", ""
    known = [refuse_unknown_body(data, "bodies", body, points) for body in bodies]
    if bodies[0] == bodies[1]:
        data.fault(
            "bodies",
            "both ends are on one body",
            given=listing(bodies),
            allowed="two different bodies",
            remedy="name the other body",
        )
    return bodies if all(known) else ("", "")
