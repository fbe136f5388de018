"""The order in which a linkage is assembled: the driven body first, then Assur dyads until every body is placed.

In: a `Mechanism`, whose driver is a revolute joint on the frame.  Out: dyads and wheels, or a `LinkageError` that names
joints, bodies and the count of unknowns and equations.  Which dyads there are is `dyads.DYADS`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

from ballpass.derive.mechanism.dyads import DYADS, Dyad, Group
from ballpass.derive.mechanism.gear import carriers, next_gear
from ballpass.derive.scene.errors import Fault, LinkageError
from ballpass.derive.scene.mechanism_records import Joint, Mechanism
from ballpass.derive.scene.table import FRAME

#: Most bodies of an Assur group that is named.
LARGEST_GROUP = 8


def assemble(mechanism: Mechanism) -> list[Group]:
    """The dyads and wheels in the order in which they are placed.

    Raises
    ------
    LinkageError
        wrong mobility; bodies that no sequence of dyads reaches, or that the driver does not move; a branch that is
        missing, of the wrong kind, or set where it means nothing.
    """
    _check_mobility(mechanism)
    driven = mechanism.joint(mechanism.driver.joint).other(FRAME)
    placed, dyads = [FRAME, driven], list[Group]()
    while (dyad := next_gear(mechanism, placed) or _next_dyad(mechanism, placed)) is not None:
        dyads.append(dyad)
        placed.extend(dyad.bodies)
    left_over = [b.name for b in mechanism.bodies if b.name not in placed]
    if left_over:
        raise _order_fault(mechanism, placed, left_over).of_linkage()
    pairs = [dyad for dyad in dyads if isinstance(dyad, Dyad)]
    faults = [*_idle_faults(driven, dyads), *_branch_faults(mechanism, pairs)]
    if faults:
        raise LinkageError(faults)
    return dyads


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) if names else "none"


def _check_mobility(mechanism: Mechanism) -> None:
    bodies, joints, gears = len(mechanism.bodies), len(mechanism.joints), len(mechanism.gears)
    unknowns, equations = 3 * bodies, 2 * joints + gears
    if unknowns - equations == 1:
        return
    change = "remove a joint or add a body" if unknowns - equations < 1 else "add a joint or remove a body"
    raise Fault(
        key="mechanism.joints",
        problem=(
            f"the linkage has mobility {unknowns - equations}: {unknowns} unknowns "
            f"(3 for each of {bodies} moving bodies) and {equations} equations (2 for each of {joints} joints"
            + (f", 1 for each of {gears} gears)" if gears else ")")
        ),
        given=(
            f"bodies {_listed([b.name for b in mechanism.bodies])}; "
            f"joints {_listed([j.name for j in mechanism.joints])}"
        ),
        allowed="mobility 1: one unknown more than equations, which the driver prescribes",
        remedy=f"{change}: each joint takes two degrees of freedom, each body brings three",
    ).of_linkage()


def _joints_to(mechanism: Mechanism, body: str, others: Sequence[str]) -> list[Joint]:
    return [j for j in mechanism.joints if body in j.bodies and j.other(body) in others]


def _next_dyad(mechanism: Mechanism, placed: Sequence[str]) -> Dyad | None:
    """The first dyad, in the order of the scene's joints, whose outer joints lie on bodies already placed."""
    for inner in mechanism.joints:
        first, second = inner.bodies
        if first in placed or second in placed or len(_joints_to(mechanism, first, [second])) != 1:
            continue
        outer = [_joints_to(mechanism, body, placed) for body in inner.bodies]
        if any(len(joints) != 1 for joints in outer):
            continue
        for kind in DYADS:
            dyad = kind.find(inner, (outer[0][0], outer[1][0]))
            if dyad is not None:
                return dyad
    return None


