"""In which order a linkage is put together: the driven body first, then Assur dyads until every body has its place.

In: a `Mechanism`.  Out: an `Assembly`, or a `LinkageError` that names joints, bodies and the count of unknowns and
equations.  Two dyads are known, each with a revolute inner joint:

RRR  two bodies, each hinged to a body already placed or to the frame
RRP  a rod hinged, and a slider guided, on bodies already placed or on the frame
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from ballpass.derive.scene.errors import Fault, LinkageError
from ballpass.derive.scene.records import FRAME, Joint, Mechanism

#: Values of `Joint.branch` at the inner joint, by the kind of the dyad.
BRANCHES: dict[str, tuple[str, str]] = {"RRR": ("left", "right"), "RRP": ("ahead", "behind")}


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """An Assur dyad.

    Attributes
    ----------
    kind : RRR or RRP
    bodies : RRR: in the order of the inner joint's bodies; RRP: rod, slider
    hosts : the placed bodies that carry them
    outer : their joints to the hosts; for RRP the revolute joint of the rod, the prismatic joint of the slider
    inner : the revolute joint between the two bodies
    """

    kind: Literal["RRR", "RRP"]
    bodies: tuple[str, str]
    hosts: tuple[str, str]
    outer: tuple[Joint, Joint]
    inner: Joint

    @property
    def sign(self) -> int:
        """+1 on the branches ``left`` and ``ahead``, −1 on ``right`` and ``behind``."""
        return 1 if self.inner.branch in ("left", "ahead") else -1


@dataclass(frozen=True, slots=True, kw_only=True)
class Assembly:
    """The driver joint, the body it drives, and the dyads in the order in which they are placed."""

    driver: Joint
    driven: str
    groups: tuple[Group, ...]


def assemble(mechanism: Mechanism) -> Assembly:
    """Decide the order of assembly.

    Raises
    ------
    LinkageError
        wrong mobility; a driver that is not a revolute joint on the frame; bodies that no sequence of dyads reaches, or
        that the driver does not move; a branch that is missing, of the wrong kind, or set where it means nothing.
    """
    faults = [*_mobility_faults(mechanism), *_driver_faults(mechanism)]
    if faults:
        raise LinkageError(faults)
    driver = mechanism.joint(mechanism.driver.joint)
    driven = _other(driver, FRAME)
    placed, groups = [FRAME, driven], list[Group]()
    while (group := _next_group(mechanism, placed)) is not None:
        groups.append(group)
        placed.extend(group.bodies)
    left_over = [b.name for b in mechanism.bodies if b.name not in placed]
    if left_over:
        raise LinkageError([_order_fault(mechanism, placed, left_over)])
    faults = [*_idle_faults(driven, groups), *_branch_faults(mechanism, groups)]
    if faults:
        raise LinkageError(faults)
    return Assembly(driver=driver, driven=driven, groups=tuple(groups))


def point_name(joint: Joint, body: str) -> str:
    """Name of the joint's point on one of its bodies."""
    return joint.points[joint.bodies.index(body)]


def _other(joint: Joint, body: str) -> str:
    first, second = joint.bodies
    return second if first == body else first


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) if names else "none"


def _mobility_faults(mechanism: Mechanism) -> list[Fault]:
    bodies, joints = len(mechanism.bodies), len(mechanism.joints)
    unknowns, equations = 3 * bodies, 2 * joints
    if unknowns - equations == 1:
        return []
    if unknowns - equations < 1:
        remedy = "remove a joint or add a body: each joint takes two degrees of freedom, each body brings three"
    else:
        remedy = "add a joint or remove a body: each joint takes two degrees of freedom, each body brings three"
    return [
        Fault(
            key="mechanism.joints",
            problem=(
                f"the linkage has mobility {unknowns - equations}: {unknowns} unknowns "
                f"(3 for each of {bodies} moving bodies) and {equations} equations (2 for each of {joints} joints)"
            ),
            given=(
                f"bodies {_listed([b.name for b in mechanism.bodies])}; "
                f"joints {_listed([j.name for j in mechanism.joints])}"
            ),
            allowed="mobility 1: one unknown more than equations, which the driver prescribes",
            remedy=remedy,
        )
    ]


def _driver_faults(mechanism: Mechanism) -> list[Fault]:
    name = mechanism.driver.joint
    joint = next((j for j in mechanism.joints if j.name == name), None)
    allowed = "a revolute joint between the frame and the body it turns"
    remedy = "name the joint by which the frame turns the crank"
    key = "mechanism.driver.joint"
    if joint is None:
        return [Fault(key=key, problem="the driver names an unknown joint", given=name, allowed=allowed, remedy=remedy)]
    given = f"{name}, {joint.kind}, between {joint.bodies[0]} and {joint.bodies[1]}"
    if joint.kind != "revolute":
        problem = "a prismatic joint cannot be the driver"
        return [Fault(key=key, problem=problem, given=given, allowed=allowed, remedy=remedy)]
    if (joint.bodies[0] == FRAME) == (joint.bodies[1] == FRAME):
        problem = "the driver's joint does not join a moving body to the frame"
        return [Fault(key=key, problem=problem, given=given, allowed=allowed, remedy=remedy)]
    return []


