"""The model as mathematics: from a `Scene` to a `System`.

In: a checked scene.  Out: states, inputs, parameters, ordered definitions, equations of motion in second-order form
(mass matrix and forcing apart), outputs, breakpoints and the smoothness of each law, all SymPy.

Only what the scene names is derived: no mechanism, no linkage equations; a fixed outer ring, no coordinates for it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import sympy as sp

from ballpass.derive.bearing.cage import Cage, cage_of
from ballpass.derive.bearing.equations import (
    BearingModel,
    derive_bearing,
    own_coordinates,
    ring_coordinates,
    ring_motion,
)
from ballpass.derive.bearing.equivalent_mass import inner_mass
from ballpass.derive.bearing.rigid_shaft import RigidShaft, rigid_shaft
from ballpass.derive.bearing.ring_load import RingLoad, lever_of, load_on, load_on_shaft, own_loads
from ballpass.derive.bearing.two_way import Coupled, carriers_of, couple, on_tilting_shaft, play_of, ring
from ballpass.derive.drive import Drive, drive_of
from ballpass.derive.events import Event, events_of
from ballpass.derive.mechanism.forces import NO_FORCES, Forces, derive_forces
from ballpass.derive.mechanism.kinematics import Motion
from ballpass.derive.mechanism.linear_forms import Effort, EquationsOfMotion, Inertia, LinearForms
from ballpass.derive.mechanism.linkage import Linkage, check_assembly, derive_linkage
from ballpass.derive.mechanism.power import inertia_of, loads_of_drive, weights_of, work_of, work_of_drive
from ballpass.derive.mechanism.reactions import Reactions, derive_reactions
from ballpass.derive.mechanism.swing import STILL, Swing, swing_of
from ballpass.derive.mechanism.vectors import Pair
from ballpass.derive.outputs import bearing_outputs, is_asked, mechanism_outputs, select_outputs
from ballpass.derive.requested import (
    balance_outputs,
    bearing_power_outputs,
    contact_outputs,
    motion_outputs,
    power_outputs,
    ring_outputs,
)
from ballpass.derive.scene.errors import LinkageError, SceneError
from ballpass.derive.scene.mechanism_records import Mechanism
from ballpass.derive.scene.records import Scene
from ballpass.derive.terms import Definition, Smoothness, symbol_of
from ballpass.derive.variables import Coordinate, Input, Output, Parameter, StateSwitch, Variable
from ballpass.runtime.contract.arguments import typed
from ballpass.runtime.contract.manifest import TurningInfo


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class System:
    """The model as mathematics; every stage after this one needs nothing else.

    `constants` are the derived constants (functions of the parameters only).  `definitions` is the ordered rest.
    `mass * d(velocities)/dt = forcing`; both empty without a bearing.  `linear_forms` are the definitions of their
    entries, where bearings and linkage are coupled two-way.  `quantities` are all outputs that the model has
    without request, and those on request that the scene names; `outputs` are those that the scene names.

    Examples
    --------
    >>> system = derive(read_scene("scenes/rotor.toml"))
    >>> [state.name for state in system.states]
    ['inner.x', 'inner.y', 'inner.vx', 'inner.vy']
    >>> system.mass.shape  # SymPy
    (2, 2)
    """

    scene: Scene
    parameters: tuple[Parameter, ...]
    inputs: tuple[Input, ...]
    coordinates: tuple[Coordinate, ...]
    initial: tuple[str, ...]
    constants: tuple[Definition, ...]
    definitions: tuple[Definition, ...]
    mass: sp.ImmutableMatrix
    forcing: sp.ImmutableMatrix
    linkage: Linkage | None
    reactions: Reactions | None
    linear_forms: tuple[Definition, ...]
    bearings: tuple[BearingModel, ...]
    quantities: tuple[Output, ...]
    outputs: tuple[Output, ...]
    smoothness: tuple[tuple[str, Smoothness], ...]
    events: tuple[Event, ...]
    switches: tuple[StateSwitch, ...] = ()

    def __repr__(self) -> str:
        states, outputs = (", ".join(item.name for item in items) for items in (self.states, self.outputs))
        return (
            f"System({self.scene.name}: states {states or 'none'}; {len(self.parameters)} parameters, "
            f"{len(self.definitions)} definitions; outputs {outputs or 'none'})"
        )

    def _repr_html_(self) -> str:
        from ballpass.derive.emit.equations import equations_html  # above, by name in pyproject.toml: an object's
        # view is found at the object

        return equations_html(self)

    @property
    def late(self) -> dict[sp.Symbol, sp.Expr]:
        """Definitions that use the sums over the balls or the accelerations, by their symbols."""
        known = {s.symbol for bearing in self.bearings for s in bearing.ball.sums}
        known |= {c.acceleration for c in self.coordinates}
        found: dict[sp.Symbol, sp.Expr] = {}
        for definition in self.definitions:
            if not definition.expression.free_symbols.isdisjoint(known):
                known.add(definition.symbol)
                found[definition.symbol] = definition.expression
        return found

    @property
    def turnings(self) -> tuple[TurningInfo, ...]:
        """Angles that are known before a run, of the inputs."""
        return tuple(dict.fromkeys(i.turning for i in self.inputs if i.turning is not None))

    @property
    def states(self) -> tuple[Variable, ...]:
        """Positions, then velocities."""
        rows = [(c.name, c.position, c.unit, c.words[0], c.latex) for c in self.coordinates]
        rows += [
            (c.velocity.name, c.velocity, c.velocity_unit, c.words[1], rf"\dot {c.latex}") for c in self.coordinates
        ]
        return tuple(Variable(name=n, symbol=s, unit=u, description=d, latex=tex) for n, s, u, d, tex in rows)


@typed
def derive(scene: Scene) -> System:
    """Derive the equations of a scene.

    Raises
    ------
    SceneError
        Where the linkage's topology is wrong, it cannot be assembled at its start, or an output is unknown: all faults
        that can be reported together, with their lines; `LinkageError` where all are of the linkage.

    Examples
    --------
    >>> system = derive(read_scene("scenes/rotor.toml"))
    >>> system.forcing.shape  # of the equations of motion
    (2, 1)
    """
    errors: list[SceneError] = []
    parts = _parts(scene, errors)
    system = None if parts is None else _system(parts, errors)
    if errors:
        kind = LinkageError if all(isinstance(error, LinkageError) for error in errors) else SceneError
        raise kind(scene.lines.place(fault for error in errors for fault in error.faults))
    assert system is not None
    return system


@contextmanager
def _noted(errors: list[SceneError]) -> Iterator[None]:
    """Note an error and continue: stages that do not depend on the failed one are checked as well."""
    try:
        yield
    except SceneError as error:
        errors.append(error)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Parts:
    """The parts of a system, which do not know each other.

    Attributes
    ----------
    linkage, forces, reactions : of a mechanism; None on a shaft
    rings : of each bearing: how inner and outer ring turn
    cages, models, loads : of each bearing; the load is that on an inner ring loaded one-way, else None
    own : what these loads need
    motions : of rings loaded one-way, which moves nothing else
    coupled : what bearings coupled two-way add to the linkage
    axis : of a shaft that tilts in its bearings; None where it does not
    on_axis : what that and its bearings add where they are loaded one-way
    shaft_load : on it, then
    """

    scene: Scene
    drive: Drive
    linkage: Linkage | None
    forces: Forces
    reactions: Reactions | None
    rings: tuple[tuple[Swing, Swing], ...]
    cages: tuple[Cage, ...]
    models: tuple[BearingModel, ...]
    own: RingLoad
    loads: tuple[Pair | None, ...]
    motions: tuple[EquationsOfMotion, ...]
    coupled: tuple[Coupled, ...]
    axis: RigidShaft | None
    on_axis: tuple[Coupled, ...]
    shaft_load: RingLoad | None

    @property
    def swings(self) -> tuple[Swing, ...]:
        """How the bodies turn that carry rings."""
        return tuple(dict.fromkeys(swing for pair in self.rings for swing in pair))

    @property
    def followers(self) -> tuple[tuple[Coordinate, sp.Expr], ...]:
        """Coordinates on which nothing depends, with their accelerations."""
        passive = () if self.drive.passive is None else ((self.drive.passive, self.drive.acceleration),)
        return (*passive, *(cage.lag for cage in self.cages if cage.lag is not None))

    @property
    def definitions(self) -> tuple[Definition, ...]:
        """Ordered, without those that reactions, loads on rings and equations of motion add."""
        return (
            *self.drive.definitions,
            *(() if self.axis is None else self.axis.definitions),
            *(() if self.linkage is None else self.linkage.definitions),
            *self.forces.definitions,
            *(d for swing in self.swings for d in swing.definitions),
            *(d for cage in self.cages for d in cage.definitions),
        )

    @property
    def inertias(self) -> tuple[Inertia, ...]:
        """Of all bodies, and of rings that move on their own in a linkage."""
        of_linkage = () if self.linkage is None else inertia_of(self.linkage)
        return (*of_linkage, *(inertia for part in self.coupled for inertia in part.inertias))

    @property
    def weights(self) -> tuple[Effort, ...]:
        """Work of the weight of these."""
        of_linkage = () if self.linkage is None else weights_of(self.linkage)
        return (*of_linkage, *(weight for part in self.coupled for weight in part.weights))


def _parts(scene: Scene, errors: list[SceneError]) -> _Parts | None:
    """The parts of a scene, each derived after those that it needs; None, with the faults noted."""
    mechanism, bearings, drive = scene.mechanism, scene.bearings, drive_of(scene)
    masses: dict[str, sp.Expr] = {}
    for bearing in bearings:
        if bearing.coupling == "one-way" and not bearing.tilts:
            with _noted(errors):
                masses[bearing.name] = inner_mass(bearing, mechanism)
    linkage, forces, reactions = None, NO_FORCES, None
    axis = rigid_shaft(bearings, scene.shaft, mechanism)
    if mechanism is None:
        turning = Swing(turns=sp.S.One, rate=drive.speed)
        on_shaft = (turning, STILL)
        if scene.shaft is not None and scene.shaft.ring == "outer":
            on_shaft = (STILL, turning)
        elif scene.shaft is not None and scene.shaft.outer_speed is not None:
            outer = symbol_of(scene.shaft.outer_speed)
            on_shaft = (turning, Swing(turns=outer / symbol_of(scene.shaft.speed), rate=outer))
        rings = [on_shaft] * len(bearings)
    else:
        linked = _linked(scene, mechanism, drive, axis, errors)
        if linked is None:
            return None
        linkage, forces = linked
        drive = drive.repeating(linkage.turns)
        carriers = [carriers_of(bearing, linkage) for bearing in bearings]
        swings = {body: swing_of(linkage, body) for pair in carriers for body in pair}
        rings = [(swings[inner], swings[outer]) for inner, outer in carriers]
    cages = [cage_of(bearing, pair, drive) for bearing, pair in zip(bearings, rings, strict=True)]
    models = [derive_bearing(bearing, cage) for bearing, cage in zip(bearings, cages, strict=True)]
    coupled: list[Coupled] = []
    if linkage is not None:
        coupled = [
            couple(bearing, model, linkage)
            for bearing, model in zip(bearings, models, strict=True)
            if bearing.coupling == "two-way"
        ]
        if axis is not None and scene.coupled:
            coupled.append(Coupled(inertias=axis.tilting, efforts=axis.gyroscopic(drive.driven[1])))
        applied = (*forces.loads, *(load for part in coupled for load in part.loads), *loads_of_drive(linkage))
        with _noted(errors):
            reactions = derive_reactions(linkage, applied, _moments(scene))
    alone = [bearing for bearing in bearings if bearing.coupling == "one-way" and not bearing.tilts]
    massless = any(bearing.name not in masses for bearing in alone)
    if massless or (linkage is not None and reactions is None):
        return None
    own = own_loads(scene, drive)
    levers = [lever_of(bearing, bearings) for bearing in bearings]
    own = replace(
        own,
        constants=(
            *own.constants,
            *(d for lever in levers if lever is not None for d in lever.constants),
            *(() if axis is None else axis.constants),
        ),
    )
    loads = [load_on(bearing, own, linkage, reactions, lever) for bearing, lever in zip(bearings, levers, strict=True)]
    shaft_load, on_axis = None, list[Coupled]()
    if axis is not None and not scene.coupled:
        shaft_load = load_on_shaft(own, linkage, reactions)
        on_axis = [on_tilting_shaft(bearing, model) for bearing, model in zip(bearings, models, strict=True)]
        on_axis.append(axis.loaded(shaft_load, rings[0][0].rate))
    return _Parts(
        scene=scene,
        drive=drive,
        linkage=linkage,
        forces=forces,
        reactions=reactions,
        rings=tuple(rings),
        cages=tuple(cages),
        models=tuple(models),
        own=own,
        loads=tuple(loads),
        motions=tuple(
            ring_motion(bearing, model, load, masses[bearing.name])
            for bearing, model, load in zip(bearings, models, loads, strict=True)
            if load is not None
        ),
        coupled=tuple(coupled),
        axis=axis,
        on_axis=tuple(on_axis),
        shaft_load=shaft_load,
    )


def _linked(
    scene: Scene, mechanism: Mechanism, drive: Drive, axis: RigidShaft | None, errors: list[SceneError]
) -> tuple[Linkage, Forces] | None:
    """The linkage and its loads; None, with the faults noted."""
    linkage, forces = None, None
    play: dict[str, Motion] = {}
    for bearing in scene.bearings:
        if bearing.coupling == "two-way":
            joint = mechanism.joint(bearing.joint or "")
            inner = axis.reference if axis is not None and bearing.tilts else ring(ring_coordinates(bearing), 0)
            play[joint.name] = play_of(bearing, joint, inner)
    with _noted(errors):
        slope = axis.slope if axis is not None and scene.coupled else None
        linkage = derive_linkage(mechanism, drive, play, slope)
        with _noted(errors):
            forces = derive_forces(linkage)
        with _noted(errors):
            check_assembly(linkage, {q.path: q.value for q in scene.quantities})
        if forces is None:
            derive_reactions(linkage, (), _moments(scene))  # for its faults
    return None if linkage is None or forces is None else (linkage, forces)


def _moments(scene: Scene) -> frozenset[str]:
    """Guides on the frame whose moment is asked for."""
    joints = () if scene.mechanism is None else scene.mechanism.joints
    guides = (joint.name for joint in joints if joint.kind == "prismatic")
    return frozenset(name for name in guides if is_asked(scene.outputs, f"reaction.{name}.moment"))


def _motion(parts: _Parts) -> EquationsOfMotion:
    """Equations of motion of all that moves with the linkage: rings in its joints, a driver that a torque turns."""
    linkage, drive = parts.linkage, parts.drive
    rings = (c for b in parts.scene.bearings if b.coupling == "two-way" or b.tilts for c in own_coordinates(b))
    # the heaviest last: M is factored in this order, without pivoting
    coordinates = (*rings, *(() if drive.coordinate is None else (drive.coordinate,)))
    efforts: tuple[Effort, ...] = ()
    if linkage is not None:
        efforts = (*weights_of(linkage), *work_of_drive(drive), *work_of(parts.forces.loads, linkage))
    efforts += tuple(effort for part in (*parts.coupled, *parts.on_axis) for effort in part.efforts)
    inertias = (*parts.inertias, *(inertia for part in parts.on_axis for inertia in part.inertias))
    return LinearForms(parts.definitions, coordinates).motion(inertias, efforts)


def _quantities(parts: _Parts) -> list[Output]:
    """Outputs that a model has without request."""
    found = [q for pair in zip(parts.models, parts.loads, strict=True) for q in bearing_outputs(*pair)]
    if parts.linkage is not None and parts.reactions is not None:
        found += mechanism_outputs(parts.linkage, parts.reactions)
    return [*found, *parts.forces.outputs]


def _requested(parts: _Parts) -> list[Output]:
    """Outputs on request, without sums of others."""
    found, linkage, reactions = list[Output](), parts.linkage, parts.reactions
    if linkage is not None and reactions is not None:
        found += motion_outputs(linkage, reactions)
        loads = parts.forces.of_each
        found += power_outputs(linkage, reactions, loads=loads, inertias=parts.inertias, weights=parts.weights)
    found += parts.forces.requested
    if parts.axis is not None:
        found += parts.axis.outputs(parts.shaft_load)
    rows = zip(parts.scene.bearings, parts.models, parts.loads, parts.rings, strict=True)
    for bearing, model, load, (_, housing) in rows:
        found += [*ring_outputs(model), *contact_outputs(bearing, model)]
        found += bearing_power_outputs(bearing, model, load, housing.rate)
    return found


def _system(parts: _Parts, errors: list[SceneError]) -> System:
    scene, drive, forces, models, cages = parts.scene, parts.drive, parts.forces, parts.models, parts.cages
    motion, followers = _motion(parts), parts.followers
    quantities, requested, outputs = _quantities(parts), _requested(parts), tuple[Output, ...]()
    with _noted(errors):
        outputs = select_outputs(quantities, [*requested, *balance_outputs([*quantities, *requested])], scene.outputs)
    listed = {o.name for o in quantities}
    named = tuple(o for o in outputs if o.name not in listed)
    driven = () if drive.coordinate is None else (drive.coordinate,)
    switches = (*forces.switches, *(s for cage in cages for s in cage.switches))
    inputs = (*drive.inputs, *forces.inputs, *parts.own.inputs, *(i for cage in cages for i in cage.inputs))
    forcing = [
        *(e for rings in parts.motions for e in rings.forcing),
        *motion.forcing,
        *(acceleration for _, acceleration in followers),
    ]
    return System(
        scene=scene,
        parameters=tuple(
            Parameter(
                name=q.path, symbol=symbol_of(q), unit=q.unit, description=q.description, latex=q.latex, default=q.value
            )
            for q in scene.quantities
        ),
        inputs=inputs,
        coordinates=(
            *(c for bearing in scene.bearings for c in own_coordinates(bearing)),
            *driven,
            *(coordinate for coordinate, _ in followers),
        ),
        initial=_initial(parts),
        constants=(
            *drive.constants,
            *(c for swing in parts.swings for c in swing.constants),
            *(c for model in models for c in model.constants),
            *(c for motion in parts.motions for c in motion.definitions),
            *(*forces.constants, *parts.own.constants),
            *dict.fromkeys(c for o in named for c in o.constants),
        ),
        definitions=(
            *parts.definitions,
            *(() if parts.reactions is None else parts.reactions.definitions),
            *(*parts.own.definitions, *motion.definitions),
        ),
        mass=sp.ImmutableMatrix(sp.diag(*(rings.mass for rings in parts.motions), motion.mass, *[1] * len(followers))),
        forcing=sp.ImmutableMatrix(len(forcing), 1, forcing),
        linkage=parts.linkage,
        reactions=parts.reactions,
        linear_forms=motion.definitions,
        bearings=models,
        quantities=(*quantities, *named),
        outputs=outputs,
        smoothness=(
            *((f"{model.names.prefix}{name}", law.anywhere) for model in models for name, law in model.laws),
            *(("driver.torque", drive.smoothness) for _ in driven),
            *forces.smoothness,
        ),
        events=events_of(inputs, models, switches),
        switches=switches,
    )


def _initial(parts: _Parts) -> tuple[str, ...]:
    """Parameters that hold the initial states: positions of all, then velocities."""
    bearings, drive, found = parts.scene.bearings, parts.drive, list[str]()
    integrated = drive.coordinate is not None or drive.passive is not None
    for which, of_driver in (("position", drive.first_angle), ("velocity", drive.first_speed)):
        found += [q.path for bearing in bearings for q in getattr(bearing.initial, which)]
        found += [of_driver.name] * integrated
        # nothing depends on the integral of a lag
        found += [
            bearing.cage.lag.path
            for bearing, cage in zip(bearings, parts.cages, strict=True)
            if cage.lag is not None and bearing.cage is not None and bearing.cage.lag is not None
        ]
    return tuple(found)
