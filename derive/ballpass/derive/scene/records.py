"""The scene as frozen records in SI units.

In: nothing but values that `read.py` has checked.  Out: one `Scene`.

Every number of a scene is a `Quantity` whose `path` is its place in the TOML file
("mechanism.bodies.crank.mass").  That path is the parameter's name everywhere: in ``--set``, in
``model.simulate(parameters=...)``, in the manifest.  Records hold structure; quantities hold numbers.
`Scene.structure` leaves the numbers out: two scenes with the same structure share one generated model.

Frame: x right, y up, angles counter-clockwise from +x.
"""

from __future__ import annotations

import math
from collections import ChainMap
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any, ClassVar, Literal

from ballpass.derive.scene.bearing_records import Bearing, Catalogue, Lubrication
from ballpass.derive.scene.keys import (
    ChoiceKey,
    NamesKey,
    Needs,
    QuantityKey,
    TextKey,
    VectorKey,
    WholeKey,
    WholePairKey,
)
from ballpass.derive.scene.quantity import NOT_NEGATIVE, POSITIVE, Bounds, Limits, SceneNumber, Vector
from ballpass.derive.scene.read_keys import Either, column, not_negative, positive, quantity
from ballpass.derive.scene.table import FRAME as FRAME
from ballpass.derive.scene.toml_lines import LineIndex
from ballpass.runtime.contract.defaults import TOLERANCES
from ballpass.runtime.contract.manifest import FitInfo
from ballpass.runtime.contract.method_registry import STEPPERS
from ballpass.runtime.show import html

#: Of a length in polar form.
AMOUNT = Limits(bounds=NOT_NEGATIVE, remedy="give the amount, and turn the angle by 180 deg")


def force_key(words: str, symbol: str, index: str = "", **more: Any) -> VectorKey:
    """A force: a single number is not enough, because its axis would be unknown."""
    x, y = (f"{symbol}_{{{index}{',' * bool(index)}{axis}}}" for axis in "xy")
    length, angle = f"{symbol}_{{{index}}}" if index else symbol, rf"\alpha_{{{index or symbol}}}"
    return VectorKey(unit="N", words=words, symbols=("", x, y, length, angle), polar=("magnitude", "direction"), **more)


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


_TILTING = (Needs(key="transverse_inertia", why="only a shaft that tilts in its bearings is a body of its own"),)


