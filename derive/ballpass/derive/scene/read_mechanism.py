"""The table [mechanism] of a scene file to a `Mechanism`.

In: the table.  Out: the record, possibly with placeholders where faults were noted (see `schema.py`).  Whether the
linkage can be assembled is no question of reading: `derive` answers it.
"""

from __future__ import annotations

from typing import Any, Literal

from ballpass.derive.scene.records import (
    FRAME,
    AppliedForce,
    AppliedTorque,
    Body,
    Driver,
    Joint,
    Mechanism,
    NamedPoint,
    Window,
)
from ballpass.derive.scene.schema import Table, VectorWords, listing, suggest
from ballpass.derive.scene.units import show

_JOINT_TYPES: tuple[Literal["revolute", "prismatic"], ...] = ("revolute", "prismatic")
_BRANCHES: tuple[Literal["left", "right", "ahead", "behind"], ...] = ("left", "right", "ahead", "behind")


def words_of_gravity() -> VectorWords:
    """Words of the acceleration of gravity; a single number points down."""
    return VectorWords(
        what="the acceleration of gravity",
        axis="Acceleration of gravity, along -y",
        latex=("g", "g_x", "g_y", "g", r"\alpha_g"),
        polar=("magnitude", "direction"),
    )


def words_of_force(what: str, symbol: str, index: str = "") -> VectorWords:
    """Words of a force: no single number, because nothing says along which axis it would act."""
    comma = "," if index else ""
    return VectorWords(
        what=what,
        latex=(
            "",
            f"{symbol}_{{{index}{comma}x}}",
            f"{symbol}_{{{index}{comma}y}}",
            f"{symbol}_{{{index}}}" if index else symbol,
            rf"\alpha_{{{index or symbol}}}",
        ),
        polar=("magnitude", "direction"),
    )


def upright(name: str) -> str:
    """A name of the scene as LaTeX text."""
    escaped = name.replace("_", r"\_")
    return rf"\mathrm{{{escaped}}}"


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
        points = {FRAME: [point.name for point in frame_points]}
        points |= {body.name: [point.name for point in body.points] for body in bodies}
        joints, sound = _read_joints(table, points)
        driven = _check_driver(table, driver, joints, sound)
        forces = _read_forces(table, points)
        torques = _read_torques(table, points)
    mechanism = Mechanism(
        gravity=gravity,
        driver=driver,
        frame_points=frame_points,
        bodies=bodies,
        joints=joints,
        forces=forces,
        torques=torques,
    )
    return mechanism, driven


def _read_driver(table: Table) -> Driver:
    with table.table("driver", "joint and speed") as driver:
        return Driver(
            joint=driver.text("joint", "A") or "",
            speed=driver.quantity("speed", "rad/s", "Speed of the driver", r"\omega", example="500 rpm"),
            start_angle=driver.quantity(
                "start_angle",
                "rad",
                "Angle of the driver at the start",
                r"\theta_{1,0}",
                example="0 deg",
                default="0 deg",
            ),
        )


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


def _read_joints(table: Table, points: dict[str, list[str]]) -> tuple[tuple[Joint, ...], list[str]]:
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


def _read_joint(data: Table, name: str, points: dict[str, list[str]]) -> tuple[Joint, bool]:
    kind = data.choice("type", _JOINT_TYPES)
    bodies = _pair(data, "bodies", '["frame", "crank"]')
    good = kind is not None and bodies is not None
    if bodies is not None:
        for body in bodies:
            good = _known_body(data, "bodies", body, points) and good
        if bodies[0] == bodies[1]:
            good = False
            data.fault(
                "bodies",
                "a joint of a body with itself",
                given=listing(bodies),
                allowed="two different bodies",
                remedy="name the other body",
            )
    ends = _pair(data, "points", f'["{name}", "{name}"]') if data.has("points") else (name, name)
    if bodies is not None and ends is not None:
        for body, point in zip(bodies, ends, strict=True):
            _known_point(data, "points", body, point, points)
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
    branch = data.choice("branch", _BRANCHES) if data.has("branch") else None
    if branch is not None and kind == "prismatic":
        data.fault(
            "branch",
            "a prismatic joint has no branch",
            given=show(branch),
            allowed="a branch at the inner revolute joint of each dyad",
            remedy="delete the key here; write it at the revolute joint between the two bodies of the dyad",
        )
    return Joint(
        name=name,
        kind=kind or "revolute",
        bodies=bodies or ("", ""),
        points=ends or ("", ""),
        direction=direction,
        branch=branch,
    ), good


