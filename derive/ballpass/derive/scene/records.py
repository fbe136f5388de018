"""What the user asked for: the scene as frozen records in SI units.

In: nothing but values that `read.py` has checked.  Out: one `Scene`.

Every number of a scene is a `Quantity` whose `path` is its place in the TOML file
("mechanism.bodies.crank.mass").  That path is the parameter's name everywhere: in ``--set``, in
``model.simulate(parameters=...)``, in the manifest.  Records hold structure; quantities hold numbers.
`Scene.structure` leaves the numbers out: two scenes with the same structure share one generated model.

Frame: x right, y up, angles counter-clockwise from +x.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any, Literal

from ballpass.derive.scene.bearing_records import Bearing, Catalogue, Lubrication
from ballpass.derive.scene.quantity import Quantity, Vector
from ballpass.derive.scene.toml_lines import LineIndex
from ballpass.runtime.show import html

#: Name of the body that does not move.
FRAME = "frame"


@dataclass(frozen=True, slots=True, kw_only=True)
class NamedPoint:
    """A point of a body in body axes (of the frame: in the frame's axes) [m]."""

    name: str
    position: Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class Body:
    """A moving rigid body.

    `inertia` is about the centre of mass [kg*m^2]; None for a body that does not rotate and whose moment balance
    nobody asked for.
    """

    name: str
    mass: Quantity
    inertia: Quantity | None
    center_of_mass: Vector
    points: tuple[NamedPoint, ...]

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
    kind: Literal["revolute", "prismatic"]
    bodies: tuple[str, str]
    points: tuple[str, str]
    direction: Quantity | None
    branch: str | None

    def point(self, body: str) -> str:
        """Name of the joint's point on one of its bodies."""
        return self.points[self.bodies.index(body)]

    def other(self, body: str) -> str:
        """The body on the other side."""
        return self.bodies[1 - self.bodies.index(body)]


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedOverTime:
    """Rows of a driver's speed: times [s], increasing, and the speeds behind the first, which is `Driver.speed`."""

    time: tuple[Quantity, ...]
    later_speed: tuple[Quantity, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Driver:
    """The joint (revolute, frame to a body) turned from `start_angle` [rad] at t = 0.

    The driver's angle is that of the driven body's x axis from +x.

    Without `table` and `torque` the `speed` [rad/s] is constant, else it is that at t = 0.  A `table` gives it over
    time.  A `torque` is a record of `ballpass.derive.drive` that this layer only carries.  With either a `flywheel`
    [kg*m^2] (None: none) turns with the driven body.
    """

    joint: str
    speed: Quantity
    start_angle: Quantity
    table: SpeedOverTime | None = None
    torque: Any = None
    flywheel: Quantity | None = None

    @property
    def turns_unevenly(self) -> bool:
        """Whether its angle is a state."""
        return self.table is not None or self.torque is not None


@dataclass(frozen=True, slots=True, kw_only=True)
class Force:
    """A force or torque on the linkage, from ``[mechanism.<table>.<name>]``.

    `pathway` says which bodies it acts on and along what, `law` how large it is: records of
    `ballpass.derive.mechanism.forces`, which this layer only carries.
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

    def body(self, name: str) -> Body:
        """Moving body by name."""
        return next(b for b in self.bodies if b.name == name)

    def joint(self, name: str) -> Joint:
        """Joint by name."""
        return next(j for j in self.joints if j.name == name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Shaft:
    """Rotation of the inner ring where no mechanism gives it: constant speed [rad/s]."""

    speed: Quantity


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstantLoad:
    """Constant force on the inner ring [N]."""

    force: Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class HarmonicLoad:
    """``mean + amplitude * cos(2 pi frequency t + phase)`` on the inner ring [N], [Hz], [rad].

    `phase` is one for both components, or that of x and that of y.
    """

    mean: Vector
    amplitude: Vector
    frequency: Quantity
    phase: Quantity | tuple[Quantity, Quantity]


@dataclass(frozen=True, slots=True, kw_only=True)
class TableLoad:
    """Force on the inner ring, linear between rows.

    `over` says what the rows are over: the time [s], constant before the first and behind the last, or the angle of the
    shaft [rad], periodic over a turn.  Rows strictly increasing, `x` and `y` [N]; all of one length of at least two.
    """

    over: Literal["time", "angle"]
    rows: tuple[Quantity, ...]
    x: tuple[Quantity, ...]
    y: tuple[Quantity, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class UnbalanceLoad:
    """Unbalance of the shaft: a mass [kg] at an eccentricity [m], at an angle of the shaft [rad]."""

    mass: Quantity
    eccentricity: Quantity
    angle: Quantity


LoadLaw = ConstantLoad | HarmonicLoad | TableLoad | UnbalanceLoad


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadWindow:
    """From `start` (inclusive) to `end` (exclusive; None: for ever): times [s], or angles of the shaft [rad]."""

    start: Quantity
    end: Quantity | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Load:
    """A force on the inner ring of every bearing, acting within its windows where it has some.

    `name` is empty for the scene's only ``[load]``; ``[loads.<name>]`` have one.
    """

    name: str
    law: LoadLaw
    angle_window: LoadWindow | None = None
    time_window: LoadWindow | None = None

    @property
    def path(self) -> str:
        """Its place in the scene file, which the names of its constants begin with."""
        return f"loads.{self.name}" if self.name else "load"

    @property
    def label(self) -> str:
        """What the names of its inputs and variables begin with."""
        return f"load.{self.name}" if self.name else "load"

    @property
    def turns(self) -> bool:
        """Whether it follows the angle of the shaft."""
        over_angle = isinstance(self.law, TableLoad) and self.law.over == "angle"
        return over_angle or isinstance(self.law, UnbalanceLoad) or self.angle_window is not None


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """How long to run and what to keep.  Exactly one of `cycles` (turns of driver or shaft) and `duration` [s]."""

    cycles: float | None
    duration: float | None
    transient_cycles: float
    samples_per_cycle: int
    method: str
    rtol: float


@dataclass(frozen=True, slots=True, kw_only=True)
class DutyState:
    """A state of a duty cycle: its share of the time [1], and the numbers that differ then, by path [SI]."""

    name: str
    share: float
    parameters: tuple[tuple[str, float], ...]


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Scene:
    """A checked scene.

    `outputs` are the patterns of the file (``"inner.*"``); `derive` resolves them.  `quantities` lists every number
    in the order of the file's schema: the model's parameters.  `duty` is for lives alone.  `lines` says where its keys
    stand, for messages.

    Examples
    --------
    >>> scene = read_scene("scenes/punching_press.toml")
    >>> [body.name for body in scene.mechanism.bodies]
    ['crank', 'rod', 'slider']
    """

    name: str
    title: str
    mechanism: Mechanism | None
    shaft: Shaft | None
    loads: tuple[Load, ...]
    bearings: tuple[Bearing, ...]
    outputs: tuple[str, ...]
    run: Run
    quantities: tuple[Quantity, ...]
    duty: tuple[DutyState, ...] = ()
    lines: LineIndex = field(default=LineIndex(lines={}), repr=False, compare=False)

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
    if isinstance(value, Quantity):
        return (value.path, value.unit, value.description, value.latex)
    if isinstance(value, Catalogue | Lubrication):
        return None
    if is_dataclass(value) and not isinstance(value, type):
        return (type(value).__name__, *((f.name, _structure(getattr(value, f.name))) for f in fields(value)))
    if isinstance(value, tuple):
        return tuple(_structure(v) for v in value)
    return value
