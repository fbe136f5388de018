"""The model as mathematics: from a `Scene` to a `System`.

In: a checked scene.  Out: states, inputs, parameters, ordered definitions, equations of motion in second-order form
(mass matrix and forcing apart), outputs, breakpoints and the smoothness of each law, all SymPy.

Only what the scene names is derived: no mechanism, no linkage equations; a fixed outer ring, no coordinates for it.
"""

from __future__ import annotations

from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Literal

import sympy as sp

from raceway.derive.bearing import BearingModel, derive_bearing, equivalent_mass
from raceway.derive.errors import Fault, SceneError
from raceway.derive.linkage import Linkage, derive_linkage
from raceway.derive.load_harmonics import GatedPart, LoadSeries, load_series
from raceway.derive.reactions import Reactions, derive_reactions
from raceway.derive.scene import (
    FRAME,
    AppliedForce,
    AppliedTorque,
    Bearing,
    ConstantLoad,
    EquivalentMass,
    HarmonicLoad,
    Mechanism,
    Quantity,
    Scene,
    TableLoad,
)
from raceway.derive.terms import TIME, Definition, Smoothness, components, symbol_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """A run-time number: its scene path, SI unit, description, default [unit] and symbol."""

    name: str
    symbol: sp.Symbol
    unit: str
    description: str
    latex: str
    default: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Input:
    """Held constant between breakpoints by whoever integrates; `kind` and fields as in `manifest.InputInfo`."""

    name: str
    symbol: sp.Symbol
    kind: Literal["phase", "gate", "table", "table_rate"]
    unit: str
    description: str
    latex: str
    offset: str = ""
    rate: str = ""
    windows: tuple[tuple[str, str], ...] = ()
    times: tuple[str, ...] = ()
    values: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """A state variable: a position [m] or a velocity [m/s]."""

    name: str
    symbol: sp.Symbol
    unit: str
    description: str
    latex: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """Something a run can report; `per_ball` outputs have one value per ball and use the generic ball's symbols."""

    name: str
    expression: sp.Expr
    unit: str
    description: str
    per_ball: bool = False


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


DRIVER_ANGLE = sp.Symbol("driver.angle", real=True)


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
    mechanism = scene.mechanism
    if mechanism is not None:
        inputs += _driver_inputs(mechanism)
        definitions.append(
            Definition(
                symbol=DRIVER_ANGLE,
                expression=inputs[0].symbol + symbol_of(mechanism.driver.speed) * TIME,
                unit="rad",
                description="Angle of the driven body",
                latex=r"\theta_1",
            )
        )
        linkage = derive_linkage(mechanism, DRIVER_ANGLE, symbol_of(mechanism.driver.speed))
        gates = {i.name.removeprefix("gate."): i.symbol for i in inputs if i.kind == "gate"}
        moments = frozenset(
            j.name
            for j in mechanism.joints
            if j.kind == "prismatic" and _asked(scene.outputs, f"reaction.{j.name}.moment")
        )
        reactions = derive_reactions(mechanism, linkage, gates, moments)
        definitions += [*linkage.definitions, *reactions.definitions]

    bearing: BearingModel | None = None
    constants: tuple[Definition, ...] = ()
    load: tuple[sp.Expr, sp.Expr] = (sp.S.Zero, sp.S.Zero)
    series: LoadSeries | None = None
    if scene.bearing is not None:
        inner_load = _inner_load(scene, reactions)
        load, series = inner_load.force, inner_load.series
        inputs += inner_load.inputs
        definitions += inner_load.definitions
        shaft = mechanism.driver.speed if mechanism is not None else scene.shaft.speed if scene.shaft else None
        assert shaft is not None  # the reader requires it
        cage = Input(
            name="phase.cage",
            symbol=sp.Symbol("phase.cage", real=True),
            kind="phase",
            unit="rad",
            description="Angle of ball 1 at the reference time",
            latex=r"\psi_0",
            offset=scene.bearing.ball_angle.path,
            rate="bearing.cage_speed",
        )
        inputs.append(cage)
        bearing = derive_bearing(
            scene.bearing,
            shaft_speed=symbol_of(shaft),
            cage_phase=cage.symbol,
            load=load,
            inner_mass=_inner_mass(scene.bearing, mechanism),
        )
        constants = bearing.constants + inner_load.constants

    quantities = _available(scene, linkage, reactions, bearing, load)
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
        outputs=_select(quantities, scene.outputs),
        smoothness=bearing.smoothness if bearing else (),
        load_series=series,
    )