def _pair(data: Table, key: str, example: str) -> tuple[str, str] | None:
    given = data.take(key, example)
    if given is None:
        return None
    if isinstance(given, list) and len(given) == 2 and all(isinstance(item, str) for item in given):
        return given[0], given[1]
    data.fault(
        key, "this is not a list of two names", given=show(given), allowed=example, remedy=f"write {key} = {example}"
    )
    return None


def _known_body(data: Table, key: str, body: str, points: dict[str, list[str]]) -> bool:
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


def _known_point(data: Table, key: str, body: str, point: str, points: dict[str, list[str]]) -> None:
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


def _read_forces(table: Table, points: dict[str, list[str]]) -> tuple[AppliedForce, ...]:
    forces = []
    with table.table("forces", required=False) as listed:
        for name in listed.names("force"):
            with listed.table(name, "body, point and force") as data:
                body = _read_target(data, points)
                point = data.text("point", "C") or ""
                if body and point:
                    _known_point(data, "point", body, point, points)
                words = words_of_force(f"the force {name} on the {body.replace('_', ' ')}", "F", upright(name))
                forces.append(
                    AppliedForce(
                        name=name,
                        body=body,
                        point=point,
                        force=data.vector("force", "N", words),
                        windows=_read_windows(data, name),
                    )
                )
    return tuple(forces)


def _read_torques(table: Table, points: dict[str, list[str]]) -> tuple[AppliedTorque, ...]:
    torques = []
    with table.table("torques", required=False) as listed:
        for name in listed.names("torque"):
            with listed.table(name, "body and torque") as data:
                body = _read_target(data, points)
                torque = data.quantity(
                    "torque",
                    "N*m",
                    f"Torque {name} on the {body.replace('_', ' ')}, counter-clockwise",
                    f"M_{{{upright(name)}}}",
                    example="20 N*m",
                )
                torques.append(AppliedTorque(name=name, body=body, torque=torque, windows=_read_windows(data, name)))
    return tuple(torques)


def _read_target(data: Table, points: dict[str, list[str]]) -> str:
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
    return body if _known_body(data, "body", body, points) else ""


def _read_windows(data: Table, name: str) -> tuple[Window, ...]:
    if not data.has("window"):
        return ()
    given: Any = data.data["window"]
    if not isinstance(given, list):
        return (_read_window(data.table("window", "start and end"), name, ""),)
    if not given:
        data.fault(
            "window",
            "there is no window in this list",
            given="[]",
            allowed='{ start = "237 deg", end = "267 deg" }, or a list of such tables',
            remedy="add a window, or delete the key for a load that always acts",
        )
    numbered = Table(
        data.collector, (*data.path, "window"), {str(number): item for number, item in enumerate(given, start=1)}
    )
    return tuple(_read_window(numbered.table(number, "start and end"), name, f",{number}") for number in numbered.data)


def _read_window(table: Table, name: str, number: str) -> Window:
    place = f"the window {number[1:]} of {name}".replace("  ", " ") if number else f"the window of {name}"
    index = f"{upright(name)}{number}"
    with table as window:
        return Window(
            start=window.quantity(
                "start",
                "rad",
                f"Driver angle at the start of {place}",
                rf"\theta_{{\mathrm{{start}},{index}}}",
                example="237 deg",
            ),
            end=window.quantity(
                "end",
                "rad",
                f"Driver angle at the end of {place}",
                rf"\theta_{{\mathrm{{end}},{index}}}",
                example="267 deg",
            ),
        )
