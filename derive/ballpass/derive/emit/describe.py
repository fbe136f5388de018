"""The manifest of a model, which the runtime reads.

In: a `System` and its `Functions`.  Out: the `Manifest`; the same scene gives the same text.
"""

from __future__ import annotations

from dataclasses import asdict

from ballpass.derive.emit.signature import duty_info, info_of, life_info, plugins_of, signature, versions
from ballpass.derive.lowering.functions import LoweredFunctions, operations
from ballpass.derive.mechanism.forces import drawn_forces, drawn_springs
from ballpass.derive.reading.plausible_ranges import usual_ranges
from ballpass.derive.reading.values import value_bounds, value_relations
from ballpass.derive.scene.records import quantities_of
from ballpass.derive.scene.table import FRAME
from ballpass.derive.system import System
from ballpass.derive.variables import Output
from ballpass.runtime.contract import manifest as mf


def describe(
    system: System, functions: LoweredFunctions, source: str, files: tuple[tuple[str, str], ...]
) -> mf.Manifest:
    """Manifest of a model whose files have these digests; `source` is the digest of the scene file."""
    scene = system.scene
    bounds = value_bounds(scene)
    return mf.Manifest(
        scene=scene.name,
        title=scene.title,
        source=source,
        signature=signature(scene),
        versions=versions(plugins_of(scene)),
        parameters=tuple(
            info_of(mf.ParameterInfo, p, **(asdict(bounds[p.name]) if p.name in bounds else {}))
            for p in system.parameters
        ),
        relations=value_relations(scene),
        usual=usual_ranges(scene),
        constants=functions.constants,
        states=tuple(info_of(mf.VariableInfo, s) for s in system.states),
        coordinates=tuple(info_of(mf.CoordinateInfo, c, velocity=c.velocity.name) for c in system.coordinates),
        initial=system.initial,
        turnings=system.turnings,
        inputs=tuple(
            info_of(mf.InputInfo, i, turning="" if i.turning is None else i.turning.name) for i in system.inputs
        ),
        outputs=tuple(info_of(mf.VariableInfo, o, size=_size(system, o)) for o in system.outputs),
        quantities=tuple(
            info_of(mf.QuantityInfo, o, size=_size(system, o), group=name)
            for name, outputs in functions.groups.items()
            for o in outputs
        ),
        functions=tuple(
            mf.FunctionInfo(
                name=f.name(),
                inputs=tuple((f.name_in(k), f.size1_in(k)) for k in range(f.n_in())),
                outputs=tuple((f.name_out(k), f.size1_out(k)) for k in range(f.n_out())),
                operations=operations(f) if f.is_a("SXFunction") else 0,
                description=words,
                library=library,
            )
            for library, group in (
                (mf.MODEL, functions.functions),
                (mf.EQUATIONS, functions.equations),
                (mf.JACOBIANS, functions.jacobians),
            )
            for f, words in group
        ),
        smoothness=tuple((name, s.value) for name, s in system.smoothness),
        mechanism=_mechanism(system),
        bearings=_bearings(system),
        run=info_of(mf.RunInfo, scene.run),
        duty=duty_info(scene),
        files=files,
    )


def _size(system: System, output: Output) -> int:
    balls = {bearing.names.prefix: bearing.ball.count for bearing in system.bearings}
    return balls[output.balls_of] if output.per_ball else 1


def _mechanism(system: System) -> mf.MechanismInfo | None:
    mechanism, linkage = system.scene.mechanism, system.linkage
    if mechanism is None or linkage is None:
        return None
    drive = linkage.drive
    driven = drive.coordinate
    return mf.MechanismInfo(
        speed=drive.first_speed.name,
        start_angle=drive.first_angle.name,
        range=() if mechanism.driver.range is None else tuple(q.path for q in quantities_of(mechanism.driver.range)),
        swing="" if mechanism.driver.swing is None else mechanism.driver.swing.path,
        joints=tuple((j.name, j.kind, j.bodies[0], j.points[0], j.bodies[1], j.points[1]) for j in mechanism.joints),
        points=tuple(info_of(mf.PointInfo, p) for p in linkage.points),
        margins=tuple(info_of(mf.MarginInfo, m) for m in linkage.margins),
        forces=drawn_forces(mechanism),
        angle=driven.name if driven is not None else "",
        rate=driven.velocity.name if driven is not None else "",
        driver=mechanism.driver.joint,
        turns=tuple((f.label, f.law.turns) for f in mechanism.forces if getattr(f.law, "turns", 1) > 1),
        repeats=linkage.turns,
        wheels=tuple(dyad.circles for dyad in linkage.dyads if dyad.circles is not None),
        springs=drawn_springs(mechanism),
    )


def _bearings(system: System) -> tuple[mf.BearingInfo, ...]:
    scene = system.scene
    speed = scene.mechanism.driver.speed if scene.mechanism else scene.shaft.speed if scene.shaft else None
    constants = {d.symbol.name for d in system.constants}
    laws = [dict(bearing.laws).get("damping") for bearing in system.bearings]
    return tuple(
        mf.BearingInfo(
            name=bearing.name,
            prefix=bearing.prefix,
            path=bearing.path,
            balls=bearing.balls,
            joint=bearing.joint or "",
            inner_body=""
            if system.linkage is None
            else bearing.inner_body or system.linkage.mechanism.joint(bearing.joint or "").other(FRAME),
            ring_speed=f"{bearing.path}.ring_speed"
            if f"{bearing.path}.ring_speed" in constants
            else speed.path
            if speed is not None
            else "",
            outer_ring=bearing.outer is not None,
            beside=bearing.beside,
            axis=tuple(b.name for b in scene.bearings if b.tilts)[:2] if bearing.tilts else (),
            two_way=bearing.coupling == "two-way",
            damping=mf.DampingInfo(
                law=bearing.damping.law,
                **({} if law is None else {"in_deflection": law.in_deflection.value, "in_rate": law.in_rate.value}),
            ),
            **life_info(bearing),
            element=bearing.element,
            inner_stands=bearing.inner_body == FRAME or (scene.shaft is not None and scene.shaft.ring == "outer"),
        )
        for bearing, law in zip(scene.bearings, laws, strict=True)
    )