def _driver_inputs(mechanism: Mechanism) -> list[Input]:
    """Phase of the driver, and a gate for each load that acts within windows only."""
    driver = mechanism.driver
    out = [
        Input(
            name="phase.driver",
            symbol=sp.Symbol("phase.driver", real=True),
            kind="phase",
            unit="rad",
            description="Angle of the driven body at the reference time",
            latex=r"\theta_{1,0}",
            offset=driver.start_angle.path,
            rate=driver.speed.path,
        )
    ]
    loads: tuple[AppliedForce | AppliedTorque, ...] = (*mechanism.forces, *mechanism.torques)
    for load in loads:
        if load.windows:
            out.append(
                Input(
                    name=f"gate.{load.name}",
                    symbol=sp.Symbol(f"gate.{load.name}", real=True),
                    kind="gate",
                    unit="1",
                    description=f"1 while {load.name} acts, else 0",
                    latex=rf"g_{{\mathrm{{{load.name}}}}}",
                    offset=driver.start_angle.path,
                    rate=driver.speed.path,
                    windows=tuple((w.start.path, w.end.path) for w in load.windows),
                )
            )
    return out


@dataclass(frozen=True, slots=True, kw_only=True)
class _InnerLoad:
    """Force on the inner ring [N] and what it is made of."""

    force: tuple[sp.Expr, sp.Expr]
    inputs: tuple[Input, ...] = ()
    constants: tuple[Definition, ...] = ()
    definitions: tuple[Definition, ...] = ()
    series: LoadSeries | None = None


def _inner_load(scene: Scene, reactions: Reactions | None) -> _InnerLoad:
    """Share of the joint's reaction, or the scene's own load."""
    bearing, mechanism, load = scene.bearing, scene.mechanism, scene.load
    assert bearing is not None
    if reactions is not None:
        assert mechanism is not None
        assert bearing.joint is not None
        assert bearing.share is not None
        # what presses the inner ring into the bearing is the force of the driven body on the frame
        fx, fy = reactions.joint_force[bearing.joint]
        share = symbol_of(bearing.share)
        sign = 1 if mechanism.joint(bearing.joint).bodies[0] == FRAME else -1
        force = (sign * share * fx, sign * share * fy)
        if bearing.load_harmonics is None:
            return _InnerLoad(force=force)
        series = load_series(bearing.load_harmonics, DRIVER_ANGLE, force, _gated_parts(mechanism))
        return _InnerLoad(force=series.force, definitions=series.waves, series=series)
    assert load is not None  # the reader requires a load where there is no mechanism
    if isinstance(load, ConstantLoad):
        return _InnerLoad(force=components(load.force))
    if isinstance(load, HarmonicLoad):
        return _harmonic(load)
    return _table(load)


def _gated_parts(mechanism: Mechanism) -> tuple[GatedPart, ...]:
    loads: tuple[AppliedForce | AppliedTorque, ...] = (*mechanism.forces, *mechanism.torques)
    return tuple(
        GatedPart(
            gate=sp.Symbol(f"gate.{load.name}", real=True),
            windows=tuple((symbol_of(w.start), symbol_of(w.end)) for w in load.windows),
        )
        for load in loads
        if load.windows
    )


def _harmonic(load: HarmonicLoad) -> _InnerLoad:
    phase = Input(
        name="phase.load",
        symbol=sp.Symbol("phase.load", real=True),
        kind="phase",
        unit="rad",
        description="Angle of the harmonic load at the reference time",
        latex=r"\varphi_0",
        offset=load.phase.path,
        rate="load.angular_frequency",
    )
    angular = Definition(
        symbol=sp.Symbol("load.angular_frequency", real=True),
        expression=2 * sp.pi * symbol_of(load.frequency),
        unit="rad/s",
        description="Angular frequency of the load",
        latex=r"\Omega",
    )
    wave = Definition(
        symbol=sp.Symbol("load.wave", real=True),
        expression=sp.cos(phase.symbol + angular.symbol * TIME),
        unit="1",
        description="Harmonic of the load",
        latex="w",
    )
    mean, amplitude = components(load.mean), components(load.amplitude)
    return _InnerLoad(
        force=(mean[0] + amplitude[0] * wave.symbol, mean[1] + amplitude[1] * wave.symbol),
        inputs=(phase,),
        constants=(angular,),
        definitions=(wave,),
    )


