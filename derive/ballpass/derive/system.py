"""The model as mathematics: from a `Scene` to a `System`.

In: a checked scene.  Out: states, inputs, parameters, ordered definitions, equations of motion in second-order form
(mass matrix and forcing apart), outputs, breakpoints and the smoothness of each law, all SymPy.

Only what the scene names is derived: no mechanism, no linkage equations; a fixed outer ring, no coordinates for it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import sympy as sp

from ballpass.derive.bearing.equations import BearingModel, derive_bearing
from ballpass.derive.bearing.equivalent_mass import inner_mass
from ballpass.derive.bearing.ring_load import RingLoad, own_load, reaction_share
from ballpass.derive.drive import constant_speed
from ballpass.derive.events import Event, events_of
from ballpass.derive.mechanism.forces import Forces, derive_forces
from ballpass.derive.mechanism.linkage import Linkage, check_assembly, derive_linkage
from ballpass.derive.mechanism.reactions import Reactions, derive_reactions
from ballpass.derive.outputs import bearing_outputs, is_asked, mechanism_outputs, select_outputs
from ballpass.derive.scene.errors import LinkageError, SceneError
from ballpass.derive.scene.records import Bearing, Scene
from ballpass.derive.terms import Definition, Names, Smoothness, symbol_of
from ballpass.derive.variables import Coordinate, Input, Output, Parameter, State, phase


@dataclass(frozen=True, slots=True, kw_only=True)
class System:
    """The model as mathematics; every stage after this one needs nothing else.

    `constants` are the derived constants (functions of the parameters only).  `definitions` is the ordered rest.
    `mass * d(velocities)/dt = forcing`; both empty without a bearing.  `quantities` is all that the model can report,
    `outputs` what the scene asks for.
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
    bearings: tuple[BearingModel, ...]
    quantities: tuple[Output, ...]
    outputs: tuple[Output, ...]
    smoothness: tuple[tuple[str, Smoothness], ...]
    events: tuple[Event, ...]

    @property
    def states(self) -> tuple[State, ...]:
        """Positions, then velocities."""
        positions = (
            State(name=c.name, symbol=c.position, unit=c.unit, description=f"Position {c.description}", latex=c.latex)
            for c in self.coordinates
        )
        velocities = (
            State(
                name=c.velocity.name,
                symbol=c.velocity,
                unit=f"{c.unit}/s",
                description=f"Velocity {c.description}",
                latex=rf"\dot {c.latex}",
            )
            for c in self.coordinates
        )
        return (*positions, *velocities)


def derive(scene: Scene) -> System:
    """Derive the equations of a scene.

    Raises
    ------
    SceneError
        Where the linkage's topology is wrong, its numbers lock it within a turn, or an output is unknown: all faults
        that can be told together, with their lines; `LinkageError` where all are of the linkage.
    """
    errors: list[SceneError] = []
    system = _derive(scene, errors)
    if errors:
        kind = LinkageError if all(isinstance(error, LinkageError) for error in errors) else SceneError
        raise kind(scene.lines.place(fault for error in errors for fault in error.faults))
    assert system is not None
    return system


@contextmanager
def _noted(errors: list[SceneError]) -> Iterator[None]:
    """Note an error and go on: what does not depend on the failed stage is looked at as well."""
    try:
        yield
    except SceneError as error:
        errors.append(error)


