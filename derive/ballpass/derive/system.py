"""The model as mathematics: from a `Scene` to a `System`.

In: a checked scene.  Out: states, inputs, parameters, ordered definitions, equations of motion in second-order form
(mass matrix and forcing apart), outputs, breakpoints and the smoothness of each law, all SymPy.

Only what the scene names is derived: no mechanism, no linkage equations; a fixed outer ring, no coordinates for it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import sympy as sp

from ballpass.derive.bearing.cage import Cage, cage_between, cage_on_shaft
from ballpass.derive.bearing.equations import (
    BearingModel,
    RingMotion,
    derive_bearing,
    own_coordinates,
    ring_coordinates,
    ring_motion,
)
from ballpass.derive.bearing.equivalent_mass import inner_mass
from ballpass.derive.bearing.ring_load import own_loads, reaction_share
from ballpass.derive.bearing.two_way import couple, play_of
from ballpass.derive.drive import Drive, KnownDrive, drive_of, shaft_drive
from ballpass.derive.events import Event, events_of
from ballpass.derive.mechanism.forces import Forces, derive_forces
from ballpass.derive.mechanism.kinematics import Play
from ballpass.derive.mechanism.linear_forms import Effort, Inertia, LinearForms
from ballpass.derive.mechanism.linkage import NO_PLAY, Linkage, check_assembly, derive_linkage
from ballpass.derive.mechanism.power import inertia_of, loads_of_drive, work_of, work_of_drive
from ballpass.derive.mechanism.reactions import Reactions, derive_reactions
from ballpass.derive.mechanism.swing import STILL, WITH_DRIVER, swing_of
from ballpass.derive.outputs import bearing_outputs, is_asked, mechanism_outputs, select_outputs
from ballpass.derive.requested import (
    balance_outputs,
    bearing_power_outputs,
    contact_outputs,
    motion_outputs,
    power_outputs,
    ring_outputs,
)
from ballpass.derive.scene.bearing_records import Bearing
from ballpass.derive.scene.errors import LinkageError, SceneError
from ballpass.derive.scene.records import FRAME, Mechanism, Scene
from ballpass.derive.terms import Definition, Smoothness, symbol_of
from ballpass.derive.variables import Coordinate, Input, Output, Parameter, State, StateSwitch
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
    def states(self) -> tuple[State, ...]:
        """Positions, then velocities."""
        positions = (
            State(name=c.name, symbol=c.position, unit=c.unit, description=c.words[0], latex=c.latex)
            for c in self.coordinates
        )
        velocities = (
            State(
                name=c.velocity.name,
                symbol=c.velocity,
                unit=c.velocity_unit,
                description=c.words[1],
                latex=rf"\dot {c.latex}",
            )
            for c in self.coordinates
        )
        return (*positions, *velocities)


@typed
def derive(scene: Scene) -> System:
    """Derive the equations of a scene.

    Raises
    ------
    SceneError
        Where the linkage's topology is wrong, its numbers lock it within a turn, or an output is unknown: all faults
        that can be reported together, with their lines; `LinkageError` where all are of the linkage.

    Examples
    --------
    >>> system = derive(read_scene("scenes/rotor.toml"))
    >>> system.forcing.shape  # of the equations of motion
    (2, 1)
    """
    errors: list[SceneError] = []
    mechanism = scene.mechanism
    if mechanism is None:
        system: System | None = _on_shaft(scene, errors)
    else:
        moving = scene.coupled or mechanism.driver.torque is not None
        system = (_moving if moving else _one_way)(scene, mechanism, errors)
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


def _on_shaft(scene: Scene, errors: list[SceneError]) -> System:
    """Bearings on a shaft, under the scene's own load."""
    own = own_loads(scene)
    drive = None if scene.shaft is None else shaft_drive(scene.shaft)
    outer = scene.shaft is not None and scene.shaft.ring == "outer"
    rings = []
    for bearing in scene.bearings:
        share = sp.S.One if bearing.share is None else symbol_of(bearing.share)
        load = (share * own.force[0], share * own.force[1])
        rings.append(_rings(bearing, cage_on_shaft(bearing, drive, outer=outer), load, inner_mass(bearing, None)))
    return _of_rings(scene, rings, errors, inputs=own.inputs, definitions=own.definitions, constants=own.constants)