def _table(load: TableLoad) -> _InnerLoad:
    inputs: list[Input] = []
    times = tuple(q.path for q in load.time)

    def column(axis: str, values: tuple[Quantity, ...]) -> sp.Expr:
        names = tuple(q.path for q in values)
        value = Input(
            name=f"load.{axis}",
            symbol=sp.Symbol(f"input.load.{axis}", real=True),
            kind="table",
            unit="N",
            description=f"Value of the load table along {axis} at the reference time",
            latex=rf"F_{{0,{axis}}}",
            times=times,
            values=names,
        )
        slope = Input(
            name=f"load.{axis}_rate",
            symbol=sp.Symbol(f"input.load.{axis}_rate", real=True),
            kind="table_rate",
            unit="N/s",
            description=f"Slope of the load table along {axis} at the reference time",
            latex=rf"\dot F_{{0,{axis}}}",
            times=times,
            values=names,
        )
        inputs.extend((value, slope))
        return value.symbol + slope.symbol * TIME

    force = (column("x", load.x), column("y", load.y))
    return _InnerLoad(force=force, inputs=tuple(inputs))


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


def _available(
    scene: Scene,
    linkage: Linkage | None,
    reactions: Reactions | None,
    bearing: BearingModel | None,
    load: tuple[sp.Expr, sp.Expr],
) -> list[Output]:
    """Every output the scene's model could report, in the order they are listed."""
    out: list[Output] = []
    if bearing is not None:
        for c in bearing.coordinates:
            out.append(Output(name=c.name, expression=c.position, unit="m", description=f"Position {c.description}"))
        for c in bearing.coordinates:
            out.append(
                Output(name=str(c.velocity), expression=c.velocity, unit="m/s", description=f"Velocity {c.description}")
            )
        ball = bearing.ball
        per_ball = [
            ("ball.deflection", ball.deflection, "m", "Deflection of each ball, Eq. (6)"),
            ("ball.elastic_force", ball.elastic_force, "N", "Elastic force of each ball, Eq. (4)"),
        ]
        if ball.damping_force is not None:
            per_ball.append(("ball.damping_force", ball.damping_force, "N", "Damping force of each ball, Eq. (10)"))
        per_ball.append(("ball.force", ball.force, "N", "Elastic and damping force of each ball"))
        out += [Output(name=n, expression=e, unit=u, description=d, per_ball=True) for n, e, u, d in per_ball]
        for axis, total in zip("xy", ball.sums, strict=True):
            out.append(
                Output(
                    name=f"ring_force.{axis}",
                    expression=total.symbol,
                    unit="N",
                    description=f"Force of the inner ring on the balls along {axis}, Eqs. (8) and (9)",
                )
            )
        for axis, force in zip("xy", load, strict=True):
            out.append(
                Output(
                    name=f"load.{axis}",
                    expression=force,
                    unit="N",
                    description=f"External load on the inner ring along {axis}",
                )
            )
    if scene.mechanism is not None and reactions is not None and linkage is not None:
        for joint in scene.mechanism.joints:
            first, second = joint.bodies
            for axis, force in zip("xy", reactions.joint_force[joint.name], strict=True):
                out.append(
                    Output(
                        name=f"reaction.{joint.name}.{axis}",
                        expression=force,
                        unit="N",
                        description=f"Force of the {second} on the {first} at {joint.name} along {axis}",
                    )
                )
            if joint.name in reactions.joint_moment:
                out.append(
                    Output(
                        name=f"reaction.{joint.name}.moment",
                        expression=reactions.joint_moment[joint.name],
                        unit="N*m",
                        description=f"Moment of the {second} on the {first} at {joint.name}",
                    )
                )
        out.append(
            Output(
                name="drive_torque",
                expression=reactions.drive_torque,
                unit="N*m",
                description="Torque of the drive on the driven body, counter-clockwise",
            )
        )
        out.append(
            Output(
                name="drive_angle",
                expression=DRIVER_ANGLE,
                unit="rad",
                description="Angle of the driven body, within the turn",
            )
        )
        for body in scene.mechanism.bodies:
            pose = linkage.poses[body.name]
            out.append(
                Output(
                    name=f"body.{body.name}.angle",
                    expression=sp.atan2(pose.sin, pose.cos),
                    unit="rad",
                    description=f"Angle of the x axis of the {body.name} from +x",
                )
            )
    return out


def _asked(patterns: tuple[str, ...], name: str) -> bool:
    return any(fnmatchcase(name, p) for p in patterns)


def _select(available: list[Output], patterns: tuple[str, ...]) -> tuple[Output, ...]:
    names = [o.name for o in available]
    faults = [
        Fault(
            key="run.outputs",
            problem="no output of this scene matches",
            given=repr(pattern),
            allowed=", ".join(names),
            remedy="correct or remove the pattern",
        )
        for pattern in patterns
        if not any(fnmatchcase(name, pattern) for name in names)
    ]
    if faults:
        raise SceneError(faults)
    return tuple(o for o in available if _asked(patterns, o.name))