def _derive(scene: Scene, errors: list[SceneError]) -> System | None:
    inputs: list[Input] = []
    definitions: list[Definition] = []
    linkage: Linkage | None = None
    reactions: Reactions | None = None
    forces: Forces | None = None
    mechanism = scene.mechanism
    if mechanism is not None:
        drive = constant_speed(mechanism.driver)
        with _noted(errors):
            linkage = derive_linkage(mechanism, drive)
            with _noted(errors):
                forces = derive_forces(mechanism, linkage, drive)
            with _noted(errors):
                check_assembly(linkage, {q.path: q.value for q in scene.quantities})
            moments = frozenset(
                j.name
                for j in mechanism.joints
                if j.kind == "prismatic" and is_asked(scene.outputs, f"reaction.{j.name}.moment")
            )
            reactions = derive_reactions(mechanism, linkage, forces.loads if forces is not None else (), moments)
    masses = []
    for bearing in scene.bearings:
        with _noted(errors):
            masses.append(inner_mass(bearing, mechanism))
    if len(masses) < len(scene.bearings):
        return None
    if mechanism is not None:
        if linkage is None or forces is None or reactions is None:
            return None
        inputs += [drive.phase, *forces.inputs]
        definitions += [*drive.definitions, *linkage.definitions, *forces.definitions, *reactions.definitions]

    own = own_load(scene) if scene.bearings and reactions is None else RingLoad(force=(sp.S.Zero, sp.S.Zero))
    inputs += own.inputs
    definitions += own.definitions
    bearings = []
    for bearing, mass in zip(scene.bearings, masses, strict=True):
        load = reaction_share(scene, bearing, reactions).force if reactions is not None else own.force
        model, cage = _bearing(scene, bearing, load, mass)
        bearings.append(model)
        inputs.append(cage)
    quantities = [output for bearing in bearings for output in bearing_outputs(bearing)]
    if mechanism is not None and linkage is not None and reactions is not None and forces is not None:
        quantities += [*mechanism_outputs(mechanism, linkage, reactions), *forces.outputs]
    outputs: tuple[Output, ...] = ()
    with _noted(errors):
        outputs = select_outputs(quantities, scene.outputs)
    return System(
        scene=scene,
        parameters=tuple(
            Parameter(
                name=q.path, symbol=symbol_of(q), unit=q.unit, description=q.description, latex=q.latex, default=q.value
            )
            for q in scene.quantities
        ),
        inputs=tuple(inputs),
        coordinates=tuple(c for bearing in bearings for c in bearing.coordinates),
        initial=_initial(scene.bearings),
        constants=(*(c for bearing in bearings for c in bearing.constants), *own.constants),
        definitions=tuple(definitions),
        mass=sp.ImmutableMatrix(sp.diag(*(bearing.mass for bearing in bearings))),
        forcing=sp.ImmutableMatrix(sum(len(b.forcing) for b in bearings), 1, [e for b in bearings for e in b.forcing]),
        linkage=linkage,
        reactions=reactions,
        bearings=tuple(bearings),
        quantities=tuple(quantities),
        outputs=outputs,
        smoothness=tuple(
            (f"{bearing.names.prefix}{name}", law.anywhere) for bearing in bearings for name, law in bearing.laws
        ),
        events=events_of(inputs, bearings),
    )


def _bearing(
    scene: Scene, bearing: Bearing, load: tuple[sp.Expr, sp.Expr], mass: sp.Expr
) -> tuple[BearingModel, Input]:
    """A bearing on the driven body or the shaft, and the phase of its cage."""
    shaft = scene.mechanism.driver.speed if scene.mechanism is not None else scene.shaft.speed if scene.shaft else None
    assert shaft is not None  # the reader requires it
    cage = phase(
        f"{bearing.prefix}cage",
        f"Angle of ball 1{f' of {bearing.name}' if bearing.name else ''} at the reference time",
        Names(prefix=bearing.prefix, path=bearing.path).latex(r"\psi_0"),
        offset=bearing.ball_angle.path,
        rate=f"{bearing.path}.cage_speed",
    )
    model = derive_bearing(
        bearing,
        shaft_speed=symbol_of(shaft),
        cage_phase=cage.symbol,
        load=load,
        inner_mass=mass,
    )
    return model, cage


def _initial(bearings: tuple[Bearing, ...]) -> tuple[str, ...]:
    """Parameters that hold the initial states: positions of all, then velocities."""
    return tuple(
        q.path for which in ("position", "velocity") for bearing in bearings for q in getattr(bearing.initial, which)
    )
