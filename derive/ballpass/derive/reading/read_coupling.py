"""Keys of the coupling between a bearing and its linkage.

In: the table of a bearing.  Out: coupling, bearings side by side, body of the inner ring; faults where keys of one
coupling stand beside the other.
"""

from __future__ import annotations

import math
from typing import Literal

from ballpass.derive.scene.bearing_records import Bearing, InnerRing
from ballpass.derive.scene.keys import TextKey
from ballpass.derive.scene.mechanism_records import Mechanism
from ballpass.derive.scene.quantity import SceneNumber
from ballpass.derive.scene.read_keys import keys_of
from ballpass.derive.scene.table import FRAME, Table, listing, suggest
from ballpass.derive.scene.units import show

#: Key of the inner ring of a bearing coupled two-way.
BODY = TextKey(
    words="Body of the joint that carries the inner ring",
    example="crank",
    when="two-way: required where both bodies move; the only key allowed then",
)


def read_coupling(table: Table, mechanism: Mechanism | None) -> Literal["one-way", "two-way"]:
    """Coupling of a bearing and its linkage; faults where the scene does not allow it."""
    coupling = keys_of(Bearing)["coupling"].read(table, "coupling")
    ring = table.data.get("inner_ring")
    two_way = "count" in table.data or (isinstance(ring, dict) and "body" in ring)
    if mechanism is not None and two_way and not {"coupling", "share"} & table.data.keys():
        table.fault(
            "coupling",
            "this key is missing",
            given='count or body of the inner ring, as with coupling = "two-way"',
            allowed='coupling = "two-way"; one-way, as by default, a bearing has a share and an inner ring with a mass',
            remedy='add coupling = "two-way"',
        )
        return "two-way"
    if (coupling is None or table.missing) and mechanism is not None:  # reported; other keys say what is meant
        return "one-way" if "share" in table.data else "two-way"
    moving = mechanism is not None and (mechanism.driver.torque, mechanism.driver.swing) != (None, None)
    if coupling == "one-way" and moving:
        table.fault(
            "coupling",
            "a bearing loaded one-way takes the reaction of a linkage whose driver turns at a given speed",
            given=show(table.data.get("coupling", "nothing, which is one-way")),
            allowed='coupling = "two-way" where [mechanism.driver.torque] drives, or the driver swings',
            remedy='write coupling = "two-way", and what such a bearing needs; or give the driver\'s speed',
        )
        return "two-way"
    if coupling == "two-way" and mechanism is None:
        table.fault(
            "coupling",
            "there is no mechanism that the bearing could act back on",
            given='"two-way"',
            allowed='"one-way" in a scene without [mechanism]',
            remedy="delete the key, or describe the mechanism",
        )
        return "one-way"
    return "two-way" if coupling == "two-way" else "one-way"


def check_count(table: Table, count: SceneNumber | None) -> None:
    """Note a fault where so many bearings cannot stand side by side."""
    if count is not None and math.isfinite(count.value) and not count.value.is_integer():
        table.fault(
            "count",
            "this is no number of bearings",
            given=show(table.data.get("count")),
            allowed="a whole number from 1",
            remedy="write count = 2 for a pair; bearings that differ have tables of their own",
        )


def read_inner_body(table: Table, mechanism: Mechanism | None, name: str | None) -> str:
    """The body that carries the inner ring: at the frame the other one, where it is not named."""
    joints = mechanism.joints if mechanism is not None else ()
    bodies = {FRAME, *(body.name for body in mechanism.bodies)} if mechanism is not None else set()
    joint = next((j for j in joints if j.name == name and bodies.issuperset(j.bodies)), None)
    with table.table("inner_ring", "body", required=False) as ring:
        ring.know("body")
        ring.refuse(
            [key for key in keys_of(InnerRing) | {"equivalent_mass": None} if key in ring.data],
            "the inner ring moves with the body that carries it, whose mass contains the ring",
            allowed='nothing but body with coupling = "two-way"',
            remedy="delete the key",
        )
        moving = [body for body in joint.bodies if body != FRAME] if joint is not None else []
        no_table = ring.missing and "inner_ring" in table.data
        if joint is None or not moving or no_table:  # what is wrong was said where it was read
            return str(BODY.read(ring, "body")) if ring.has("body") else ""
        if not ring.has("body"):
            if len(moving) == 1:
                return moving[0]
            ring.fault(
                "body",
                f"both bodies of the joint {show(joint.name)} move: which one carries the inner ring is not said",
                given="nothing",
                allowed=listing(joint.bodies),
                remedy=f'add the table inner_ring with body = "{moving[0]}"',
            )
            return moving[0]
        body = BODY.read(ring, "body")
        if body and body not in joint.bodies:
            ring.fault(
                "body",
                f"the joint {show(joint.name)} does not join this body",
                given=show(body),
                allowed=listing(joint.bodies),
                remedy=suggest(body, joint.bodies, "name one of the two"),
            )
            return moving[0]
        return str(body)
