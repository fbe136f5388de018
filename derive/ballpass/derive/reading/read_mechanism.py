"""The table [mechanism] of a scene file to a `Mechanism`.

In: the table.  Out: the record, possibly with placeholders where faults were noted (see `table.py`).  Whether the
linkage can be assembled is checked later, by `derive`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from ballpass.derive.drive import LAWS
from ballpass.derive.drive.laws import TorqueLaw
from ballpass.derive.mechanism.dyads import BRANCHES
from ballpass.derive.mechanism.forces import FORCE_TABLES
from ballpass.derive.scene.body_keys import Points, check_two_bodies, refuse_unknown_points
from ballpass.derive.scene.keys import ChoiceKey, VectorKey
from ballpass.derive.scene.mechanism_records import (
    CENTER_OF_MASS,
    POINT,
    POSITION,
    Body,
    Driver,
    DriverRange,
    Force,
    Gear,
    Joint,
    Mechanism,
    NamedPoint,
    OscillatingDriver,
    SpeedOverTime,
)
from ballpass.derive.scene.quantity import NOT_NEGATIVE, SceneNumber
from ballpass.derive.scene.read_keys import keys_of, number, read_inner, read_record
from ballpass.derive.scene.table import FRAME, Table, listing, suggest, upright
from ballpass.derive.scene.units import show

GRAVITY = VectorKey(
    unit="m/s^2",
    words="the acceleration of gravity",
    axis="Acceleration of gravity, along -y",
    symbols=("g", "g_x", "g_y", "g", r"\alpha_g"),
    polar=("magnitude", "direction"),
    optional=True,
)
BRANCH = ChoiceKey(
    words="On which of the two sides the dyad is assembled",
    choices=BRANCHES,
    optional=True,
    when="required at the inner joint of each dyad with two positions, else refused",
    note="left and right for RRR, ahead and behind for RRP and RPR; RPP and PRP have one position, and no branch or "
    "`ahead`; see {doc}`../../theory/linkage`",
)
FLYWHEEL = number(
    "kg*m^2",
    "Moment of inertia that turns with the driven body",
    "J_f",
    "0.5 kg*m^2",
    when="optional; only with `[mechanism.driver.torque]`, `driver.table` or `driver.swing`",
    bounds=NOT_NEGATIVE,
)
#: Values of the placeholders in the words of the driver's speed, with a torque and without.
START, CONSTANT = {"START": " at the start", "ZERO": "_0"}, {"START": "", "ZERO": ""}
LAW = ChoiceKey(words="Law of the torque", choices=LAWS)


def read_mechanism(table: Table) -> tuple[Mechanism, str | None]:
    """The mechanism, and the name of the driven body where there is one.

    Faults are noted for: unknown joints, bodies and points; a joint of a body with itself; a driver that is not a
    revolute joint from the frame to a body; names; and what `Table` notes.
    """
    with table:
        table.know("gravity", "driver", "frame", "bodies", "joints", "gears", *(kind.key for kind in FORCE_TABLES))
        gravity = GRAVITY.read(table, "gravity")
        driver = _read_driver(table)
        with table.table("frame", "its points") as frame:
            frame.know("points")
            frame_points = _read_points(frame, FRAME)
        bodies = _read_bodies(table)
        points: dict[str, list[str]] = {FRAME: [point.name for point in frame_points]}
        points |= {body.name: [point.name for point in body.points] for body in bodies}
        joints, sound = _read_joints(table, points)
        driven = _check_driver(table, driver, joints, sound)
        gears = _read_gears(table, points, joints)
        forces = _read_forces(table, points)
    mechanism = Mechanism(
        gravity=gravity,
        driver=driver,
        frame_points=frame_points,
        bodies=bodies,
        joints=joints,
        forces=forces,
        gears=gears,
    )
    return mechanism, driven


def _read_driver(table: Table) -> Driver:
    with table.table("driver", "joint and speed") as driver:
        driver.know(*keys_of(Driver), "range", "swing", "table", "torque", "flywheel")
        by_torque = driver.has("torque")
        joint, start = (keys_of(Driver)[name].read(driver, name) for name in ("joint", "start_angle"))
        speed, over_time = _read_table(driver) if driver.has("table") else (None, None)
        swing = _read_swing(driver) if driver.has("swing") else None
        speed = speed if swing is None else swing.frequency
        if speed is None:
            speed = keys_of(Driver, START if by_torque else CONSTANT)["speed"].read(driver, "speed")
        return Driver(
            joint=joint,
            speed=speed,
            start_angle=start,
            range=read_inner(DriverRange, driver, "range", "start and end") if driver.has("range") else None,
            swing=None if swing is None else swing.amplitude,
            table=over_time,
            torque=_read_torque(driver) if by_torque else None,
            flywheel=_read_flywheel(driver) if driver.has("flywheel") else None,
        )


def _read_swing(driver: Table) -> OscillatingDriver:
    """Its amplitude and frequency; faults where another key gives the motion."""
    driver.refuse(
        ("speed", "table", "torque", "range"),
        "the swing gives the driver's motion",
        allowed="one of speed, table, swing, and speed with torque",
        remedy="delete the key, or the swing",
    )
    return read_inner(OscillatingDriver, driver, "swing", "amplitude and frequency")


def _read_table(driver: Table) -> tuple[SceneNumber | None, SpeedOverTime | None]:
    """The speed at t = 0, and the table that starts with it; faults where another key gives the speed."""
    driver.refuse(
        ("speed", "torque"),
        "the table gives the driver's speed",
        allowed="one of speed, table, and speed with torque",
        remedy="delete the key, or the table",
    )
    found = read_inner(SpeedOverTime, driver, "table", "time and speed")
    if not found.later_speed:  # reported
        return SceneNumber(path="", value=math.nan, unit="rad/s", description="", latex=""), None
    return found.later_speed[0], replace(found, later_speed=found.later_speed[1:])


def _read_torque(driver: Table) -> TorqueLaw | None:
    with driver.table("torque", f"law: {listing(list(LAWS))}") as data:
        data.know("law")
        name = LAW.read(data, "law")
        if name is None or name != data.data["law"]:
            data.know(*data.data)
            return None
        return read_record(LAWS[name], data)


def _read_flywheel(driver: Table) -> SceneNumber:
    if not any(map(driver.has, ("torque", "table", "swing"))):
        driver.fault(
            "flywheel",
            "at constant speed a flywheel is without effect",
            given="[mechanism.driver.flywheel] without [mechanism.driver.torque], [mechanism.driver.table] or a swing",
            allowed="a flywheel where the speed changes",
            remedy="delete the flywheel, or add [mechanism.driver.torque]",
        )
    with driver.table("flywheel", "inertia") as wheel:
        wheel.know("inertia")
        return FLYWHEEL.read(wheel, "inertia")  # type: ignore[no-any-return]


def _read_points(table: Table, body: str) -> tuple[NamedPoint, ...]:
    owner = "frame" if body == FRAME else body.replace("_", " ")
    points = []
    with table.table("points", 'A = "origin"') as listed:
        for name in listed.names("point", 'A = "origin"'):
            index = f"{upright(body)},{name if len(name) == 1 else upright(name)}"
            key = POINT.filled({"POINT": name, "OWNER": owner, "INDEX": index})
            points.append(NamedPoint(name=name, position=key.read(listed, name)))
    return tuple(points)


def _read_bodies(table: Table) -> tuple[Body, ...]:
    with table.table("bodies", "one table for each moving body") as listed:
        bodies = [_read_body(listed, name) for name in listed.names("body", "[mechanism.bodies.crank]")]
    return tuple(bodies)


def _read_body(listed: Table, name: str) -> Body:
    with listed.table(name, "mass, center_of_mass and points") as body:
        body.know(*keys_of(Body), "points", "positions")
        fill = {"NAME": name.replace("_", " "), "INDEX": upright(name)}
        points = _read_points(body, name)
        positions = _read_positions(body, [CENTER_OF_MASS, *(point.name for point in points)])
        return read_record(Body, body, fill, name=name, points=points, positions=positions)


def _read_positions(body: Table, points: Sequence[str]) -> tuple[tuple[str, SceneNumber], ...]:
    """Places of points along the shaft."""
    if not body.has("positions"):
        return ()
    with body.table("positions", 'B = "-40 mm"') as listed:
        listed.know(*points)
        keys = {name: POSITION.filled({"POINT": name.replace("_", " "), "INDEX": upright(name)}) for name in points}
        return tuple((name, key.read(listed, name)) for name, key in keys.items() if listed.has(name))


def _read_joints(table: Table, points: Points) -> tuple[tuple[Joint, ...], list[str]]:
    """All joints, and the names of those whose type and bodies are without fault."""
    joints, sound = [], []
    with table.table("joints", "one table for each joint") as listed:
        for name in listed.names("joint", "[mechanism.joints.A]"):
            with listed.table(name, "type and bodies") as data:
                joint, good = _read_joint(data, name, points)
            joints.append(joint)
            if good:
                sound.append(name)
    return tuple(joints), sound


def _read_joint(data: Table, name: str, points: Points) -> tuple[Joint, bool]:
    data.know(*keys_of(Joint), "branch")
    fill, branch = {"NAME": name, "INDEX": upright(name)}, BRANCH.read(data, "branch")
    joint = read_record(Joint, data, fill, name=name, branch=branch)
    good = check_two_bodies(data, joint.bodies, points, "a joint of a body with itself") and joint.kind is not None
    refuse_unknown_points(data, joint, points)
    return joint, good


def _read_gears(table: Table, points: Points, joints: Sequence[Joint]) -> tuple[Gear, ...]:
    gears = []
    with table.table("gears", required=False) as listed:
        for name in listed.names("gear"):
            if any(joint.name == name for joint in joints):
                listed.fault(name, "a joint has this name", given=show(name), remedy="rename one of the two")
            with listed.table(name, "bodies and teeth") as data:
                gear = read_record(Gear, data, {"NAME": name, "INDEX": upright(name)}, name=name)
                check_two_bodies(data, gear.bodies, points, "a gear of a body with itself")
                if gear.kind == "internal" and gear.teeth[0] == gear.teeth[1]:
                    data.fault(
                        "teeth",
                        "wheels of an internal gear have unlike numbers of teeth: the ring has more",
                        given=show(list(gear.teeth)),
                        allowed="two different numbers",
                        remedy="correct one of them",
                    )
            gears.append(gear)
    return tuple(gears)


def _check_driver(table: Table, driver: Driver, joints: tuple[Joint, ...], sound: list[str]) -> str | None:
    """Name of the driven body; None, with a fault, where the driver turns none."""
    if not driver.joint or not joints:  # reported
        return None
    names = [joint.name for joint in joints]
    joint = next((joint for joint in joints if joint.name == driver.joint), None)
    problem, remedy = "", "name a joint of the frame"
    allowed = 'a revolute joint with bodies = ["frame", <driven body>]'
    if joint is None:
        problem, allowed = f"there is no joint {show(driver.joint)}", listing(names)
        remedy = suggest(driver.joint, names, "name one of the joints")
    elif joint.name not in sound:
        return None
    elif joint.kind != "revolute":
        problem = f"the driver turns a revolute joint; {show(joint.name)} is {joint.kind}"
        remedy = "name the joint that the motor turns"
    elif joint.bodies[0] != FRAME:
        problem = f"the driver's joint goes from the frame to a body; {show(joint.name)} joins {listing(joint.bodies)}"
        if joint.bodies[1] == FRAME:
            remedy = f'write bodies = ["{FRAME}", "{joint.bodies[0]}"] at the joint {show(joint.name)}'
    if not problem and joint is not None:
        return joint.bodies[1]
    place = (*table.path, "driver", "joint")
    table.collector.fault(place, problem, given=show(driver.joint), allowed=allowed, remedy=remedy)
    return None


def _read_forces(table: Table, points: Points) -> tuple[Force, ...]:
    forces: list[Force] = []
    for kind in FORCE_TABLES:
        with table.table(kind.key, required=False) as listed:
            for name in listed.names(kind.word):
                if any(force.name == name for force in forces):
                    listed.fault(name, "another load has this name", given=show(name), remedy="rename one of the two")
                with listed.table(name, kind.example) as data:
                    forces.append(kind.read(data, name, points))
    return tuple(forces)
