"""The scene as a whole, its run and its duty cycle, as frozen records in SI units.

In: nothing but values that `read.py` has checked.  Out: one `Scene`.

Every number of a scene is a `SceneNumber` whose `path` is its place in the TOML file
("mechanism.bodies.crank.mass").  That path is the parameter's name everywhere: in ``--set``, in
``model.simulate(parameters=...)``, in the manifest.  Records hold structure; quantities hold numbers.
`Scene.structure` leaves the numbers out: two scenes with the same structure share one generated model.

Frame: x right, y up, angles counter-clockwise from +x.
"""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any, ClassVar

from ballpass.derive.scene.bearing_records import Bearing
from ballpass.derive.scene.keys import ChoiceKey, NamesKey, TextKey, WholeKey
from ballpass.derive.scene.mechanism_records import Mechanism
from ballpass.derive.scene.quantity import Bounds, SceneNumber
from ballpass.derive.scene.rating_records import Catalogue, Lubrication
from ballpass.derive.scene.read_keys import Either, not_negative, positive, quantity
from ballpass.derive.scene.shaft_records import Load, Shaft
from ballpass.derive.scene.toml_lines import LineIndex
from ballpass.runtime.contract.defaults import TOLERANCES
from ballpass.runtime.contract.manifest import FitInfo
from ballpass.runtime.contract.method_registry import STEPPERS
from ballpass.runtime.show import html


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