@dataclass(frozen=True, slots=True, kw_only=True)
class Shaft:
    """Rotation of a ring where no mechanism gives it: constant speed [rad/s].  The other ring stands.

    With `outer_speed` [rad/s] both rings turn.  With `transverse_inertia` [kg*m^2] it is a rigid body that tilts in its
    bearings, of a `mass` [kg] and a `polar_inertia` [kg*m^2], with its `center_of_mass` at a place along it [m];
    without, these are None.
    """

    speed: SceneNumber = quantity(
        "rad/s",
        "Speed of the shaft",
        r"\omega",
        "1200 rpm",
        note="of the ring that turns, whose angle is zero at t = 0",
    )
    ring: Literal["inner", "outer"] = ChoiceKey(
        words="The ring that turns with the shaft",
        choices=("inner", "outer"),
        default="inner",
        note="loads act on the inner ring, also where it stands",
    ).declared()
    outer_speed: SceneNumber | None = quantity(
        "rad/s",
        "Speed of the outer ring",
        r"\omega_o",
        "-800 rpm",
        optional=True,
        needs=(Needs(key="ring", value="inner", why="both rings turn, each at a speed of its own"),),
        note="where both rings turn, as between two shafts or in a planet; without it the other ring stands",
    )
    transverse_inertia: SceneNumber | None = positive(
        "kg*m^2",
        "Moment of inertia of the shaft about axes across it through its centre of mass",
        "J_t",
        "0.02 kg*m^2",
        optional=True,
        note="the shaft then tilts in its bearings, which have places: {doc}`../../theory/supports`",
    )
    mass: SceneNumber | None = positive("kg", "Mass of the shaft with the inner rings", "m", "4 kg", needs=_TILTING)
    polar_inertia: SceneNumber | None = positive(
        "kg*m^2",
        "Moment of inertia of the shaft about its axis",
        "J_p",
        "0.004 kg*m^2",
        optional=True,
        needs=_TILTING,
        note="its gyroscopic moments act on the tilts; without it none",
    )
    center_of_mass: SceneNumber | None = quantity(
        "m",
        "Place of the shaft's centre of mass along it",
        "z_c",
        "20 mm",
        optional=True,
        needs=_TILTING,
        note="without it zero",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstantLoad:
    """Constant force on the inner ring [N]."""

    force: Vector = force_key("the load on the inner ring", "F").declared()


@dataclass(frozen=True, slots=True, kw_only=True)
class HarmonicLoad:
    """``mean + amplitude * cos(2 pi frequency t + phase)`` on the inner ring [N], [Hz], [rad].

    `phase` is one for both components, or that of x and that of y.
    """

    mean: Vector = force_key("the mean load on the inner ring", r"\bar F").declared()
    amplitude: Vector = force_key("the amplitude of the load on the inner ring", r"\hat F").declared()
    frequency: SceneNumber = positive("Hz", "Frequency of the load", "f", "50 Hz")
    phase: SceneNumber | tuple[SceneNumber, SceneNumber] = quantity(
        "rad",
        "Phase of the load at the start",
        r"\varphi",
        "0 deg",
        note="of both components, or a list: that of x and that of y, `load.phase.x`",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class TableLoad:
    """Force on the inner ring, linear between rows.

    Rows are over the `time` [s], constant before the first and after the last, or the `angle` of the shaft [rad],
    periodic over a turn; the other one is empty.  Rows strictly increasing, `x` and `y` [N]; all of one length of at
    least two.
    """

    one_of: ClassVar[tuple[Either, ...]] = (
        Either(what="what the rows are over", groups=(("time",), ("angle",)), at="angle"),
    )

    time: tuple[SceneNumber, ...] = column(
        "s",
        "Time of row ROW of the load's table",
        "t_{ROW}",
        note="strictly increasing, two rows or more; constant outside",
    )
    angle: tuple[SceneNumber, ...] = column(
        "rad",
        "Angle of the shaft in row ROW of the load's table",
        r"\theta_{ROW}",
        note="within less than a turn; periodic",
    )
    x: tuple[SceneNumber, ...] = column("N", "x component of the load in row ROW of its table", "F_{x,ROW}")
    y: tuple[SceneNumber, ...] = column("N", "y component of the load in row ROW of its table", "F_{y,ROW}")

    @property
    def over(self) -> Literal["time", "angle"]:
        """What the rows are over."""
        return "angle" if self.angle else "time"

    @property
    def rows(self) -> tuple[SceneNumber, ...]:
        """Their times or angles."""
        return self.angle or self.time or ()


@dataclass(frozen=True, slots=True, kw_only=True)
class UnbalanceLoad:
    """Unbalance of the shaft: a mass [kg] at an eccentricity [m], at an angle of the shaft [rad]."""

    mass: SceneNumber = not_negative("kg", "Unbalanced mass", "m_u", "5 g")
    eccentricity: SceneNumber = not_negative(
        "m", "Distance of the unbalanced mass from the axis", "e_u", "20 mm", remedy=AMOUNT.remedy
    )
    angle: SceneNumber = quantity("rad", "Angle of the unbalance at t = 0", r"\alpha_u", "0 deg", default="0 deg")


LoadLaw = ConstantLoad | HarmonicLoad | TableLoad | UnbalanceLoad


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadWindow:
    """From `start` (inclusive) to `end` (exclusive; None: for ever): times [s], or angles of the shaft [rad]."""

    start: SceneNumber = quantity("UNIT", "WHAT at which the load begins", "SYMBOL_{on}", "FIRST")
    end: SceneNumber | None = quantity(
        "UNIT", "WHAT at which the load ends", "SYMBOL_{off}", "LAST", when="required for angles; without one a step"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Load:
    """A force on the inner ring of every bearing, acting within its windows where it has some.

    `name` is empty for the scene's only ``[load]``; ``[loads.<name>]`` have one.
    """

    name: str
    law: LoadLaw
    angle_window: LoadWindow | None = None
    time_window: LoadWindow | None = None
    position: SceneNumber | None = quantity(
        "m",
        "Place of the load along the shaft",
        "z_F",
        "-40 mm",
        optional=True,
        note="with bearings that have a `position`; without it zero",
    )

    @property
    def path(self) -> str:
        """Its place in the scene file: the prefix of the names of its constants."""
        return f"loads.{self.name}" if self.name else "load"

    @property
    def label(self) -> str:
        """Prefix of the names of its inputs and variables."""
        return f"load.{self.name}" if self.name else "load"

    @property
    def turns(self) -> bool:
        """Whether it depends on the angle of the shaft."""
        over_angle = isinstance(self.law, TableLoad) and self.law.over == "angle"
        return over_angle or isinstance(self.law, UnbalanceLoad) or self.angle_window is not None


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSettings:
    """How long to run and what to keep.  Exactly one of `cycles` (turns of driver or shaft) and `duration` [s].

    Where the file gives neither, the run is that of the steady machine.

    Where the file gives neither a transient nor the rings' initial state, they start `at_rest` under the load of t = 0.
    It is not `stated` where the file gives no turns at all: which are transient is then found.
    """

    one_of: ClassVar[tuple[Either, ...]] = (
        Either(what="the length of the run", groups=(("cycles",), ("duration",)), optional=True),
    )

    cycles: float | None = positive("1", "Turns of driver or shaft", example=4, setting=True)
    duration: float | None = positive("s", "Duration of the run", example="0.5 s", setting=True)
    transient_cycles: float = not_negative(
        "1",
        "Turns at the start that figures and summary leave out",
        example=2,
        default=0.0,
        setting=True,
        remedy="write 0 to keep the whole run",
        note="fewer than `cycles`",
    )
    samples_per_cycle: int = WholeKey(
        words="Samples in a turn",
        lowest=16,
        highest=1_000_000,
        example=2000,
        default=2000,
        note="in the whole run where nothing turns",
    ).declared()
    method: str = ChoiceKey(
        words="Integrator",
        # from behind; looked up when asked, with those of plugins, and only read
        choices=ChainMap({"cvodes": ""}, STEPPERS, {"auto": ""}),  # type: ignore[arg-type]
        default="auto",
        note="see {doc}`../../theory/integration`",
    ).declared()
    rtol: float = quantity(
        "1",
        "Relative tolerance",
        example=1e-6,
        default=1e-6,
        setting=True,
        bounds=Bounds(least=TOLERANCES[0], most=TOLERANCES[1]),
        remedy="write rtol = 1e-6 unless another value is needed",
        note="see {doc}`../../theory/integration`",
    )
    reliability: float = quantity(
        "1",
        "Share of the bearings that reach the lives of `ballpass life`",
        example=0.95,
        default=0.9,
        setting=True,
        bounds=Bounds(least=0.9, most=0.99),
        remedy="give 90, 95, 96, 97, 98 or 99 %, which ISO 281 has factors for",
    )
    at_rest: bool = False
    stated: bool = True


#: Outputs of a run, which `Scene.outputs` holds.
OUTPUTS = NamesKey(
    words="Names or patterns of what is computed",
    two=False,
    example='["inner.*", "ball.force"]',
    default=("*",),
    when='default `["*"]`, all',
    note='only these are computed. {doc}`../outputs` lists all, also those on request, such as `"point.slider.C.ay"`',
)


@dataclass(frozen=True, slots=True, kw_only=True)
class DutyState:
    """A state of a duty cycle: its share of the time [1], and the numbers that differ then, by path [SI]."""

    name: str
    share: float = positive(
        "1",
        "Share of the time",
        example=0.5,
        setting=True,
        remedy="delete the state, or give its share of the time",
        note="the shares add up to 1",
    )
    parameters: tuple[tuple[str, float], ...]


def quantities_of(record: object) -> Iterator[SceneNumber]:
    """Every quantity of a record, in the order of its fields."""
    if isinstance(record, SceneNumber):
        yield record
    elif isinstance(record, tuple):
        for item in record:
            yield from quantities_of(item)
    elif is_dataclass(record) and not isinstance(record, type):
        for field in fields(record):
            yield from quantities_of(getattr(record, field.name))


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Scene:
    """A checked scene.

    `outputs` are the patterns of the file (``"inner.*"``); `derive` resolves them.  `duty` is for lives alone.  `lines`
    are the lines of its keys, for messages; `notes` say how files of columns were read.

    Examples
    --------
    >>> scene = read_scene("scenes/punching_press.toml")
    >>> [body.name for body in scene.mechanism.bodies]
    ['crank', 'rod', 'slider']
    """

    name: str
    title: str = TextKey(
        words="What the scene is, in one line",
        example="Punching machine",
        default="",
        when="default: the scene's name",
        longest=200,
    ).declared()
    mechanism: Mechanism | None
    shaft: Shaft | None
    loads: tuple[Load, ...]
    bearings: tuple[Bearing, ...]
    outputs: tuple[str, ...]
    run: RunSettings
    duty: tuple[DutyState, ...] = ()
    lines: LineIndex = field(default=LineIndex(lines={}), repr=False, compare=False)
    notes: tuple[str, ...] = field(default=(), repr=False, compare=False)

    def __repr__(self) -> str:
        bodies = [body.name for body in self.mechanism.bodies] if self.mechanism is not None else []
        bearings = [bearing.name or "bearing" for bearing in self.bearings]
        parts = [f"bodies {', '.join(bodies)}"] * bool(bodies) + [f"bearings {', '.join(bearings)}"] * bool(bearings)
        return f"Scene({self.name}: {'; '.join((*parts, f'{len(self.quantities)} numbers'))})"

    def _repr_html_(self) -> str:
        joints = self.mechanism.joints if self.mechanism is not None else ()
        numbers = [(item.path, f"{item.value:.8g}", item.unit, item.description) for item in self.quantities]
        return html.block(
            html.title(self.title or self.name, repr(self)),
            html.table(("joint", "kind", "between"), [(j.name, j.kind, " and ".join(j.bodies)) for j in joints])
            if joints
            else "",
            html.paragraph(f"outputs: {', '.join(self.outputs)}"),
            html.folded(
                f"{len(numbers)} numbers",
                html.table(("name", "value", "unit", "description"), numbers, right=("value",)),
            ),
        )

    @property
    def quantities(self) -> tuple[SceneNumber, ...]:
        """Every number in the order of the file's schema: the model's parameters."""
        return tuple(quantities_of((self.mechanism, self.shaft, self.loads, self.bearings)))

    @property
    def integrated(self) -> bool:
        """Whether it has states: bearings, or a driver whose motion is not known as a constant speed."""
        driver = None if self.mechanism is None else self.mechanism.driver
        return bool(self.bearings) or (driver is not None and (driver.table or driver.torque) is not None)

    @property
    def coupled(self) -> bool:
        """Whether bearings act back on the linkage."""
        return any(bearing.coupling == "two-way" for bearing in self.bearings)

    @property
    def bearing(self) -> Bearing | None:
        """The first bearing, None where there is none."""
        return self.bearings[0] if self.bearings else None

    def structure(self) -> object:
        """Nested tuples of everything but numbers, run settings and title: what is compiled (law 1).

        Examples
        --------
        >>> faster = read_scene("scenes/rotor.toml", changes={"shaft": {"speed": "4000 rpm"}})
        >>> faster.structure() == read_scene("scenes/rotor.toml").structure()  # the same code
        True
        """
        return (
            self.name,
            _structure(self.mechanism),
            _structure(self.shaft),
            _structure(self.loads),
            _structure(self.bearings),
            self.outputs,
        )


def _structure(value: Any) -> object:
    if isinstance(value, SceneNumber):
        return (value.path, value.unit, value.description, value.latex)
    if isinstance(value, Catalogue | FitInfo | Lubrication):
        return None
    if is_dataclass(value) and not isinstance(value, type):
        return (type(value).__name__, *((f.name, _structure(getattr(value, f.name))) for f in fields(value)))
    if isinstance(value, tuple):
        return tuple(_structure(v) for v in value)
    return value
