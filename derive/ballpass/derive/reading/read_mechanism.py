"""The table [mechanism] of a scene file to a `Mechanism`.

In: the table.  Out: the record, possibly with placeholders where faults were noted (see `schema.py`).  Whether the
linkage can be assembled is no question of reading: `derive` answers it.
"""

from __future__ import annotations

import math
from typing import Literal

from ballpass.derive.drive import LAWS
from ballpass.derive.drive.laws import TorqueLaw
from ballpass.derive.mechanism.dyads import BRANCHES
from ballpass.derive.mechanism.forces import FORCE_TABLES
from ballpass.derive.scene.body_keys import Points, read_pair, refuse_unknown_body, refuse_unknown_point
from ballpass.derive.scene.quantity import Quantity
from ballpass.derive.scene.records import FRAME, Body, Driver, Force, Joint, Mechanism, NamedPoint, SpeedOverTime
from ballpass.derive.scene.schema import Table, VectorWords, listing, suggest, upright
from ballpass.derive.scene.units import show

_JOINT_TYPES: tuple[Literal["revolute", "prismatic"], ...] = ("revolute", "prismatic")


def words_of_gravity() -> VectorWords:
    """Words of the acceleration of gravity; a single number points down."""
    return VectorWords(
        what="the acceleration of gravity",
        axis="Acceleration of gravity, along -y",
        latex=("g", "g_x", "g_y", "g", r"\alpha_g"),
        polar=("magnitude", "direction"),
    )


def read_mechanism(table: Table) -> tuple[Mechanism, str | None]:
    """The mechanism, and the name of the driven body where there is one.

    Faults are noted for: unknown joints, bodies and points; a joint of a body with itself; a driver that is not a
    revolute joint from the frame to a body; names; and what `Table` notes.
    """
    with table:
        gravity = table.vector("gravity", "m/s^2", words_of_gravity()) if table.has("gravity") else None
        driver = _read_driver(table)
        with table.table("frame", "its points") as frame:
            frame_points = _read_points(frame, FRAME)
        bodies = _read_bodies(table)
        points: dict[str, list[str]] = {FRAME: [point.name for point in frame_points]}
        points |= {body.name: [point.name for point in body.points] for body in bodies}
        joints, sound = _read_joints(table, points)
        driven = _check_driver(table, driver, joints, sound)
        forces = _read_forces(table, points)
    mechanism = Mechanism(
        gravity=gravity,
        driver=driver,
        frame_points=frame_points,
        bodies=bodies,
        joints=joints,
        forces=forces,
    )
    return mechanism, driven


def _read_driver(table: Table) -> Driver:
    with table.table("driver", "joint and speed") as driver:
        by_torque = driver.has("torque")
        words = "Speed of the driver at the start" if by_torque else "Speed of the driver"
        joint = driver.text("joint", "A") or ""
        speed, over_time = _read_table(driver) if driver.has("table") else (None, None)
        return Driver(
            joint=joint,
            speed=speed
            or driver.quantity("speed", "rad/s", words, r"\omega_0" if by_torque else r"\omega", example="500 rpm"),
            start_angle=driver.quantity(
                "start_angle",
                "rad",
                "Angle of the driver at the start",
                r"\theta_{1,0}",
                example="0 deg",
                default="0 deg",
            ),
            table=over_time,
            torque=_read_torque(driver) if by_torque else None,
            flywheel=_read_flywheel(driver, by_torque or over_time is not None) if driver.has("flywheel") else None,
        )


def _read_table(driver: Table) -> tuple[Quantity | None, SpeedOverTime | None]:
    """The speed at t = 0, and the table it begins; faults where another key gives the speed."""
    for key in ("speed", "torque"):
        if driver.has(key):
            driver.fault(
                key,
                "the table gives the driver's speed",
                given=f"{key} and table",
                allowed="one of speed, table, and speed with torque",
                remedy=f"delete {key}, or the table",
            )
    with driver.table("table", "time and speed") as data:
        time = data.column("time", "s", "Time in row ROW of the driver's table", "t_{1,ROW}")
        speed = data.column("speed", "rad/s", "Speed in row ROW of the driver's table", r"\omega_{1,ROW}")
    if not speed:  # reported
        return Quantity(path="", value=math.nan, unit="rad/s", description="", latex=""), None
    return speed[0], SpeedOverTime(time=time, later_speed=speed[1:])


def _read_torque(driver: Table) -> TorqueLaw | None:
    with driver.table("torque", f"law: {listing(list(LAWS))}") as data:
        name = data.choice("law", tuple(LAWS))
        if name is None:
            data.know(*data.data)
            return None
        return LAWS[name].read(data)


def _read_flywheel(driver: Table, changing: bool) -> Quantity:
    if not changing:
        driver.fault(
            "flywheel",
            "at constant speed a flywheel is without effect",
            given="[mechanism.driver.flywheel] without [mechanism.driver.torque] or [mechanism.driver.table]",
            allowed="a flywheel where the speed changes",
            remedy="delete the flywheel, or add [mechanism.driver.torque]",
        )
    with driver.table("flywheel", "inertia") as wheel:
        words = "Moment of inertia that turns with the driven body"
        return wheel.quantity("inertia", "kg*m^2", words, "J_f", example="0.5 kg*m^2")


