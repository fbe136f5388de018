"""The model as mathematics: from a `Scene` to a `System`.

In: a checked scene.  Out: states, inputs, parameters, ordered definitions, equations of motion in second-order form
(mass matrix and forcing apart), outputs, breakpoints and the smoothness of each law, all SymPy.

Only what the scene names is derived: no mechanism, no linkage equations; a fixed outer ring, no coordinates for it.
"""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp

from ballpass.derive.bearing.equations import BearingModel, derive_bearing, equivalent_mass
from ballpass.derive.bearing.load_harmonics import LoadSeries
from ballpass.derive.bearing.ring_load import ring_load
from ballpass.derive.drive import constant_speed
from ballpass.derive.mechanism.forces import Forces, derive_forces
from ballpass.derive.mechanism.linkage import Linkage, derive_linkage
from ballpass.derive.mechanism.reactions import Reactions, derive_reactions
from ballpass.derive.outputs import bearing_outputs, is_asked, mechanism_outputs, select_outputs
from ballpass.derive.scene.errors import Fault, SceneError
from ballpass.derive.scene.records import FRAME, Bearing, EquivalentMass, Mechanism, Scene
from ballpass.derive.terms import Definition, Smoothness, symbol_of
from ballpass.derive.variables import Input, Output, Parameter, State, phase


@dataclass(frozen=True, slots=True, kw_only=True)
class System:
    """The model as mathematics; every stage after this one needs nothing else.

    `constants` are the derived constants (functions of the parameters only).  `definitions` is the ordered rest.
    `mass * d(velocities)/dt = forcing`; both empty without a bearing.  `quantities` is all that the model can report,
    `outputs` what the scene asks for.  `load_series` is there where harmonics take the load's place; its coefficients
    are constants, too.
    """

    scene: Scene
    parameters: tuple[Parameter, ...]
    inputs: tuple[Input, ...]
    states: tuple[State, ...]
    initial: tuple[str, ...]
    constants: tuple[Definition, ...]
    definitions: tuple[Definition, ...]
    mass: sp.ImmutableMatrix
    forcing: sp.ImmutableMatrix
    linkage: Linkage | None
    reactions: Reactions | None
    bearing: BearingModel | None
    quantities: tuple[Output, ...]
    outputs: tuple[Output, ...]
    smoothness: tuple[tuple[str, Smoothness], ...]
    load_series: LoadSeries | None = None

    @property
    def coordinates(self) -> int:
        """Number of generalized coordinates."""
        return len(self.states) // 2


def derive(scene: Scene) -> System:
    """Derive the equations of a scene.

    Raises
    ------
    SceneError
        Where the linkage's topology is wrong or an output is unknown; faults name joint, bodies or output.
    """
    inputs: list[Input] = []
    definitions: list[Definition] = []
    linkage: Linkage | None = None
    reactions: Reactions | None = None
    forces: Forces | None = None
    mechanism = scene.mechanism
    if mechanism is not None:
        drive = constant_speed(mechanism.driver)
        linkage = derive_linkage(mechanism, drive)
        forces = derive_forces(mechanism, linkage, drive)
        moments = frozenset(
            j.name
            for j in mechanism.joints
            if j.kind == "prismatic" and is_asked(scene.outputs, f"reaction.{j.name}.moment")
        )
        reactions = derive_reactions(mechanism, linkage, forces.loads, moments)
        inputs += [drive.phase, *forces.inputs]
        definitions += [*drive.definitions, *linkage.definitions, *forces.definitions, *reactions.definitions]

    bearing: BearingModel | None = None
    constants: tuple[Definition, ...] = ()
    load: tuple[sp.Expr, sp.Expr] = (sp.S.Zero, sp.S.Zero)
    series: LoadSeries | None = None
    if scene.bearing is not None:
        inner_load = ring_load(scene, reactions)
        load, series = inner_load.force, inner_load.series
        inputs += inner_load.inputs
        definitions += inner_load.definitions
        shaft = mechanism.driver.speed if mechanism is not None else scene.shaft.speed if scene.shaft else None
        assert shaft is not None  # the reader requires it
        words = "Angle of ball 1 at the reference time"
        start = scene.bearing.ball_angle.path
        cage = phase("cage", words, r"\psi_0", offset=start, rate="bearing.cage_speed")
        inputs.append(cage)
        bearing = derive_bearing(
            scene.bearing,
            shaft_speed=symbol_of(shaft),
            cage_phase=cage.symbol,
            load=load,
            inner_mass=_inner_mass(scene.bearing, mechanism),
        )
        constants = bearing.constants + inner_load.constants

    quantities = bearing_outputs(bearing, load) if bearing is not None else []
    if mechanism is not None and linkage is not None and reactions is not None and forces is not None:
        quantities += [*mechanism_outputs(mechanism, linkage, reactions), *forces.outputs]
    return System(
        scene=scene,
        parameters=tuple(
            Parameter(
                name=q.path, symbol=symbol_of(q), unit=q.unit, description=q.description, latex=q.latex, default=q.value
            )
            for q in scene.quantities
        ),
        inputs=tuple(inputs),
        states=_states(bearing),
        initial=_initial(scene.bearing),
        constants=constants,
        definitions=tuple(definitions),
        mass=bearing.mass if bearing else sp.ImmutableMatrix(0, 0, []),
        forcing=bearing.forcing if bearing else sp.ImmutableMatrix(0, 1, []),
        linkage=linkage,
        reactions=reactions,
        bearing=bearing,
        quantities=tuple(quantities),
        outputs=select_outputs(quantities, scene.outputs),
        smoothness=bearing.smoothness if bearing else (),
        load_series=series,
    )


def _inner_mass(bearing: Bearing, mechanism: Mechanism | None) -> sp.Expr:
    mass = bearing.inner.mass
    if not isinstance(mass, EquivalentMass):
        return symbol_of(mass)
    assert mechanism is not None  # the reader refuses Eq. (3) without a mechanism
    assert bearing.joint is not None
    joint = mechanism.joint(bearing.joint)
    side = 1 if joint.bodies[0] == FRAME else 0
    crank = mechanism.body(joint.bodies[side])
    far = [
        j.points[j.bodies.index(crank.name)]
        for j in mechanism.joints
        if j.name != joint.name and crank.name in j.bodies
    ]
    if len(far) != 1:
        raise SceneError(
            [
                Fault(
                    key="bearing.inner_ring.equivalent_mass",
                    problem=f"Eq. (3) needs one far joint of the body {crank.name!r}",
                    given=f"{len(far)} further joints",
                    allowed="a crank with exactly two joints",
                    remedy='give the mass itself: [bearing.inner_ring] mass = "0.4 kg"',
                )
            ]
        )
    return equivalent_mass(mass, crank, crank.point(joint.points[side]), crank.point(far[0]))


def _states(bearing: BearingModel | None) -> tuple[State, ...]:
    if bearing is None:
        return ()
    positions = tuple(
        State(name=c.name, symbol=c.position, unit="m", description=f"Position {c.description}", latex=c.latex)
        for c in bearing.coordinates
    )
    velocities = tuple(
        State(
            name=str(c.velocity),
            symbol=c.velocity,
            unit="m/s",
            description=f"Velocity {c.description}",
            latex=rf"\dot {c.latex}",
        )
        for c in bearing.coordinates
    )
    return positions + velocities


def _initial(bearing: Bearing | None) -> tuple[str, ...]:
    if bearing is None:
        return ()
    return tuple(q.path for q in (*bearing.initial.position, *bearing.initial.velocity))
