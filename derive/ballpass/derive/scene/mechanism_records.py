"""The mechanism of a scene as frozen records in SI units: bodies, joints, gears, driver, forces; see `records`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

from ballpass.derive.scene.keys import ChoiceKey, NamesKey, Needs, QuantityKey, TextKey, VectorKey, WholePairKey
from ballpass.derive.scene.quantity import AMOUNT, NOT_NEGATIVE, POSITIVE, Bounds, Limits, SceneNumber, Vector
from ballpass.derive.scene.read_keys import column, positive, quantity

#: Name of the centre of mass among the points of a body that have a place along the shaft.
CENTER_OF_MASS = "center_of_mass"
#: Place of a point of the driven body, POINT, along the shaft.
POSITION = QuantityKey(
    unit="m",
    words="Place of POINT along the shaft",
    symbol="z_{INDEX}",
    example="-40 mm",
    optional=True,
    note="a point's name, or `center_of_mass`; of the driven body, where bearings have a `position`; without it zero",
)
#: A point of a body, POINT of the OWNER with the index INDEX.
POINT = VectorKey(
    unit="m",
    words="point POINT of the OWNER",
    axis="Distance of point POINT of the OWNER from the origin of its x axis",
    symbols=("l_{INDEX}", "x_{INDEX}", "y_{INDEX}", "l_{INDEX}", r"\phi_{INDEX}"),
    origin=True,
    axis_limits=Limits(bounds=POSITIVE, remedy="give a positive length, or write the point as [x, y]"),
    length_limits=AMOUNT,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class NamedPoint:
    """A point of a body in body axes (of the frame: in the frame's axes) [m]."""

    name: str
    position: Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class Body:
    """A moving rigid body.

    `inertia` is about the centre of mass [kg*m^2]; None for a body that does not rotate.  `positions` are places of
    its points along the shaft [m], of the driven body alone; with `transverse_inertia` [kg*m^2] that tilts in its
    bearings.
    """

    name: str
    mass: SceneNumber = positive(
        "kg",
        "Mass of the NAME",
        "m_{INDEX}",
        "0.36 kg",
        remedy="every moving body has a mass: give it, small where it hardly matters",
    )
    inertia: SceneNumber | None = positive(
        "kg*m^2",
        "Moment of inertia of the NAME about its centre of mass",
        "J_{INDEX}",
        "611.7 kg*mm^2",
        optional=True,
        when="required, except for bodies that guides keep from turning",
        remedy="give a positive value, or delete the key for a body that does not rotate",
    )
    transverse_inertia: SceneNumber | None = positive(
        "kg*m^2",
        "Moment of inertia of the NAME about axes across the shaft through its centre of mass",
        "J_{t,INDEX}",
        "900 kg*mm^2",
        optional=True,
        note="of the driven body, which then tilts in its bearings: {doc}`../../theory/supports`",
    )
    center_of_mass: Vector = VectorKey(
        unit="m",
        words="the centre of mass of the NAME",
        note="vector in body axes",
        axis="Distance of the centre of mass of the NAME from its origin, along its x axis",
        symbols=("l_{o,INDEX}", "x_{o,INDEX}", "y_{o,INDEX}", "l_{o,INDEX}", r"\theta_{p,INDEX}"),
        origin=True,
        length_limits=AMOUNT,
    ).declared()
    points: tuple[NamedPoint, ...]
    positions: tuple[tuple[str, SceneNumber], ...] = ()

    def point(self, name: str) -> Vector:
        """Place of a named point in body axes [m]."""
        return next(p.position for p in self.points if p.name == name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Joint:
    """A revolute or prismatic joint between two bodies, each at a named point.

    Revolute: the two points coincide.
    Prismatic: the guide belongs to ``bodies[0]``: a line through ``points[0]`` along `direction`, an angle
    [rad] in that body's axes.  ``points[1]`` of ``bodies[1]`` (the slider) stays on the line; the slider's axes stay
    parallel to those of ``bodies[0]``.

    `branch` is set at the inner joint of a dyad, else None; each kind of dyad has its own words.

    The joint's reaction is the force of ``bodies[1]`` on ``bodies[0]``.
    """

    name: str
    kind: Literal["revolute", "prismatic"] = ChoiceKey(
        name="type", words="Kind of joint", choices=("revolute", "prismatic")
    ).declared()
    bodies: tuple[str, str] = NamesKey(
        words="Its two bodies",
        example='["frame", "crank"]',
        note='`"frame"` is the body that does not move; the reaction is the force of the second on the first',
    ).declared()
    points: tuple[str, str] = NamesKey(
        words="The point of each body",
        example='["NAME", "NAME"]',
        default=("NAME", "NAME"),
        when="default: the joint's own name, twice",
    ).declared()
    direction: SceneNumber | None = quantity(
        "rad",
        "Direction of the guide of joint NAME",
        r"\psi_{INDEX}",
        "270 deg",
        needs=(Needs(key="type", value="prismatic", why="a revolute joint has no direction"),),
        note="in the axes of the first body. The guide belongs to the first body and passes through its point; the "
        "second body's point moves along it without rotation against the first body",
    )
    branch: str | None

    def point(self, body: str) -> str:
        """Name of the joint's point on one of its bodies."""
        return self.points[self.bodies.index(body)]

    def other(self, body: str) -> str:
        """The body on the other side."""
        return self.bodies[1 - self.bodies.index(body)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Gear:
    """Two wheels in mesh, or two pulleys of a belt, whose axes one body carries.

    Seen from that body, the first wheel turns by `first_angle` and something [rad] where the second turns by
    `second_angle` and the ratio of the `teeth` times it.
    The force of a gear is that of ``bodies[1]`` on ``bodies[0]``.
    """

    name: str
    kind: Literal["external", "internal", "belt"] = ChoiceKey(
        name="type",
        words="How the wheels mesh",
        choices=("external", "internal", "belt"),
        default="external",
        note="of an internal gear the wheel with more teeth is the ring; a belt does not slip, and one strand carries",
    ).declared()
    bodies: tuple[str, str] = NamesKey(
        words="Its two wheels",
        example='["crank", "wheel"]',
        note='both hinged to one body, which carries the axes; `"frame"` may be one of them, or that body',
    ).declared()
    teeth: tuple[int, int] = WholePairKey(
        words="Teeth of both wheels", example=[20, 40], lowest=1, highest=10000, note="their ratio alone counts"
    ).declared()
    pressure_angle: SceneNumber = quantity(
        "rad",
        "Pressure angle of gear NAME",
        r"\alpha_{INDEX}",
        "20 deg",
        default="20 deg",
        bounds=Bounds(least=0.0, below=math.pi / 4),
        note="from the common tangent of the pitch circles to the line of pressure",
    )
    radius: SceneNumber | None = positive(
        "m",
        "Radius of the first pulley of gear NAME",
        r"r_{INDEX}",
        "40 mm",
        needs=(Needs(key="type", value="belt", why="radii of wheels in mesh follow from the distance of their axes"),),
    )
    first_angle: SceneNumber = quantity(
        "rad",
        "Angle of the first wheel of gear NAME in one position",
        r"\varphi_{1,INDEX}",
        "0 deg",
        default="0 deg",
        note="in axes of the body that carries it; a wheel that swings stays within half a turn of it",
    )
    second_angle: SceneNumber = quantity(
        "rad",
        "Angle of the second wheel of gear NAME in that position",
        r"\varphi_{2,INDEX}",
        "0 deg",
        default="0 deg",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedOverTime:
    """Rows of a driver's speed: times [s], increasing, and the speeds after the first, which is `Driver.speed`."""

    time: tuple[SceneNumber, ...] = column(
        "s", "Time in row ROW of the driver's table", "t_{1,ROW}", bounds=NOT_NEGATIVE, note="increasing"
    )
    later_speed: tuple[SceneNumber, ...] = column(
        "rad/s", "Speed in row ROW of the driver's table", r"\omega_{1,ROW}", name="speed"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class OscillatingDriver:
    """Angle of a driver that swings: ``start_angle + amplitude * sin(2 pi frequency t)`` [rad], [Hz]."""

    amplitude: SceneNumber = positive("rad", "Amplitude of the driver's swing", r"\hat\theta_1", "30 deg")
    frequency: SceneNumber = positive("Hz", "Frequency of the driver's swing", "f_1", "1 Hz")


@dataclass(frozen=True, slots=True, kw_only=True)
class DriverRange:
    """Angles within which a driver stays [rad]."""

    start: SceneNumber = quantity("rad", "Least angle of the driver", r"\theta_{1,-}", "-60 deg")
    end: SceneNumber = quantity("rad", "Largest angle of the driver", r"\theta_{1,+}", "60 deg")


@dataclass(frozen=True, slots=True, kw_only=True)
class Driver:
    """The joint (revolute, frame to a body) turned from `start_angle` [rad] at t = 0.

    The driver's angle is that of the driven body's x axis from +x.

    Without `table` and `torque` the `speed` [rad/s] is constant, else it is that at t = 0.  A `table` gives it over
    time.  With the amplitude of a `swing` [rad] it is the frequency [Hz], and the start angle is the mean one.  A
    `torque` is a record of `ballpass.derive.drive` that this layer only stores.  With table, swing or torque a
    `flywheel` [kg*m^2] (None: none) turns with the driven body.  Runs stay within a `range`.
    """

    joint: str = TextKey(
        words="The joint that turns", example="A", note='revolute, with `bodies = ["frame", <driven body>]`'
    ).declared()
    speed: SceneNumber = quantity(
        "rad/s",
        "Speed of the driverSTART",
        r"\omegaZERO",
        "500 rpm",
        when="required without `driver.table` and `driver.swing`, else refused",
        note="counter-clockwise positive; constant, with `[mechanism.driver.torque]` that at t = 0, which may be zero",
    )
    start_angle: SceneNumber = quantity(
        "rad", "Angle of the driver at the start", r"\theta_{1,0}", "0 deg", default="0 deg"
    )
    range: DriverRange | None = None
    swing: SceneNumber | None = None
    table: SpeedOverTime | None = None
    torque: Any = None
    flywheel: SceneNumber | None = None

    @property
    def turns_unevenly(self) -> bool:
        """Whether its speed changes."""
        return any(one is not None for one in (self.swing, self.table, self.torque))


@dataclass(frozen=True, slots=True, kw_only=True)
class Force:
    """A force or torque on the linkage, from ``[mechanism.<table>.<name>]``.

    `pathway` says which bodies it acts on and along what, `law` how large it is: records of
    `ballpass.derive.mechanism.forces`, which this layer only stores.
    """

    name: str
    table: str
    pathway: Any
    law: Any

    @property
    def word(self) -> str:
        """One entry of its table: "spring"."""
        return self.table.removesuffix("s")

    @property
    def label(self) -> str:
        """Prefix of its names: "spring.return"."""
        return f"{self.word}.{self.name}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Mechanism:
    """A planar linkage with one driver.  `gravity` (axis kind: magnitude along −y) or None."""

    gravity: Vector | None
    driver: Driver
    frame_points: tuple[NamedPoint, ...]
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    forces: tuple[Force, ...]
    gears: tuple[Gear, ...] = ()

    def body(self, name: str) -> Body:
        """Moving body by name."""
        return next(b for b in self.bodies if b.name == name)

    def joint(self, name: str) -> Joint:
        """Joint by name."""
        return next(j for j in self.joints if j.name == name)