def _linked(
    scene: Scene, mechanism: Mechanism, drive: Drive, play: Play, errors: list[SceneError]
) -> tuple[Linkage, Forces] | None:
    """The linkage and its loads; None, with the faults noted."""
    linkage, forces = None, None
    with _noted(errors):
        linkage = derive_linkage(mechanism, drive, play)
        with _noted(errors):
            forces = derive_forces(mechanism, linkage, drive)
        with _noted(errors):
            reach: dict[str, float] = {}
            for b in scene.bearings:
                if b.joint is not None:
                    # of several side by side the least play is all that the joint has
                    reach[b.joint] = min(max(b.clearance.value, 0.0) / 2.0, reach.get(b.joint, math.inf))
            check_assembly(linkage, {q.path: q.value for q in scene.quantities}, reach)
        if forces is None:
            derive_reactions(mechanism, linkage, (), _moments(scene, mechanism))  # for its faults
    return None if linkage is None or forces is None else (linkage, forces)


def _one_way(scene: Scene, mechanism: Mechanism, errors: list[SceneError]) -> System | None:
    """An ideal linkage, and the bearings that its reactions load."""
    drive = drive_of(mechanism.driver, alone=not scene.bearings)
    linked, reactions = _linked(scene, mechanism, drive, NO_PLAY, errors), None
    if linked is not None:
        linkage, forces = linked
        with _noted(errors):
            loads = (*forces.loads, *loads_of_drive(linkage))
            reactions = derive_reactions(mechanism, linkage, loads, _moments(scene, mechanism))
    masses = []
    for bearing in scene.bearings:
        with _noted(errors):
            masses.append(inner_mass(bearing, mechanism))
    if linked is None or reactions is None or len(masses) < len(scene.bearings):
        return None
    own, rings = own_loads(scene), []
    for bearing, mass in zip(scene.bearings, masses, strict=True):
        share = reaction_share(scene, bearing, reactions).force
        load = (share[0] + own.force[0], share[1] + own.force[1])
        rings.append(_rings(bearing, _cage(bearing, mechanism, linkage), load, mass))
    inertias, weights = inertia_of(mechanism, linkage)
    return _of_rings(
        scene,
        rings,
        errors,
        drive=drive,
        forces=forces,
        inputs=(*drive.inputs, *forces.inputs, *own.inputs),
        definitions=(
            *(*drive.definitions, *linkage.definitions, *forces.definitions, *reactions.definitions, *own.definitions),
        ),
        constants=(*forces.constants, *own.constants),
        quantities=(*mechanism_outputs(mechanism, linkage, reactions), *forces.outputs),
        requested=_requested(mechanism, linkage, reactions, forces, (*inertias, *work_of_drive(linkage)[1]), weights),
        linkage=linkage,
        reactions=reactions,
    )


def _cage(bearing: Bearing, mechanism: Mechanism, linkage: Linkage) -> Cage:
    """Balls of a bearing at the driver's joint, whose play does not move the linkage."""
    drive = linkage.drive
    if isinstance(drive, KnownDrive) and drive.even:
        return cage_on_shaft(bearing, drive)
    carriers = linkage.pose(linkage.driven), linkage.pose(FRAME)
    return cage_between(bearing, carriers, (WITH_DRIVER, STILL), mechanism.driver, drive)


