"""Records of the contract: what a model consists of, with the names, units and sizes of everything in it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from ballpass.runtime.contract.errors import ArtefactError
from ballpass.runtime.contract.json_text import from_plain
from ballpass.runtime.show.short import ShortRepr

SCHEMA = 8
FILE_NAME = "manifest.json"

#: Name of the input that holds the slope of a driver's table of speed over time.
DRIVER_ACCELERATION = "driver.acceleration"

#: Input of a cage whose slip changes over time: what its slip is beyond that of the last row.
CAGE_EXCESS_SLIP = "cage.excess_slip"

#: Last key of the file: sha256 of its text without this key.
DIGEST = "digest"

#: Where a generated function lives: ``<library>.c`` and, serialised, ``<library>.casadi``.
MODEL, EQUATIONS, JACOBIANS = "model", "equations", "jacobians"


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterInfo:
    """A run-time number: name (its path in the scene file), SI unit, description, LaTeX symbol, default.

    A value must be > `above`, >= `least`, <= `most` and < `below`; None bounds nothing.
    """

    name: str
    unit: str
    description: str
    latex: str
    default: float
    above: float | None = None
    least: float | None = None
    most: float | None = None
    below: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class UsualInfo:
    """Where numbers usually lie: the sum of the parameters `names`, over the amount of `of` where that is named.

    Usual is a value from `least` to `most`, None bounds nothing.  With `each`, unusual is instead that every one of
    `names` lies above zero and below `least`.  `hint` says what to check.
    """

    names: tuple[str, ...]
    least: float | None = None
    most: float | None = None
    of: str = ""
    each: bool = False
    hint: str


@dataclass(frozen=True, slots=True, kw_only=True)
class VariableInfo:
    """A derived constant, state or output: name, SI unit, description; `size` > 1 for one value per ball.

    `latex` is empty where no symbol exists.
    """

    name: str
    unit: str
    description: str
    latex: str = ""
    size: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class CoordinateInfo:
    """A generalized coordinate: the names of its position and velocity among the states, its kind and unit.

    Coordinates of one `group` share a magnitude, which tolerances are relative to; where one has a `partner`, their
    difference counts.
    """

    name: str
    velocity: str
    kind: Literal["displacement", "angle", "lag"]
    unit: str
    group: str
    partner: str


@dataclass(frozen=True, slots=True, kw_only=True)
class QuantityInfo:
    """Something the model can report and differentiate, whether a run reports it or not.

    `group` is the function of ``jacobians.c`` that computes it; the quantities of a group follow each other
    in the order of `Manifest.quantities`, each with `size` rows.
    """

    name: str
    unit: str
    description: str
    size: int
    group: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TurningInfo:
    """An angle that is known before a run: names of parameters and derived constants.

    It is ``offset`` at t = 0 [rad] and grows at ``rate`` [rad/s]; where that changes over time, ``rate`` is the first.
    It then makes ``turns`` turns in one of the driver, whose speeds are `speeds` in rows at `times`, linear between
    them (one speed without rows: constant).  A cage whose slip changes lags by `lag` [rad], and, from the first row at
    `lag_times` on, by ``rolling`` times the driver's speed times the slope of `lags` [s]; it has the slip of the last
    row outside of these.

    `kind` says what turns: the driver (or shaft), a cage, the balls over a ring or about their axes, or a load; `words`
    names it for people.  A turn falls into `parts` that look alike: the balls of a cage.
    """

    name: str
    kind: Literal["driver", "cage", "pass", "spin", "load"]
    words: str
    offset: str
    rate: str
    parts: int = 1
    turns: str = ""
    times: tuple[str, ...] = ()
    speeds: tuple[str, ...] = ()
    rolling: str = ""
    lag: str = ""
    lag_times: tuple[str, ...] = ()
    lags: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class InputInfo:
    """A quantity the driver holds constant between breakpoints.

    kind ``phase``: the angle of `turning` at the reference time, within `turns` turns [rad], ``angle``: the same with
    all turns, ``rate``: its rate there [rad/s], ``slope``: the slope of that [rad/s^2].
    kind ``gate``: 1 while that angle, modulo a turn over `parts`, lies in one of `windows` (pairs of names), else 0.
    kind ``table``: value at the reference time of the piecewise linear table with the knots `times` and `values`
    (names of parameters); kind ``table_rate``: its slope there.  With a `turning`, `times` are values of its angle
    [rad], the table is periodic over `turns` turns, and its slope is that over the angle.
    kind ``border``: 0.  A window of a driver's angle that is a state is open where its switching function is above it;
    the stepper holds the sides of `windows`, of which there is one, by an infinite border.  So with stops, which have
    no windows.
    """

    name: str
    kind: Literal["phase", "angle", "rate", "slope", "gate", "table", "table_rate", "border"]
    turning: str = ""
    turns: int = 1
    parts: int = 1
    windows: tuple[tuple[str, str], ...] = ()
    times: tuple[str, ...] = ()
    values: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class FunctionInfo:
    """Signature and cost of a generated function: names with sizes (rows), and the number of SX operations.

    `library` is the generated file that holds it: `MODEL`, or `EQUATIONS` or `JACOBIANS`, which are compiled when first
    asked for.
    """

    name: str
    inputs: tuple[tuple[str, int], ...]
    outputs: tuple[tuple[str, int], ...]
    operations: int
    description: str
    library: str = MODEL


@dataclass(frozen=True, slots=True, kw_only=True)
class MarginInfo:
    """Row of ``assembly``: positive while the dyad at `joint` can be assembled [1]."""

    joint: str
    description: str


@dataclass(frozen=True, slots=True, kw_only=True)
class PointInfo:
    """Point (or centre of mass) of a body, pair of rows ``2k, 2k + 1`` of ``geometry`` [m]."""

    body: str
    point: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RunInfo:
    """Run settings of the scene file; exactly one of `cycles` and `duration` [s] is given.

    `at_rest`: rings start at rest under the load of t = 0, for the scene says neither where nor what is transient.
    `stated`: whether the scene gives turns of its run; otherwise they are those of the steady machine.
    `reliability`: share of bearings that reach the lives of a report [1].
    """

    cycles: float | None
    duration: float | None
    transient_cycles: float
    samples_per_cycle: int
    method: str
    rtol: float
    at_rest: bool = False
    stated: bool = True
    reliability: float = 0.9


@dataclass(frozen=True, slots=True, kw_only=True)
class DampingInfo:
    """A damping law's name, and how smooth its force is along deflection and rate; both empty without a force.

    The words are those of `Manifest.smoothness`.
    """

    law: str
    in_deflection: str = ""
    in_rate: str = ""

    @property
    def acts(self) -> bool:
        """Whether there is a damping force."""
        return bool(self.in_rate)

    @property
    def corner_at_rest(self) -> bool:
        """Whether the force has a corner where the deflection's rate passes zero."""
        return self.in_rate == "kinked"