def _order_fault(mechanism: Mechanism, placed: Sequence[str], left_over: Sequence[str]) -> Fault:
    joints = [j for j in mechanism.joints if any(body in left_over for body in j.bodies)]
    held = [
        f"{body} is held by {len(held_by)} joints ({_listed([j.name for j in held_by])}) on bodies already placed"
        for body in left_over
        if len(held_by := _joints_to(mechanism, body, placed)) > 1
    ]
    gears = [gear for gear in mechanism.gears if {*gear.bodies} & {*left_over}]
    held += [f"gear {gear.name} has no body that carries both axes" for gear in gears if not carriers(mechanism, gear)]
    loose = [body for body in left_over if not _joints_to(mechanism, body, placed)]
    if len(loose) == len(left_over):
        held.append("none of them has a joint to a body already placed")
    reason = f" ({'; '.join(held)})" if held else ""
    group, remedy = _group(mechanism, placed, left_over), "check the bodies named by each of these joints"
    if group:
        inner = [joint for joint in joints if joint.bodies[0] in group and joint.bodies[1] in group]
        higher = "III" if len(inner) < len(group) else "IV or higher, with a closed loop of its bodies"
        reason = f"; {_listed(group)} are placed together alone, an Assur group of class {higher}{reason}"
        remedy += ", or drive the linkage at another joint: seen from there it may consist of dyads"
    return Fault(
        key="mechanism.joints",
        problem=(
            f"no dyad places the bodies {_listed(left_over)}: {3 * len(left_over)} unknowns (3 for each body) and "
            f"{2 * len(joints) + len(gears)} equations (2 for each of the joints {_listed([j.name for j in joints])}"
            + (f", 1 for each of the gears {_listed([gear.name for gear in gears])}" if gears else "")
            + f"){reason}"
        ),
        given=f"placed so far: {_listed(placed)}",
        allowed=(
            "dyads of two bodies with a joint between them, each with exactly one joint to a body already placed: "
            + "; ".join(f"{kind.words} ({kind.kind})" for kind in DYADS)
            + "; wheels, each hinged to the body that carries both axes, in mesh with one already placed"
        ),
        remedy=remedy,
    )


def _group(mechanism: Mechanism, placed: Sequence[str], left_over: Sequence[str]) -> tuple[str, ...]:
    """The fewest bodies, four or more, whose joints with each other and with placed ones fix them; none of many."""
    for size in range(4, min(len(left_over), LARGEST_GROUP) + 1, 2):
        for group in combinations(left_over, size):
            known = {*placed, *group}
            touching = [j for j in mechanism.joints if {*j.bodies} & {*group}]
            if 2 * len(touching) == 3 * size and all({*j.bodies} <= known for j in touching):
                return group
    return ()


def _idle_faults(driven: str, dyads: Sequence[Group]) -> list[Fault]:
    """Dyads that hang on the frame alone: a truss, which the driver does not reach."""
    faults, moving = [], [driven]
    for dyad in dyads:
        if any(host in moving for host in dyad.hosts):
            moving.extend(dyad.bodies)
            continue
        joints = _listed(dyad.joints)
        faults.append(
            Fault(
                key="mechanism.joints",
                problem=f"the driver does not move {' and '.join(dyad.bodies)}: {3 * len(dyad.bodies)} unknowns and "
                f"{3 * len(dyad.bodies)} equations of the joints {joints} fix them to the frame",
                given=f"they hang on {' and '.join(dyad.hosts)}",
                allowed="bodies that a chain of joints links to the driven body",
                remedy=f"hang one of them on {driven} or on a body that it moves",
            )
        )
    return faults


def _branch_faults(mechanism: Mechanism, dyads: Sequence[Dyad]) -> list[Fault]:
    faults = []
    for joint in mechanism.joints:
        dyad = next((d for d in dyads if d.inner is joint), None)
        key = f"mechanism.joints.{joint.name}.branch"
        if dyad is None:
            if joint.branch is not None:
                faults.append(
                    Fault(
                        key=key,
                        problem=f"a branch means nothing at joint {joint.name}, which closes no dyad",
                        given=joint.branch,
                        allowed=f"a branch at the inner joint of a dyad only: {_listed([d.inner.name for d in dyads])}",
                        remedy="remove the key",
                    )
                )
            continue
        alone, missing = len(dyad.branches) == 1, joint.branch is None
        if joint.branch in dyad.branches or (alone and missing):
            continue
        faults.append(
            Fault(
                key=key,
                problem=(
                    f"joint {joint.name} closes the {dyad.kind} dyad of {dyad.bodies[0]} and {dyad.bodies[1]} and "
                    + ("has no branch" if missing else "has a branch of another dyad")
                ),
                given="nothing" if missing else str(joint.branch),
                allowed=" or ".join((*dyad.branches, *(("no branch",) if alone else ()))),
                remedy=f"say {dyad.branch_meaning()}",
            )
        )
    return faults