def _moving(scene: Scene, mechanism: Mechanism, errors: list[SceneError]) -> System | None:
    """A linkage whose joints have the play of its bearings, or that a torque drives: one set of equations of motion."""
    drive = drive_of(mechanism.driver, alone=not scene.bearings)
    rings = [c for bearing in scene.bearings for c in own_coordinates(bearing)]
    positions = tuple(c.position for c in rings)
    # the heaviest last: M is factored in this order, without pivoting
    coordinates = (*rings, *_driven(drive))
    joints = {bearing.name: mechanism.joint(bearing.joint or "") for bearing in scene.bearings}
    play = {joints[b.name].name: play_of(b, joints[b.name], ring_coordinates(b)) for b in scene.bearings}
    linked = _linked(scene, mechanism, drive, play, errors)
    if linked is None:
        return None
    linkage, forces = linked
    start = symbol_of(mechanism.driver.start_angle)
    swings = {FRAME: STILL, linkage.driven: WITH_DRIVER}
    cages, models, coupled = [], [], []
    for bearing in scene.bearings:
        bodies = (bearing.inner_body, joints[bearing.name].other(bearing.inner_body))
        for body in bodies:
            swings.setdefault(body, swing_of(linkage.pose(body), start, positions))
        poses, turned = tuple(map(linkage.pose, bodies)), tuple(swings[body] for body in bodies)
        cage = cage_between(bearing, (poses[0], poses[1]), (turned[0], turned[1]), mechanism.driver, drive)
        cages.append(cage)
        models.append(derive_bearing(bearing, cage))
        coupled.append(couple(bearing, models[-1], mechanism, linkage))
    loads = (*forces.loads, *(load for part in coupled for load in part.loads), *loads_of_drive(linkage))
    reactions = None
    with _noted(errors):
        reactions = derive_reactions(mechanism, linkage, loads, _moments(scene, mechanism))
    if reactions is None:
        return None
    known = (
        *drive.definitions,
        *linkage.definitions,
        *forces.definitions,
        *(d for swing in swings.values() for d in swing.definitions),
        *(d for cage in cages for d in cage.definitions),
    )
    inertias, weights = inertia_of(mechanism, linkage)
    turned_by, turning = work_of_drive(linkage)
    motion = LinearForms(known, coordinates).motion(
        (*inertias, *turning, *(i for part in coupled for i in part.inertias)),
        (*weights, *turned_by, *work_of(forces.loads, linkage), *(e for part in coupled for e in part.efforts)),
    )
    return _system(
        scene,
        models,
        errors,
        inputs=(*drive.inputs, *forces.inputs),
        cages=cages,
        drive=drive,
        forces=forces,
        definitions=(*known, *reactions.definitions, *motion.definitions),
        linear_forms=motion.definitions,
        constants=(
            *forces.constants,
            *(c for swing in swings.values() for c in swing.constants),
            *(c for model in models for c in model.constants),
        ),
        quantities=(
            *(output for model in models for output in bearing_outputs(model, None)),
            *mechanism_outputs(mechanism, linkage, reactions),
            *forces.outputs,
        ),
        requested=(
            *_requested(
                mechanism,
                linkage,
                reactions,
                forces,
                (*inertias, *turning, *(i for part in coupled for i in part.inertias)),
                (*weights, *(e for part in coupled for e in part.weights)),
            ),
            *(
                output
                for bearing, model in zip(scene.bearings, models, strict=True)
                for output in (
                    *ring_outputs(model),
                    *contact_outputs(bearing, model),
                    *bearing_power_outputs(
                        bearing, model, None, linkage.pose(joints[bearing.name].other(bearing.inner_body)).rate
                    ),
                )
            ),
        ),
        mass=motion.mass,
        forcing=motion.forcing,
        linkage=linkage,
        reactions=reactions,
    )


def _requested(
    mechanism: Mechanism,
    linkage: Linkage,
    reactions: Reactions,
    forces: Forces,
    inertias: Sequence[Inertia],
    weights: Sequence[Effort],
) -> tuple[Output, ...]:
    """Outputs of a mechanism on request."""
    powers = power_outputs(linkage, reactions, loads=forces.of_each, inertias=inertias, weights=weights)
    return (*motion_outputs(mechanism, linkage, reactions), *powers, *forces.requested)


def _moments(scene: Scene, mechanism: Mechanism) -> frozenset[str]:
    """Guides on the frame whose moment is asked for."""
    guides = (joint.name for joint in mechanism.joints if joint.kind == "prismatic")
    return frozenset(name for name in guides if is_asked(scene.outputs, f"reaction.{name}.moment"))


def _driven(drive: Drive | None) -> tuple[Coordinate, ...]:
    """The driver's angle where it is a state that its torque moves."""
    return () if drive is None or drive.coordinate is None else (drive.coordinate,)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rings:
    """A bearing loaded one-way, and the motion of its balls."""

    model: BearingModel
    motion: RingMotion
    cage: Cage


def _rings(bearing: Bearing, cage: Cage, load: tuple[sp.Expr, sp.Expr], mass: sp.Expr) -> _Rings:
    model = derive_bearing(bearing, cage)
    return _Rings(model=model, motion=ring_motion(bearing, model, load, mass), cage=cage)