@dataclass(frozen=True, slots=True, kw_only=True)
class CatalogueInfo:
    """Data of a catalogue: see `ballpass.derive.scene.bearing_records.Catalogue`.

    `clearance_least` and `clearance_most` bound the group of clearance [m]; ratings are in N.
    """

    designation: str
    clearance_group: str
    clearance_least: float | None
    clearance_most: float | None
    dynamic_rating: float | None
    static_rating: float | None
    fatigue_limit: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class FitInfo:
    """Fits by class of shaft and housing, None where the scene gives none; the derived equations do not depend on them.

    `inner` and `outer` are the interferences of shaft and bore, and of outer ring and housing, empty without a class;
    `clearance` is that in operation: each least, lowest probable, mean, highest probable, largest [m].
    """

    shaft: str | None
    housing: str | None
    inner: tuple[float, ...]
    outer: tuple[float, ...]
    clearance: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class LubricationInfo:
    """Lubricant film and contamination: see `ballpass.derive.scene.bearing_records.Lubrication`; viscosity in m^2/s."""

    viscosity_ratio: float | None
    viscosity: float | None
    contamination: float | None
    oil_grade: str | None = None
    temperature_celsius: float | None = None
    cleanliness: str | None = None
    oil_code: str | None = None
    filter: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class AlignmentInfo:
    """Tilt of a bearing's rings: see `ballpass.derive.scene.bearing_records.Alignment`; in rad and m."""

    misalignment: float | None
    span: float | None
    shaft_diameter: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class DutyInfo:
    """A state of a duty cycle: its share of the time [1], and the parameters that differ then, (name, value) [SI]."""

    name: str
    share: float
    parameters: tuple[tuple[str, float], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class BearingInfo:
    """Data of a bearing for observables: balls, and the names of its kinematic parameters and constants.

    `name` is empty for the scene's only ``[bearing]``.  Its states and outputs begin with `prefix`, ``""`` or
    ``"<name>."``; its parameters and constants with `path`, ``bearing`` or ``bearings.<name>``.  `inner_body` of its
    `joint` carries the inner ring; `ring_speed` names the mean speed of the inner ring relative to the outer one;
    `element` is the kind of its rolling elements, for which "ball" stands in all other names; `inner_stands` says
    whether the inner ring makes no whole turns; `beside` names the first of several two-way bearings of a joint, whose
    inner rings move alike; `axis` names the two whose inner rings carry the axis of a shaft that tilts in the bearing.
    `two_way` says whether it acts back on its linkage.  `axial_force` [N] and `shoulder_height` [m] are those of the
    scene, for its life.
    """

    name: str
    prefix: str
    path: str
    balls: int
    joint: str
    inner_body: str
    ring_speed: str
    outer_ring: bool
    damping: DampingInfo
    catalogue: CatalogueInfo | None = None
    lubrication: LubricationInfo | None = None
    element: str = "ball"
    inner_stands: bool = False
    beside: str = ""
    axis: tuple[str, ...] = ()
    two_way: bool = False
    alignment: AlignmentInfo | None = None
    fit: FitInfo | None = None
    axial_force: float | None = None
    shoulder_height: float | None = None

    def inner_state(self, name: str) -> str:
        """Full name of a state of the inner ring, as "x": of the first of several two-way bearings of a joint."""
        return f"{f'{self.beside}.' if self.beside else self.prefix}inner.{name}"

    def inner_states(self, name: str, values: Mapping[str, float]) -> dict[str, float]:
        """The states that `inner_state` is a sum of, with their weights: two, where the ring follows from the axis.

        `values` are parameters and derived constants.
        """
        if not self.axis or self.name in self.axis:
            return {self.inner_state(name): 1.0}
        along = values[f"{self.path}.along_axis"]
        first, second = (f"{bearing}.inner.{name}" for bearing in self.axis)
        return {first: 1.0 - along, second: along}


@dataclass(frozen=True, slots=True, kw_only=True)
class MechanismInfo:
    """Data of the linkage for observables: names of the parameters of its driver, joints, points for drawing.

    The components of an applied force are the parameters ``mechanism.forces.<name>.force.x`` and ``.y``, or
    ``.magnitude`` and ``.direction`` (see `force_components`).  Where its input is a table, that holds the amount, and
    the parameter ``mechanism.forces.<name>.direction`` the direction.

    Where a torque drives, `angle` and `rate` name the states that hold the driver's angle and speed, and `speed` and
    `start_angle` the parameters they start from; else they are empty.  No input holds the gate or the table of a force
    then: it follows from the angle.  `turns` lists tables over several turns of it, as ``force.gas``, and how many.
    """

    speed: str
    start_angle: str
    joints: tuple[tuple[str, str, str, str, str, str], ...]  # name, kind, body, point, body, point
    points: tuple[PointInfo, ...]
    margins: tuple[MarginInfo, ...]
    forces: tuple[tuple[str, str, str, str], ...] = ()  # name, body, point, input: gate, table or ""
    angle: str = ""
    rate: str = ""
    driver: str = ""  # the joint that is turned
    repeats: int = 1  # turns of the driver after which all bodies are where they were: gears
    wheels: tuple[tuple[str, str, str, str, float], ...] = ()  # bodies in mesh, on axes; share of the first
    turns: tuple[tuple[str, int], ...] = ()
    range: tuple[str, ...] = ()  # least and largest angle within which runs keep the driver
    swing: str = ""  # of a driver that swings: its amplitude; `speed` and `start_angle` are those of the phase
    springs: tuple[tuple[str, str, str, str, str], ...] = ()  # and stops between points: what outputs begin with, ends


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Manifest(ShortRepr):
    """All data of a model that `runtime` uses.

    Examples
    --------
    >>> model.manifest.scene, len(model.manifest.parameters), model.manifest.run.cycles
    ('punching_press', 41, 4.0)
    >>> [info.unit for info in model.manifest.states[:5]]
    ['m', 'm', 'm', 'm', 'm/s']
    """

    schema: int = SCHEMA
    scene: str
    title: str
    source: str  # digest of the scene file and of the deriving sources; empty where there was no file
    signature: str
    versions: tuple[tuple[str, str], ...]
    parameters: tuple[ParameterInfo, ...]
    constants: tuple[VariableInfo, ...]
    states: tuple[VariableInfo, ...]
    coordinates: tuple[CoordinateInfo, ...]
    initial: tuple[str, ...]  # names of the parameters that hold the initial states
    turnings: tuple[TurningInfo, ...]
    inputs: tuple[InputInfo, ...]
    outputs: tuple[VariableInfo, ...]
    functions: tuple[FunctionInfo, ...]
    smoothness: tuple[tuple[str, str], ...]  # law -> smooth, kinked, discontinuous
    mechanism: MechanismInfo | None
    bearings: tuple[BearingInfo, ...]
    run: RunInfo
    quantities: tuple[QuantityInfo, ...] = ()
    relations: tuple[tuple[str, float, str], ...] = ()  # (name, factor, other): value > factor * value of the other
    usual: tuple[UsualInfo, ...] = ()
    duty: tuple[DutyInfo, ...] = ()
    files: tuple[tuple[str, str], ...] = field(default=())  # file name -> sha256

    @property
    def bearing(self) -> BearingInfo | None:
        """The first bearing, None where the scene has none."""
        return self.bearings[0] if self.bearings else None

    @property
    def turning(self) -> str:
        """What angles of driver or shaft are of.

        Examples
        --------
        >>> model.manifest.turning
        'crank'
        """
        if self.mechanism is None:
            return "shaft"
        return "phase of the swing" if self.mechanism.swing else "crank"

    @property
    def angle_words(self) -> str:
        """The angle of driver or shaft on an axis.

        Examples
        --------
        >>> model.manifest.angle_words
        'crank angle'
        """
        return {"shaft": "angle of the shaft", "crank": "crank angle"}.get(self.turning, self.turning)

    @property
    def integrated(self) -> bool:
        """Whether there are states; without them all follows from the driver's angle."""
        return bool(self.initial)

    @property
    def borders(self) -> tuple[int, ...]:
        """Inputs that are borders: of windows of an angle that is a state, and of stops."""
        return tuple(k for k, item in enumerate(self.inputs) if item.kind == "border")

    @property
    def stops(self) -> tuple[str, ...]:
        """Compressions of all stops, among the quantities."""
        names = (self.inputs[k].name for k in self.borders if not self.inputs[k].windows)
        return tuple(f"{name.removeprefix('border.')}.compression" for name in names)

    @property
    def edges(self) -> tuple[str, ...]:
        """Parameters that are edges of windows of an angle that is a state."""
        return tuple(edge for k in self.borders for window in self.inputs[k].windows for edge in window)

    def function(self, name: str) -> FunctionInfo:
        """Signature of a generated function; KeyError where there is none of that name.

        Examples
        --------
        >>> model.manifest.function("rhs").inputs
        (('t', 1), ('x', 8), ('u', 4), ('p', 41), ('c', 40))
        """
        for info in self.functions:
            if info.name == name:
                return info
        raise KeyError(name)

    def to_json(self) -> str:
        """Deterministic text: the fields in the order of the records, one per line, ending in a newline.

        The last key is the digest of the text without it, so that an edit by hand is detected.

        Examples
        --------
        >>> Manifest.from_json(model.manifest.to_json()) == model.manifest
        True
        """
        document = asdict(self)
        return _text(document | {DIGEST: digest_of(document)})

    @classmethod
    def from_json(cls, text: str, *, source: str = FILE_NAME, verify: bool = True) -> Manifest:
        """Manifest from its JSON text.

        Parameters
        ----------
        text : what `to_json` wrote
        source : name of the text in messages
        verify : refuse a text that was edited after it was written

        Raises
        ------
        ArtefactError
            Not JSON, another schema, edited, or not the records of this version.

        Examples
        --------
        >>> Manifest.from_json(model.manifest.to_json()).scene
        'punching_press'
        """
        again = "Write the folder again with `ballpass derive`"
        try:
            document = dict(json.loads(text))
        except (ValueError, TypeError, RecursionError) as fault:
            raise ArtefactError(f"{source}: no JSON object ({fault}). {again}.") from None
        if document.get("schema") != SCHEMA:
            raise ArtefactError(
                f"{source}: schema {document.get('schema')!r:.40} was given, this version of ballpass reads schema "
                f"{SCHEMA}. {again}."
            )
        digest = document.pop(DIGEST, None)
        if verify and digest != digest_of(document):
            raise ArtefactError(
                f"{source}: the digest in it, {digest!r:.20}, is not that of its content: edited or cut short. "
                f"{again}, or load it with verify=False if the edit is intended."
            )
        try:
            manifest = from_plain(cls, document, "manifest")
        except ValueError as fault:
            raise ArtefactError(f"{source}: {fault}. {again}, and load only folders you trust.") from None
        assert isinstance(manifest, cls)
        libraries = {info.library for info in manifest.functions}
        for name in (manifest.scene, *(name for name, _ in manifest.files), *sorted(libraries)):
            if name in ("", ".", "..") or any(separator in name for separator in "/\\:"):
                raise ArtefactError(
                    f"{source}: the name {name!r:.80} was given. Allowed: names of files in the folder, without "
                    f"separators of paths. {again}, and load only folders you trust."
                )
        return manifest


def force_components(name: str) -> tuple[tuple[str, str], tuple[str, str]]:
    """Names of the parameters that hold an applied force: x and y [N], or magnitude [N] and direction [rad]."""
    path = f"mechanism.forces.{name}.force"
    return (f"{path}.x", f"{path}.y"), (f"{path}.magnitude", f"{path}.direction")


def table_direction(name: str) -> str:
    """Name of the parameter that holds the direction [rad] of an applied force whose amount is a table's."""
    return f"mechanism.forces.{name}.direction"


def digest_of(document: Mapping[str, Any]) -> str:
    """sha256 of a manifest's text without its digest, hexadecimal."""
    return hashlib.sha256(_text(document).encode()).hexdigest()


def _text(document: Mapping[str, Any]) -> str:
    """JSON, one entry a line; not finite numbers are those of an edited file."""
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"
