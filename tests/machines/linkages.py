"""Linkages for tests, built as records: what `read` would give, without files and units."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import sympy as sp

from ballpass.derive.drive import KnownDrive
from ballpass.derive.mechanism.evaluator import Evaluator
from ballpass.derive.mechanism.forces import BodyTorque, ConstantForce, Forces, PointForce, Windows, derive_forces
from ballpass.derive.mechanism.forces.windows import Window
from ballpass.derive.mechanism.linkage import Linkage, derive_linkage
from ballpass.derive.mechanism.reactions import Reactions, derive_reactions
from ballpass.derive.scene.mechanism_records import Body, Driver, Force, Gear, Joint, Mechanism, NamedPoint
from ballpass.derive.scene.quantity import SceneNumber, Vector
from ballpass.derive.terms import TIME
from ballpass.runtime.contract.manifest import TurningInfo

ANGLE = sp.Symbol("theta", real=True)
SPEED = sp.Symbol("mechanism.driver.speed", real=True)
DEGREE = math.pi / 180.0

#: Of constant speed, with symbols of its own.
DRIVE = KnownDrive(
    angle=ANGLE,
    speed=SPEED,
    acceleration=sp.S.Zero,
    first_angle=sp.Symbol("mechanism.driver.start_angle", real=True),
    first_speed=SPEED,
    description="the driver's speed is constant",
    turning=TurningInfo(
        name="driver",
        kind="driver",
        words="the driver",
        offset="mechanism.driver.start_angle",
        rate="mechanism.driver.speed",
        speeds=("mechanism.driver.speed",),
    ),
    passed=SPEED * TIME,
)

#: None: zero.  A number: along the body's x axis.  ("xy", x, y).  ("polar", length, angle).
Place = None | float | tuple[str, float, float]


@dataclass
class Numbers:
    """Makes quantities and remembers their values."""

    values: dict[str, float] = field(default_factory=dict)

    def quantity(self, path: str, value: float, unit: str) -> SceneNumber:
        self.values[path] = value
        return SceneNumber(path=path, value=value, unit=unit, description=path, latex="q")

    def vector(self, path: str, place: Place, unit: str) -> Vector:
        if place is None:
            return Vector(kind="zero")
        if isinstance(place, int | float):
            return Vector(kind="axis", first=self.quantity(path, place, unit))
        kind, one, two = place
        first, second = (".x", ".y") if kind == "xy" else (".distance", ".angle")
        return Vector(
            kind="cartesian" if kind == "xy" else "polar",
            first=self.quantity(path + first, one, unit),
            second=self.quantity(path + second, two, unit if kind == "xy" else "rad"),
        )

    def points(self, path: str, places: Mapping[str, Place]) -> tuple[NamedPoint, ...]:
        return tuple(
            NamedPoint(name=name, position=self.vector(f"{path}.points.{name}", place, "m"))
            for name, place in places.items()
        )


@dataclass
class Machine:
    """A mechanism with its numbers."""

    mechanism: Mechanism
    values: dict[str, float]

    def linkage(self) -> Linkage:
        return derive_linkage(self.mechanism, DRIVE)

    def forces(self, linkage: Linkage) -> Forces:
        return derive_forces(linkage)

    def reactions(self, linkage: Linkage, moments: Sequence[str] = ()) -> Reactions:
        return derive_reactions(linkage, self.forces(linkage).loads, frozenset(moments))

    def with_windows(self, name: str) -> Machine:
        """The force `name` acts within a window; its gate is the symbol ``gate.<name>``."""
        window = Window(start=self.mechanism.driver.start_angle, end=self.mechanism.driver.start_angle)
        forces = tuple(
            replace(f, law=Windows(windows=(window,))) if f.name == name else f for f in self.mechanism.forces
        )
        return Machine(mechanism=replace(self.mechanism, forces=forces), values=self.values)

    def with_values(self, **changes: float) -> Machine:
        """Other numbers; `changes` by path with ``__`` for the dot."""
        new = {name.replace("__", "."): value for name, value in changes.items()}
        assert set(new) <= set(self.values)
        return Machine(mechanism=self.mechanism, values={**self.values, **new})

    def with_joint(self, name: str, **changes: Any) -> Machine:
        joints = tuple(replace(j, **changes) if j.name == name else j for j in self.mechanism.joints)
        return Machine(mechanism=replace(self.mechanism, joints=joints), values=self.values)

    def with_body(self, name: str, **changes: Any) -> Machine:
        bodies = tuple(replace(b, **changes) if b.name == name else b for b in self.mechanism.bodies)
        return Machine(mechanism=replace(self.mechanism, bodies=bodies), values=self.values)

    def numbers(self, angle: Any, **given: Any) -> dict[sp.Symbol, Any]:
        """Value of every parameter, of the angle, and of other symbols named in `given`."""
        symbols = {sp.Symbol(name, real=True): value for name, value in self.values.items()}
        return {**symbols, **{sp.Symbol(n, real=True): v for n, v in given.items()}, ANGLE: angle}

    def speed(self) -> float:
        return self.values["mechanism.driver.speed"]


def evaluate(
    machine: Machine,
    results: Sequence[sp.Expr],
    angle: Any,
    linkage: Linkage,
    reactions: Reactions | None = None,
    **given: Any,
) -> list[Any]:
    """Numbers of expressions in the symbols of a linkage and its reactions."""
    definitions = linkage.definitions + (reactions.definitions if reactions is not None else ())
    return Evaluator(definitions, results)(machine.numbers(angle, **given))


def build(
    *,
    frame: Mapping[str, Place],
    bodies: Mapping[str, Mapping[str, Any]],
    joints: Mapping[str, Mapping[str, Any]],
    speed: float,
    driver: str = "A",
    gravity: Place = 9.81,
    forces: Mapping[str, tuple[str, str, Place]] | None = None,
    torques: Mapping[str, tuple[str, float]] | None = None,
    gears: Mapping[str, Mapping[str, Any]] | None = None,
) -> Machine:
    numbers = Numbers()
    root = "mechanism"
    mechanism = Mechanism(
        gravity=None if gravity is None else numbers.vector(f"{root}.gravity", gravity, "m/s^2"),
        driver=Driver(
            joint=driver,
            speed=numbers.quantity(f"{root}.driver.speed", speed, "rad/s"),
            start_angle=numbers.quantity(f"{root}.driver.start_angle", 0.0, "rad"),
        ),
        frame_points=numbers.points(f"{root}.frame", frame),
        bodies=tuple(_body(numbers, name, data) for name, data in bodies.items()),
        joints=tuple(_joint(numbers, name, data) for name, data in joints.items()),
        forces=tuple(
            Force(
                name=name,
                table="forces",
                pathway=PointForce(
                    body=body,
                    point=point,
                    force=numbers.vector(f"{root}.forces.{name}.force", force, "N"),
                    direction=None,
                ),
                law=ConstantForce(),
            )
            for name, (body, point, force) in (forces or {}).items()
        )
        + tuple(
            Force(
                name=name,
                table="torques",
                pathway=BodyTorque(body=body, torque=numbers.quantity(f"{root}.torques.{name}.torque", torque, "N*m")),
                law=ConstantForce(),
            )
            for name, (body, torque) in (torques or {}).items()
        ),
        gears=tuple(_gear(numbers, name, data) for name, data in (gears or {}).items()),
    )
    return Machine(mechanism=mechanism, values=numbers.values)


def _body(numbers: Numbers, name: str, data: Mapping[str, Any]) -> Body:
    path = f"mechanism.bodies.{name}"
    inertia = data.get("inertia")
    return Body(
        name=name,
        mass=numbers.quantity(f"{path}.mass", data["mass"], "kg"),
        inertia=None if inertia is None else numbers.quantity(f"{path}.inertia", inertia, "kg*m^2"),
        center_of_mass=numbers.vector(f"{path}.center_of_mass", data.get("center"), "m"),
        points=numbers.points(path, data["points"]),
    )


def _gear(numbers: Numbers, name: str, data: Mapping[str, Any]) -> Gear:
    path, pressure = f"mechanism.gears.{name}", data.get("pressure", 20 * DEGREE)
    first, second = (numbers.quantity(f"{path}.{w}_angle", data.get(w, 0.0), "rad") for w in ("first", "second"))
    return Gear(
        name=name,
        kind=data.get("kind", "external"),
        bodies=data["bodies"],
        teeth=data["teeth"],
        pressure_angle=numbers.quantity(f"{path}.pressure_angle", pressure, "rad"),
        first_angle=first,
        second_angle=second,
        radius=numbers.quantity(f"{path}.radius", data["radius"], "m") if "radius" in data else None,
    )


def _joint(numbers: Numbers, name: str, data: Mapping[str, Any]) -> Joint:
    direction = data.get("direction")
    return Joint(
        name=name,
        kind="revolute" if direction is None else "prismatic",
        bodies=data["bodies"],
        points=data.get("points", (name, name)),
        direction=None
        if direction is None
        else numbers.quantity(f"mechanism.joints.{name}.direction", direction, "rad"),
        branch=data.get("branch"),
    )


def crank_slider(crank: float = 6e-3, rod: float = 0.1, branch: str = "ahead") -> Machine:
    """The punching machine of the paper; physics.md leaves l_o1 = 0, theta_1p = 0, l_o2 = 50 mm."""
    return build(
        frame={"A": None, "guide": None},
        bodies={
            "crank": {
                "mass": 0.3567,
                "inertia": 611.7e-6,
                "center": ("polar", 0.0, 0.0),
                "points": {"A": None, "B": crank},
            },
            "rod": {"mass": 2.55, "inertia": 7517.545e-6, "center": 0.5 * rod, "points": {"B": None, "C": rod}},
            "slider": {"mass": 16.7965, "points": {"C": None}},
        },
        joints={
            "A": {"bodies": ("frame", "crank")},
            "B": {"bodies": ("crank", "rod")},
            "C": {"bodies": ("rod", "slider"), "branch": branch},
            "D": {"bodies": ("frame", "slider"), "points": ("guide", "C"), "direction": 270 * DEGREE},
        },
        forces={"punch": ("slider", "C", ("xy", 0.0, 8964.8))},
        speed=500 * 2 * math.pi / 60,
    )


def offset_slider(branch: str = "ahead") -> Machine:
    """Offset, inclined guide; every centre of mass off its line; slider with inertia, pushed off its pin."""
    return build(
        frame={"A": ("xy", 0.01, -0.02), "guide": ("xy", 0.03, 0.012)},
        bodies={
            "crank": {
                "mass": 0.8,
                "inertia": 1.1e-3,
                "center": ("polar", 0.017, 0.6),
                "points": {"A": ("xy", 0.004, 0.003), "B": ("polar", 0.05, 0.2)},
            },
            "rod": {
                "mass": 1.7,
                "inertia": 9e-3,
                "center": ("xy", 0.06, 0.02),
                "points": {"B": ("xy", -0.01, 0.005), "C": ("xy", 0.15, 0.03)},
            },
            "slider": {
                "mass": 3.1,
                "inertia": 4e-3,
                "center": ("xy", 0.02, -0.013),
                "points": {"C": ("xy", 0.005, 0.002), "D": ("xy", -0.01, 0.03), "tool": ("xy", 0.05, 0.01)},
            },
        },
        joints={
            "A": {"bodies": ("frame", "crank")},
            "B": {"bodies": ("crank", "rod")},
            "C": {"bodies": ("rod", "slider"), "branch": branch},
            "D": {"bodies": ("frame", "slider"), "points": ("guide", "D"), "direction": 20 * DEGREE},
        },
        forces={"push": ("slider", "tool", ("xy", -310.0, 45.0))},
        torques={"friction": ("crank", -0.7)},
        speed=40.0,
    )


def _four_bar_bodies(rocker_points: Mapping[str, Place]) -> dict[str, Any]:
    """Bodies of the crank-rocker; the rocker with further points."""
    return {
        "crank": {"mass": 0.5, "inertia": 6e-4, "center": ("xy", 0.02, 0.006), "points": {"A": None, "B": 0.05}},
        "coupler": {
            "mass": 1.2,
            "inertia": 5e-3,
            "center": ("polar", 0.11, 0.3),
            "points": {"B": None, "C": 0.19, "tool": ("xy", 0.1, 0.07)},
        },
        "rocker": {
            "mass": 0.9,
            "inertia": 3e-3,
            "center": ("xy", 0.06, -0.02),
            "points": {"D": None, "C": 0.13, **rocker_points},
        },
    }


def four_bar(branch: str = "left") -> Machine:
    """Crank-rocker, centres of mass off the lines."""
    return build(
        frame={"A": None, "D": ("xy", 0.2, 0.03)},
        bodies=_four_bar_bodies({"E": ("xy", 0.12, 0.05)}),
        joints={
            "A": {"bodies": ("frame", "crank")},
            "B": {"bodies": ("crank", "coupler")},
            "C": {"bodies": ("coupler", "rocker"), "branch": branch},
            "D": {"bodies": ("rocker", "frame")},
        },
        forces={"push": ("coupler", "tool", ("xy", 40.0, -65.0))},
        torques={"brake": ("rocker", 1.3)},
        speed=30.0,
    )


def _extended(
    extra_frame: Mapping[str, Place], bodies: Any, joints: Any, rocker_points: Mapping[str, Place]
) -> Machine:
    """The four-bar with a further dyad."""
    return build(
        frame={"A": None, "D": ("xy", 0.2, 0.03), **extra_frame},
        bodies={
            **_four_bar_bodies(rocker_points),
            **bodies,
        },
        # The second dyad stands first: the order of assembly is not the order of the file.
        joints={
            **joints,
            "A": {"bodies": ("crank", "frame")},
            "B": {"bodies": ("crank", "coupler")},
            "C": {"bodies": ("coupler", "rocker"), "branch": "left"},
            "D": {"bodies": ("rocker", "frame")},
        },
        forces={"push": ("coupler", "tool", ("xy", 40.0, -65.0))},
        torques={"brake": ("rocker", 1.3)},
        speed=30.0,
    )


def six_bar_slider(branch: str = "ahead") -> Machine:
    """Four-bar whose rocker drives a slider on the frame: RRP on RRR."""
    return _extended(
        {"guide": ("xy", 0.3, 0.2)},
        {
            "link": {"mass": 0.6, "inertia": 2e-3, "center": ("xy", 0.1, 0.01), "points": {"E": None, "F": 0.25}},
            "ram": {"mass": 2.0, "inertia": 1e-3, "center": ("xy", 0.01, 0.02), "points": {"F": None}},
        },
        {
            "E": {"bodies": ("rocker", "link")},
            "F": {"bodies": ("ram", "link"), "branch": branch},
            "G": {"bodies": ("frame", "ram"), "points": ("guide", "F"), "direction": 10 * DEGREE},
        },
        {"E": ("xy", 0.12, 0.05)},
    )


def moving_guide(branch: str = "ahead", guide_on_slider: bool = False) -> Machine:
    """Four-bar whose rocker carries a guide; its slider is hinged to a rod on the frame."""
    rocker = ("rocker", ("xy", 0.03, 0.04), "E")
    slider = ("block", ("xy", 0.004, -0.006), "G")
    first, second = (slider, rocker) if guide_on_slider else (rocker, slider)
    return _extended(
        {"H": ("xy", 0.32, 0.02)},
        {
            "link": {"mass": 0.6, "inertia": 2e-3, "center": ("xy", 0.1, 0.01), "points": {"H": None, "F": 0.3}},
            "block": {
                "mass": 0.4,
                "inertia": 3e-4,
                "center": ("xy", 0.005, 0.007),
                "points": {"F": ("xy", 0.002, 0.001), "G": slider[1]},
            },
        },
        {
            "F": {"bodies": ("link", "block"), "branch": branch},
            "G": {"bodies": (first[0], second[0]), "points": (first[2], second[2]), "direction": 35 * DEGREE},
            "H": {"bodies": ("frame", "link")},
        },
        {"E": rocker[1]},
    )


def watt_six_bar(branch: str = "right") -> Machine:
    """RRR on the coupler and the rocker of a four-bar."""
    return _extended(
        {},
        {
            "link": {"mass": 0.6, "inertia": 2e-3, "center": ("xy", 0.1, 0.01), "points": {"tool": None, "F": 0.2}},
            "arm": {"mass": 0.4, "inertia": 1e-3, "center": ("xy", 0.09, 0.007), "points": {"E": None, "F": 0.18}},
        },
        {
            "F": {"bodies": ("link", "arm"), "branch": branch},
            "E": {"bodies": ("rocker", "arm")},
            "G": {"bodies": ("coupler", "link"), "points": ("tool", "tool")},
        },
        {"E": ("xy", 0.12, 0.05)},
    )


def slotted_lever(branch: str = "ahead", crank: float = 0.05, guide_on_block: bool = False) -> Machine:
    """Crank, block, slotted lever; slot and block beside their hinges.  With 0.18 m the crank takes the lever round."""
    lever, block = ("lever", "slot"), ("block", "shoe")
    first, second = (block, lever) if guide_on_block else (lever, block)
    return build(
        frame={"A": ("xy", 0.01, 0.02), "O": ("xy", 0.03, -0.1)},
        bodies={
            "crank": {"mass": 0.5, "inertia": 6e-4, "center": ("xy", 0.01, 0.006), "points": {"A": None, "B": crank}},
            "block": {
                "mass": 0.3,
                "inertia": 2e-4,
                "center": ("xy", 0.004, -0.003),
                "points": {"B": ("xy", 0.003, 0.002), "shoe": ("xy", -0.006, 0.004)},
            },
            "lever": {
                "mass": 1.4,
                "inertia": 8e-3,
                "center": ("xy", 0.11, 0.012),
                "points": {"O": ("xy", 0.01, -0.01), "slot": ("xy", 0.05, 0.013), "tip": ("xy", 0.22, 0.02)},
            },
        },
        joints={
            "A": {"bodies": ("frame", "crank")},
            "B": {"bodies": ("crank", "block")},
            "S": {
                "bodies": (first[0], second[0]),
                "points": (first[1], second[1]),
                "direction": 8 * DEGREE,
                "branch": branch,
            },
            "O": {"bodies": ("lever", "frame")},
        },
        forces={"cut": ("lever", "tip", ("xy", 320.0, -45.0))},
        torques={"brake": ("lever", 1.3)},
        speed=12.0,
    )


def shaper_with_ram() -> Machine:
    """The slotted lever moves a ram by a link: RRP on RPR."""
    machine = slotted_lever()
    further = build(
        frame={"guide": ("xy", 0.0, 0.2)},
        bodies={
            "link": {"mass": 0.6, "inertia": 2e-3, "center": ("xy", 0.1, 0.01), "points": {"tip": None, "C": 0.25}},
            "ram": {"mass": 4.0, "inertia": 1e-3, "center": ("xy", 0.01, 0.02), "points": {"C": None}},
        },
        joints={
            "E": {"bodies": ("lever", "link"), "points": ("tip", "tip")},
            "C": {"bodies": ("link", "ram"), "branch": "ahead"},
            "G": {"bodies": ("frame", "ram"), "points": ("guide", "C"), "direction": 3 * DEGREE},
        },
        speed=12.0,
    )
    one, two = machine.mechanism, further.mechanism
    both = replace(
        one,
        frame_points=one.frame_points + two.frame_points,
        bodies=one.bodies + two.bodies,
        joints=one.joints + two.joints,
    )
    return Machine(mechanism=both, values={**machine.values, **further.values})


def scotch_yoke(branch: str | None = None, slot_on_block: bool = False) -> Machine:
    """Crank, block, yoke on an inclined guide; slot and guide beside their points, and not at right angles."""
    yoke, block = ("yoke", "slot"), ("block", "shoe")
    first, second = (block, yoke) if slot_on_block else (yoke, block)
    return build(
        frame={"A": ("xy", 0.01, 0.02), "guide": ("xy", -0.02, 0.05)},
        bodies={
            "crank": {"mass": 0.5, "inertia": 6e-4, "center": ("xy", 0.01, 0.006), "points": {"A": None, "B": 0.05}},
            "block": {
                "mass": 0.3,
                "center": ("xy", 0.004, -0.003),
                "points": {"B": ("xy", 0.003, 0.002), "shoe": ("xy", -0.006, 0.004)},
            },
            "yoke": {
                "mass": 2.0,
                "center": ("xy", 0.03, 0.011),
                "points": {"slot": ("xy", 0.02, -0.03), "Y": ("xy", 0.09, 0.01), "tool": ("xy", 0.2, 0.02)},
            },
        },
        joints={
            "A": {"bodies": ("frame", "crank")},
            "B": {"bodies": ("crank", "block")},
            "S": {
                "bodies": (first[0], second[0]),
                "points": (first[1], second[1]),
                "direction": 80 * DEGREE,
                "branch": branch,
            },
            "G": {"bodies": ("frame", "yoke"), "points": ("guide", "Y"), "direction": 7 * DEGREE},
        },
        forces={"push": ("yoke", "tool", ("xy", -310.0, 45.0))},
        torques={"friction": ("crank", -0.7)},
        speed=40.0,
    )


def yoke_on_rocker() -> Machine:
    """Four-bar whose rocker carries the guide of a yoke; its block is hinged to the crank."""
    return _extended(
        {},
        {
            "block": {
                "mass": 0.3,
                "inertia": 2e-4,
                "center": ("xy", 0.004, -0.003),
                "points": {"B": ("xy", 0.003, 0.002), "S": ("xy", -0.006, 0.004)},
            },
            "yoke": {
                "mass": 0.8,
                "inertia": 2e-3,
                "center": ("xy", 0.03, 0.011),
                "points": {"S": ("xy", 0.02, -0.03), "E": ("xy", 0.09, 0.01)},
            },
        },
        {
            "S": {"bodies": ("block", "yoke"), "direction": 100 * DEGREE},
            "E": {"bodies": ("yoke", "rocker"), "direction": 15 * DEGREE},
            "F": {"bodies": ("block", "crank"), "points": ("B", "B")},
        },
        {"E": ("xy", 0.12, 0.05)},
    )


def rapson_slide(guide_on_ram: bool = False) -> Machine:
    """Four-bar whose rocker carries a slot; its block is hinged to a ram on the frame, which carries a tool."""
    ram, frame = ("ram", "foot"), ("frame", "guide")
    first, second = (ram, frame) if guide_on_ram else (frame, ram)
    return _extended(
        {"guide": ("xy", 0.3, 0.2)},
        {
            "block": {
                "mass": 0.4,
                "inertia": 3e-4,
                "center": ("xy", 0.005, 0.007),
                "points": {"F": ("xy", 0.002, 0.001), "E": ("xy", 0.004, -0.006)},
            },
            "ram": {
                "mass": 2.0,
                "center": ("xy", 0.01, 0.02),
                "points": {"F": ("xy", -0.02, 0.01), "foot": ("xy", 0.05, -0.03)},
            },
        },
        {
            "F": {"bodies": ("ram", "block")},
            "E": {"bodies": ("rocker", "block"), "direction": 35 * DEGREE},
            "G": {"bodies": (first[0], second[0]), "points": (first[1], second[1]), "direction": 10 * DEGREE},
        },
        {"E": ("xy", 0.03, 0.04)},
    )


MACHINES = {
    "crank-slider": crank_slider,
    "crank-slider behind": lambda: crank_slider(branch="behind"),
    "offset slider": offset_slider,
    "offset slider behind": lambda: offset_slider("behind"),
    "four-bar": four_bar,
    "four-bar right": lambda: four_bar("right"),
    "six-bar with slider": six_bar_slider,
    "six-bar with slider behind": lambda: six_bar_slider("behind"),
    "guide on a moving body": moving_guide,
    "guide on a moving body behind": lambda: moving_guide("behind"),
    "guide on the slider": lambda: moving_guide(guide_on_slider=True),
    "watt six-bar": watt_six_bar,
    "watt six-bar left": lambda: watt_six_bar("left"),
    "slotted lever": slotted_lever,
    "slotted lever behind": lambda: slotted_lever("behind"),
    "slotted lever, guide on the block": lambda: slotted_lever(guide_on_block=True),
    "slotted lever that goes round": lambda: slotted_lever(crank=0.18),
    "shaper with ram": shaper_with_ram,
    "scotch yoke": scotch_yoke,
    "scotch yoke, slot on the block": lambda: scotch_yoke("ahead", slot_on_block=True),
    "yoke on a moving body": yoke_on_rocker,
    "rapson's slide": rapson_slide,
    "rapson's slide, guide on the ram": lambda: rapson_slide(guide_on_ram=True),
}


def _wheel(**points: Place) -> dict[str, Any]:
    return {"mass": 0.9, "inertia": 2e-3, "center": ("xy", 0.012, -0.003), "points": {"axis": None, **points}}


def _rod(length: float, *names: str) -> dict[str, Any]:
    points: dict[str, Place] = dict(zip(names, (None, length), strict=True))
    return {"mass": 0.4, "inertia": 1e-3, "center": ("xy", 0.06, 0.01), "points": points}


def geared_five_bar(teeth: tuple[int, int] = (20, 40), turned: bool = False) -> Machine:
    """Two cranks in mesh, and two rods between them."""
    wheels = ("wheel", "crank") if turned else ("crank", "wheel")
    return build(
        frame={"A": ("xy", 0.01, 0.02), "E": ("xy", 0.12, 0.03)},
        bodies={
            "crank": _wheel(B=0.03),
            "wheel": _wheel(D=0.025),
            "left": _rod(0.13, "B", "C"),
            "right": _rod(0.12, "D", "C"),
        },
        joints={
            "A": {"bodies": ("frame", "crank"), "points": ("A", "axis")},
            "B": {"bodies": ("crank", "left")},
            "C": {"bodies": ("left", "right"), "branch": "left"},
            "D": {"bodies": ("wheel", "right")},
            "E": {"bodies": ("wheel", "frame"), "points": ("axis", "E")},
        },
        gears={"G": {"bodies": wheels, "teeth": teeth[::-1] if turned else teeth, "first": 0.3, "second": 1.2}},
        torques={"brake": ("wheel", 3.0)},
        forces={"push": ("left", "C", ("xy", 40.0, -65.0))},
        speed=30.0,
    )


def belted_five_bar(teeth: tuple[int, int] = (30, 90)) -> Machine:
    """The same with a belt, whose pulleys are smaller than the distance of their axes."""
    machine = geared_five_bar()
    numbers = Numbers(machine.values)
    gear = _gear(numbers, "G", {"kind": "belt", "bodies": ("crank", "wheel"), "teeth": teeth, "radius": 0.015})
    return Machine(mechanism=replace(machine.mechanism, gears=(gear,)), values=numbers.values)


def reduced_press() -> Machine:
    """Pinion, idler and ring on the frame; the ring drives a slider."""
    return build(
        frame={"A": None, "I": ("xy", 0.05, 0.01), "E": ("xy", 0.12, 0.02), "guide": ("xy", 0.1, -0.02)},
        bodies={
            "pinion": _wheel(),
            "idler": _wheel(),
            "ring": _wheel(B=0.04),
            "rod": _rod(0.2, "B", "C"),
            "ram": {"mass": 3.0, "points": {"C": None}},
        },
        joints={
            "A": {"bodies": ("frame", "pinion"), "points": ("A", "axis")},
            "I": {"bodies": ("frame", "idler"), "points": ("I", "axis")},
            "E": {"bodies": ("frame", "ring"), "points": ("E", "axis")},
            "B": {"bodies": ("ring", "rod")},
            "C": {"bodies": ("rod", "ram"), "branch": "ahead"},
            "G": {"bodies": ("frame", "ram"), "points": ("guide", "C"), "direction": 270 * DEGREE},
        },
        gears={
            "one": {"bodies": ("pinion", "idler"), "teeth": (18, 27), "second": 0.4},
            "two": {"kind": "internal", "bodies": ("ring", "idler"), "teeth": (90, 27), "pressure": 0.3},
        },
        forces={"punch": ("ram", "C", ("xy", 0.0, 900.0))},
        speed=50.0,
    )


def planetary(sun_hinged_to: str = "arm") -> Machine:
    """An arm turns a planet about a fixed sun; the planet turns a second sun, and its pin a slider."""
    held = {"arm": ("arm", "sun"), "frame": ("frame", "sun")}[sun_hinged_to]
    return build(
        frame={"O": ("xy", 0.01, 0.02), "guide": ("xy", 0.1, -0.02)},
        bodies={
            "arm": {
                "mass": 0.5,
                "inertia": 6e-4,
                "center": ("xy", 0.02, 0.006),
                "points": {"O": ("xy", 0.003, 0.002), "P": ("xy", 0.06, 0.01)},
            },
            "planet": _wheel(B=0.02),
            "sun": {"mass": 1.3, "inertia": 4e-3, "points": {"O": None, "mark": 0.02}},
            "rod": _rod(0.25, "B", "C"),
            "ram": {"mass": 3.0, "points": {"C": None}},
        },
        joints={
            "A": {"bodies": ("frame", "arm"), "points": ("O", "O")},
            "S": {"bodies": held, "points": ("O", "O")},
            "P": {"bodies": ("arm", "planet"), "points": ("P", "axis")},
            "B": {"bodies": ("planet", "rod")},
            "C": {"bodies": ("rod", "ram"), "branch": "ahead"},
            "G": {"bodies": ("frame", "ram"), "points": ("guide", "C"), "direction": -20 * DEGREE},
        },
        gears={
            "fixed": {"bodies": ("frame", "planet"), "teeth": (36, 24), "second": 0.4},
            "free": {"kind": "internal", "bodies": ("planet", "sun"), "teeth": (20, 60)},
        },
        forces={"punch": ("ram", "C", ("xy", 50.0, 90.0))},
        torques={"load": ("sun", 2.0)},
        speed=20.0,
    )


def sector() -> Machine:
    """A four-bar whose rocker turns a pinion to and fro."""
    machine = four_bar()
    further = build(
        frame={"F": ("xy", 0.25, -0.04)},
        bodies={"pinion": _wheel(mark=0.02)},
        joints={"F": {"bodies": ("frame", "pinion"), "points": ("F", "axis")}},
        gears={"G": {"bodies": ("pinion", "rocker"), "teeth": (15, 40), "first": -0.5, "second": 2.0}},
        torques={"load": ("pinion", -0.4)},
        speed=30.0,
    )
    one, two = machine.mechanism, further.mechanism
    both = {
        name: getattr(one, name) + getattr(two, name)
        for name in ("frame_points", "bodies", "joints", "forces", "gears")
    }
    return Machine(mechanism=replace(one, **both), values={**machine.values, **further.values})


#: Machines with gears.
GEARED = {
    "geared five-bar": geared_five_bar,
    "geared five-bar, gear the other way round": lambda: geared_five_bar((28, 21), turned=True),
    "five-bar with a belt": belted_five_bar,
    "five-bar with a belt of alike pulleys": lambda: belted_five_bar((30, 30)),
    "press with a reduction": reduced_press,
    "planetary": planetary,
    "planetary, sun on the frame": lambda: planetary("frame"),
    "sector": sector,
}