def _of_rings(
    scene: Scene,
    rings: Sequence[_Rings],
    errors: list[SceneError],
    *,
    inputs: tuple[Input, ...],
    definitions: tuple[Definition, ...],
    constants: tuple[Definition, ...] = (),
    quantities: tuple[Output, ...] = (),
    requested: tuple[Output, ...] = (),
    linkage: Linkage | None = None,
    reactions: Reactions | None = None,
    drive: Drive | None = None,
    forces: Forces | None = None,
) -> System:
    """The system of bearings that do not act back on what loads them."""
    return _system(
        scene,
        [one.model for one in rings],
        errors,
        inputs=inputs,
        cages=[one.cage for one in rings],
        definitions=(*definitions, *(d for one in rings for d in one.cage.definitions)),
        constants=(*(c for one in rings for c in (*one.model.constants, *one.motion.constants)), *constants),
        quantities=(*(q for one in rings for q in bearing_outputs(one.model, one.motion.load)), *quantities),
        requested=(
            *requested,
            *(
                output
                for bearing, one in zip(scene.bearings, rings, strict=True)
                for output in (
                    *ring_outputs(one.model),
                    *contact_outputs(bearing, one.model),
                    *bearing_power_outputs(bearing, one.model, one.motion.load),
                )
            ),
        ),
        mass=sp.ImmutableMatrix(sp.diag(*(one.motion.mass for one in rings))),
        forcing=sp.ImmutableMatrix(
            sum(len(one.motion.forcing) for one in rings), 1, [e for one in rings for e in one.motion.forcing]
        ),
        linkage=linkage,
        reactions=reactions,
        drive=drive,
        forces=forces,
    )


def _system(
    scene: Scene,
    bearings: Sequence[BearingModel],
    errors: list[SceneError],
    *,
    cages: Sequence[Cage],
    inputs: tuple[Input, ...],
    definitions: tuple[Definition, ...],
    constants: tuple[Definition, ...],
    quantities: tuple[Output, ...],
    requested: tuple[Output, ...],
    mass: sp.ImmutableMatrix,
    forcing: sp.ImmutableMatrix,
    linkage: Linkage | None,
    reactions: Reactions | None,
    linear_forms: tuple[Definition, ...] = (),
    drive: Drive | None = None,
    forces: Forces | None = None,
) -> System:
    driven, lags = _driven(drive), [cage.lag for cage in cages if cage.lag is not None]
    known = []
    if isinstance(drive, KnownDrive) and drive.passive is not None:
        driven, known = (drive.passive,), [drive.acceleration]
    switches = (() if forces is None else forces.switches) + tuple(s for cage in cages for s in cage.switches)
    inputs = (*inputs, *(i for cage in cages for i in cage.inputs))
    for acceleration in (*known, *(rate for _, rate in lags)):
        mass = sp.ImmutableMatrix(sp.diag(mass, 1))
        forcing = sp.ImmutableMatrix(sp.Matrix.vstack(forcing, sp.Matrix([acceleration])))
    outputs: tuple[Output, ...] = ()
    requested = (*requested, *balance_outputs((*quantities, *requested)))
    with _noted(errors):
        outputs = select_outputs(quantities, requested, scene.outputs)
    listed = {o.name for o in quantities}
    named = tuple(o for o in outputs if o.name not in listed)
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
            *(lag for lag, _ in lags),
        ),
        initial=_initial(scene, driven, [b for b, c in zip(scene.bearings, cages, strict=True) if c.lag is not None]),
        constants=(*constants, *dict.fromkeys(c for o in named for c in o.constants)),
        definitions=definitions,
        mass=mass,
        forcing=forcing,
        linkage=linkage,
        reactions=reactions,
        linear_forms=linear_forms,
        bearings=tuple(bearings),
        quantities=(*quantities, *named),
        outputs=outputs,
        smoothness=(
            *((f"{bearing.names.prefix}{name}", law.anywhere) for bearing in bearings for name, law in bearing.laws),
            *(("driver.torque", drive.smoothness) for _ in _driven(drive) if drive is not None),
            *(() if forces is None else forces.smoothness),
        ),
        events=events_of(inputs, bearings, switches),
        switches=switches,
    )


def _initial(scene: Scene, driven: tuple[Coordinate, ...], lagging: Sequence[Bearing]) -> tuple[str, ...]:
    """Parameters that hold the initial states: positions of all, then velocities."""
    found: list[str] = []
    for which, of_driver in (("position", "start_angle"), ("velocity", "speed")):
        found += [q.path for bearing in scene.bearings for q in getattr(bearing.initial, which)]
        if driven and scene.mechanism is not None:
            found.append(getattr(scene.mechanism.driver, of_driver).path)
        # nothing depends on the integral of a lag
        found += [b.cage.lag.path for b in lagging if b.cage is not None and b.cage.lag is not None]
    return tuple(found)