def _joints_to(mechanism: Mechanism, body: str, others: Sequence[str]) -> list[Joint]:
    return [j for j in mechanism.joints if body in j.bodies and _other(j, body) in others]


def _next_group(mechanism: Mechanism, placed: Sequence[str]) -> Group | None:
    """The first dyad, in the order of the scene's joints, whose outer joints lie on bodies already placed."""
    for inner in mechanism.joints:
        if inner.kind != "revolute" or any(body in placed for body in inner.bodies):
            continue
        first, second = inner.bodies
        outer = [_joints_to(mechanism, body, placed) for body in inner.bodies]
        between = _joints_to(mechanism, first, [second])
        if len(between) != 1 or any(len(joints) != 1 for joints in outer):
            continue
        one, two = outer[0][0], outer[1][0]
        if one.kind == "prismatic" and two.kind == "prismatic":
            continue
        kind: Literal["RRR", "RRP"] = "RRR" if one.kind == two.kind else "RRP"
        if one.kind == "prismatic":
            first, second, one, two = second, first, two, one
        hosts = (_other(one, first), _other(two, second))
        return Group(kind=kind, bodies=(first, second), hosts=hosts, outer=(one, two), inner=inner)
    return None


def _order_fault(mechanism: Mechanism, placed: Sequence[str], left_over: Sequence[str]) -> Fault:
    joints = [j for j in mechanism.joints if any(body in left_over for body in j.bodies)]
    held = [
        f"{body} is held by {len(held_by)} joints ({_listed([j.name for j in held_by])}) on bodies already placed"
        for body in left_over
        if len(held_by := _joints_to(mechanism, body, placed)) > 1
    ]
    loose = [body for body in left_over if not _joints_to(mechanism, body, placed)]
    if len(loose) == len(left_over):
        held.append("none of them has a joint to a body already placed")
    reason = f" ({'; '.join(held)})" if held else ""
    return Fault(
        key="mechanism.joints",
        problem=(
            f"no dyad places the bodies {_listed(left_over)}: {3 * len(left_over)} unknowns (3 for each body) and "
            f"{2 * len(joints)} equations (2 for each of the joints {_listed([j.name for j in joints])}){reason}"
        ),
        given=f"placed so far: {_listed(placed)}",
        allowed=(
            "dyads of two bodies with a revolute inner joint, each body with exactly one joint to a body already "
            "placed: both revolute (RRR), or one revolute and one prismatic (RRP)"
        ),
        remedy="check the bodies named by each of these joints",
    )


def _idle_faults(driven: str, groups: Sequence[Group]) -> list[Fault]:
    """Dyads that hang on the frame alone: a truss, which the driver does not reach."""
    faults, moving = [], [driven]
    for group in groups:
        if any(host in moving for host in group.hosts):
            moving.extend(group.bodies)
            continue
        joints = _listed([group.outer[0].name, group.inner.name, group.outer[1].name])
        faults.append(
            Fault(
                key="mechanism.joints",
                problem=f"the driver does not move {group.bodies[0]} and {group.bodies[1]}: 6 unknowns and 6 equations "
                f"of the joints {joints} fix them to the frame",
                given=f"they hang on {group.hosts[0]} and {group.hosts[1]}",
                allowed="bodies that a chain of joints links to the driven body",
                remedy=f"hang one of them on {driven} or on a body that it moves",
            )
        )
    return faults


def _branch_faults(mechanism: Mechanism, groups: Sequence[Group]) -> list[Fault]:
    faults = []
    for joint in mechanism.joints:
        group = next((g for g in groups if g.inner is joint), None)
        key = f"mechanism.joints.{joint.name}.branch"
        if group is None:
            if joint.branch is not None:
                faults.append(
                    Fault(
                        key=key,
                        problem=f"a branch means nothing at joint {joint.name}, which closes no dyad",
                        given=joint.branch,
                        allowed="a branch at the inner revolute joint of a dyad only: "
                        + (_listed([g.inner.name for g in groups])),
                        remedy="remove the key",
                    )
                )
            continue
        if joint.branch in BRANCHES[group.kind]:
            continue
        one, two = BRANCHES[group.kind]
        missing = joint.branch is None
        faults.append(
            Fault(
                key=key,
                problem=(
                    f"joint {joint.name} closes the {group.kind} dyad of {group.bodies[0]} and {group.bodies[1]} and "
                    + ("has no branch" if missing else "has a branch of another dyad")
                ),
                given="nothing" if joint.branch is None else joint.branch,
                allowed=f"{one} or {two}",
                remedy=_branch_remedy(group),
            )
        )
    return faults


def _branch_remedy(group: Group) -> str:
    inner, one, two = group.inner.name, group.outer[0].name, group.outer[1].name
    if group.kind == "RRR":
        return f"say on which side of the line from {one} to {two} joint {inner} lies"
    return (
        f"say whether joint {inner} lies ahead of or behind the foot of the perpendicular from {one} onto its path, "
        f"seen along the direction of guide {two}"
    )