def _read_points(table: Table, body: str) -> tuple[NamedPoint, ...]:
    owner = "frame" if body == FRAME else body.replace("_", " ")
    points = []
    with table.table("points", 'A = "origin"') as listed:
        for name in listed.names("point"):
            index = f"{upright(body)},{name if len(name) == 1 else upright(name)}"
            words = VectorWords(
                what=f"point {name} of the {owner}",
                axis=f"Distance of point {name} of the {owner} from the origin of its x axis",
                latex=(f"l_{{{index}}}", f"x_{{{index}}}", f"y_{{{index}}}", f"l_{{{index}}}", rf"\phi_{{{index}}}"),
                origin=True,
            )
            points.append(NamedPoint(name=name, position=listed.vector(name, "m", words)))
        if not listed.missing and not points:
            listed.fault("", "there are no points here", allowed='A = "origin"', remedy="name the points of the joints")
    return tuple(points)


def _read_bodies(table: Table) -> tuple[Body, ...]:
    with table.table("bodies", "one table for each moving body") as listed:
        bodies = [_read_body(listed, name) for name in listed.names("body")]
        if not listed.missing and not bodies:
            listed.fault(
                "", "there are no bodies here", allowed="[mechanism.bodies.crank]", remedy="add the moving bodies"
            )
    return tuple(bodies)


def _read_body(listed: Table, name: str) -> Body:
    owner, index = name.replace("_", " "), upright(name)
    words = VectorWords(
        what=f"the centre of mass of the {owner}",
        axis=f"Distance of the centre of mass of the {owner} from its origin, along its x axis",
        latex=(
            f"l_{{o,{index}}}",
            f"x_{{o,{index}}}",
            f"y_{{o,{index}}}",
            f"l_{{o,{index}}}",
            rf"\theta_{{p,{index}}}",
        ),
        origin=True,
    )
    with listed.table(name, "mass, center_of_mass and points") as body:
        return Body(
            name=name,
            mass=body.quantity("mass", "kg", f"Mass of the {owner}", f"m_{{{index}}}", example="0.36 kg"),
            inertia=body.optional_quantity(
                "inertia", "kg*m^2", f"Moment of inertia of the {owner} about its centre of mass", f"J_{{{index}}}"
            ),
            center_of_mass=body.vector("center_of_mass", "m", words),
            points=_read_points(body, name),
        )


def _read_joints(table: Table, points: Points) -> tuple[tuple[Joint, ...], list[str]]:
    """All joints, and the names of those whose type and bodies are without fault."""
    joints, sound = [], []
    with table.table("joints", "one table for each joint") as listed:
        for name in listed.names("joint"):
            with listed.table(name, "type and bodies") as data:
                joint, good = _read_joint(data, name, points)
            joints.append(joint)
            if good:
                sound.append(name)
        if not listed.missing and not joints:
            listed.fault("", "there are no joints here", allowed="[mechanism.joints.A]", remedy="add the joints")
    return tuple(joints), sound


def _read_joint(data: Table, name: str, points: Points) -> tuple[Joint, bool]:
    kind = data.choice("type", _JOINT_TYPES)
    bodies = read_pair(data, "bodies", '["frame", "crank"]')
    good = kind is not None and bodies is not None
    if bodies is not None:
        for body in bodies:
            good = refuse_unknown_body(data, "bodies", body, points) and good
        if bodies[0] == bodies[1]:
            good = False
            data.fault(
                "bodies",
                "a joint of a body with itself",
                given=listing(bodies),
                allowed="two different bodies",
                remedy="name the other body",
            )
    ends = read_pair(data, "points", f'["{name}", "{name}"]') if data.has("points") else (name, name)
    if bodies is not None and ends is not None:
        for body, point in zip(bodies, ends, strict=True):
            refuse_unknown_point(data, "points", body, point, points)
    direction = None
    if kind == "prismatic":
        direction = data.quantity(
            "direction",
            "rad",
            f"Direction of the guide of joint {name}",
            rf"\psi_{{{upright(name)}}}",
            example="270 deg",
        )
    elif data.has("direction") and kind is not None:
        data.fault(
            "direction",
            "a revolute joint has no direction",
            given=show(data.data["direction"]),
            remedy='delete the key, or write type = "prismatic"',
        )
    branch = data.choice("branch", BRANCHES) if data.has("branch") else None
    return Joint(
        name=name,
        kind=kind or "revolute",
        bodies=bodies or ("", ""),
        points=ends or ("", ""),
        direction=direction,
        branch=branch,
    ), good


def _check_driver(table: Table, driver: Driver, joints: tuple[Joint, ...], sound: list[str]) -> str | None:
    """Name of the driven body; None, with a fault, where the driver turns none."""
    if not driver.joint:
        return None
    names = [joint.name for joint in joints]
    joint = next((joint for joint in joints if joint.name == driver.joint), None)
    with Table(table.collector, (*table.path, "driver"), {}) as place:
        if joint is None:
            place.fault(
                "joint",
                f"there is no joint {show(driver.joint)}",
                given=show(driver.joint),
                allowed=listing(names),
                remedy=suggest(driver.joint, names, "name one of the joints"),
            )
            return None
        if joint.name not in sound:
            return None
        if joint.kind != "revolute":
            place.fault(
                "joint",
                f"the driver turns a revolute joint; {show(joint.name)} is {joint.kind}",
                given=show(driver.joint),
                allowed="a revolute joint between the frame and a body",
                remedy="name the joint that the motor turns",
            )
            return None
        if joint.bodies[0] != FRAME:
            swapped = joint.bodies[1] == FRAME
            place.fault(
                "joint",
                f"the driver's joint goes from the frame to a body; {show(joint.name)} joins {listing(joint.bodies)}",
                given=show(driver.joint),
                allowed=f'a revolute joint with bodies = ["{FRAME}", <driven body>]',
                remedy=f'write bodies = ["{FRAME}", "{joint.bodies[0]}"] at the joint {show(joint.name)}'
                if swapped
                else "name a joint of the frame",
            )
            return None
    return joint.bodies[1]


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
