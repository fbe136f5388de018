"""From functions to files: the generated folder of a scene.

In: a scene file.  Out: ``generated/<scene>/`` with

model.c, model.h   every function as C99
kernels.h          the model cut into inline functions for the project's own stepper
tangents.h         derivatives of these along several directions at once, for sensitivities
ensemble_kernels.h the kernels for several members of an ensemble at once, and what reductions need
methods.h          the stepper's methods
switches.h         where the laws have kinks, for runs whose steps end there; no such file where they have none
model.casadi       the same functions serialised, for machines without a compiler
jacobians.c, .h    all quantities, their derivatives and those of the right-hand side, compiled when first asked for
jacobians.casadi   the quantities serialised
EQUATIONS.md       the derivation for people
manifest.json      the contract with the runtime, written last

The same scene gives the same bytes on every run.  `Manifest.signature` covers the scene's structure, the deriving
sources and the
versions of CasADi and SymPy: numbers are not in it, so a changed number rewrites the manifest's defaults and
nothing else.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path

import casadi as ca

from ballpass.derive.emit.ensemble_header import ensemble_header
from ballpass.derive.emit.equations import equations
from ballpass.derive.emit.replace_folder import refuse_foreign, replace_folder
from ballpass.derive.emit.stepper_headers import kernels_header, methods_header, tangents_header
from ballpass.derive.lower.functions import Functions, lower, operations
from ballpass.derive.lower.jacobians import DERIVATIVES, Described
from ballpass.derive.lower.switch_kernels import switches_header
from ballpass.derive.mechanism.forces import drawn_forces
from ballpass.derive.mechanism.linkage import check_assembly
from ballpass.derive.scene.read import read_scene
from ballpass.derive.scene.records import Scene
from ballpass.derive.scene.values import value_bounds, value_relations
from ballpass.derive.system import System, derive
from ballpass.derive.variables import Output
from ballpass.runtime import contract as mf
from ballpass.runtime.contract.errors import ArtefactError


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """Result of comparing a folder with what its scene derives today; `stale` names the files that differ."""

    folder: Path
    stale: tuple[str, ...]


def generate(
    scene: str | Path | Scene,
    out: str | Path | None = None,
    *,
    force: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Path:
    """Write the generated folder of a scene unless it is there and fresh.

    Parameters
    ----------
    scene : path of a scene file, or a scene
    out : folder to write; ``./generated/<scene name>`` by default
    force : derive again even where nothing changed
    progress : called with the name of each stage

    Returns
    -------
    The folder.

    Raises
    ------
    SceneError
        The scene is wrong.  Nothing is written then.
    RequestError
        The folder holds files, but none that this function wrote.  Nothing is written then.
    """
    say = progress or (lambda _: None)
    read = scene if isinstance(scene, Scene) else read_scene(scene)
    folder = Path(out) if out is not None else Path("generated") / read.name
    present = None if force else _fresh(folder, read)
    if present is not None:
        _refresh(folder, present, read)
        return folder
    refuse_foreign(folder)
    system, functions = _derive_and_lower(read, say)
    say("emit")
    replace_folder(folder, read.name, lambda made: _write(made, system, functions))
    return folder


def check(scene: str | Path | Scene, out: str | Path | None = None) -> Check:
    """Derive a scene afresh and compare with the folder, byte for byte; writes nothing to it."""
    read = scene if isinstance(scene, Scene) else read_scene(scene)
    folder = Path(out) if out is not None else Path("generated") / read.name
    system, functions = _derive_and_lower(read, lambda _: None)
    with tempfile.TemporaryDirectory() as made:
        _write(Path(made), system, functions)
        names = sorted({p.name for p in Path(made).iterdir()} | _files(folder))
        stale = tuple(n for n in names if _digest(Path(made) / n) != _digest(folder / n))
    return Check(folder=folder, stale=stale)


def _derive_and_lower(scene: Scene, say: Callable[[str], None]) -> tuple[System, Functions]:
    say("derive")
    system = derive(scene)
    if system.linkage is not None:
        check_assembly(system.linkage, {q.path: q.value for q in scene.quantities})
    say("lower")
    return system, lower(system)


def signature(scene: Scene) -> str:
    """Digest of everything but numbers that decides what is generated."""
    text = repr((mf.SCHEMA, scene.structure(), _sources(), _versions()))
    return hashlib.sha256(text.encode()).hexdigest()


def _sources() -> str:
    """Digest of the deriving modules: a changed derivation makes every artefact stale."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.parent.rglob("*.py")):
        digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def _versions() -> tuple[tuple[str, str], ...]:
    return tuple((name, version(name)) for name in ("ballpass", "casadi", "sympy"))


def _digest(path: Path) -> str:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except (FileNotFoundError, NotADirectoryError, IsADirectoryError):
        return ""


def _files(folder: Path) -> set[str]:
    return {p.name for p in folder.iterdir()} if folder.is_dir() else set()


def _fresh(folder: Path, scene: Scene) -> mf.Manifest | None:
    """The folder's manifest where signature and file digests agree with the scene, else None: then it is derived
    anew."""
    try:
        present = mf.read_manifest(folder)
        mf.check_files(folder, present)
    except ArtefactError:
        return None
    return present if present.signature == signature(scene) else None


def _refresh(folder: Path, present: mf.Manifest, scene: Scene) -> None:
    """Bring the numbers of a fresh folder up to the scene's."""
    values = {q.path: q.value for q in scene.quantities}
    updated = replace(
        present,
        title=scene.title,
        parameters=tuple(replace(p, default=values[p.name]) for p in present.parameters),
        run=_run(scene),
    )
    if updated == present:
        return
    linkage = derive(scene).linkage if scene.mechanism is not None else None
    if linkage is not None:
        check_assembly(linkage, values)
    mf.write(folder, updated)


def _write(folder: Path, system: System, functions: Functions) -> None:
    _write_c(folder, "model", functions.functions)
    _write_c(folder, "jacobians", functions.jacobians)
    if functions.kernels is not None:
        header = kernels_header(system, functions, functions.kernels)
        (folder / "kernels.h").write_text(header, encoding="utf-8", newline="\n")
        (folder / "methods.h").write_text(methods_header(), encoding="utf-8", newline="\n")
        lanes = ensemble_header(functions, functions.kernels)
        (folder / "ensemble_kernels.h").write_text(lanes, encoding="utf-8", newline="\n")
        tangents = tangents_header(functions.kernels)
        (folder / "tangents.h").write_text(tangents, encoding="utf-8", newline="\n")
    if functions.switches is not None:
        (folder / "switches.h").write_text(switches_header(functions.switches), encoding="utf-8", newline="\n")
    _pack(folder / "model.casadi", functions.functions)
    # values only: where there is no compiler, the runtime makes their derivatives when they are asked for
    values = [entry for entry in functions.jacobians if not entry[0].name().endswith(DERIVATIVES)]
    _pack(folder / "jacobians.casadi", values)
    (folder / "EQUATIONS.md").write_text(equations(system), encoding="utf-8", newline="\n")
    files = tuple((p.name, _digest(p)) for p in sorted(folder.iterdir()))
    mf.write(folder, _manifest(system, functions, files))


def _pack(path: Path, functions: Sequence[Described]) -> None:
    pack = ca.FileSerializer(str(path))
    pack.pack(len(functions))
    for function, _ in functions:
        pack.pack(function)
    del pack  # closes the file


def _write_c(folder: Path, name: str, functions: Sequence[Described]) -> None:
    generator = ca.CodeGenerator(f"{name}.c", {"with_header": True})
    for function, _ in functions:
        generator.add(function)
    generator.generate(f"{folder}{os.sep}")


def _run(scene: Scene) -> mf.RunInfo:
    run = scene.run
    return mf.RunInfo(
        cycles=run.cycles,
        duration=run.duration,
        transient_cycles=run.transient_cycles,
        samples_per_cycle=run.samples_per_cycle,
        method=run.method,
        rtol=run.rtol,
    )


def _manifest(system: System, functions: Functions, files: tuple[tuple[str, str], ...]) -> mf.Manifest:
    scene = system.scene
    bounds = value_bounds(scene)
    return mf.Manifest(
        scene=scene.name,
        title=scene.title,
        signature=signature(scene),
        versions=_versions(),
        parameters=tuple(
            mf.ParameterInfo(
                name=p.name,
                unit=p.unit,
                description=p.description,
                latex=p.latex,
                default=p.default,
                **(asdict(bounds[p.name]) if p.name in bounds else {}),
            )
            for p in system.parameters
        ),
        relations=value_relations(scene),
        constants=tuple(
            mf.VariableInfo(name=c.name, unit=c.unit, description=c.description, latex=c.latex)
            for c in functions.constants
        ),
        states=tuple(
            mf.VariableInfo(name=s.name, unit=s.unit, description=s.description, latex=s.latex) for s in system.states
        ),
        initial=system.initial,
        inputs=tuple(
            mf.InputInfo(
                name=i.name,
                kind=i.kind,
                offset=i.offset,
                rate=i.rate,
                windows=i.windows,
                times=i.times,
                values=i.values,
            )
            for i in system.inputs
        ),
        outputs=tuple(
            mf.VariableInfo(
                name=o.name,
                unit=o.unit,
                description=o.description,
                size=_size(system, o),
            )
            for o in system.outputs
        ),
        quantities=tuple(
            mf.QuantityInfo(name=o.name, unit=o.unit, description=o.description, size=_size(system, o), group=g.name)
            for g in functions.groups
            for o in g.outputs
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
            for library, group in ((mf.MODEL, functions.functions), (mf.JACOBIANS, functions.jacobians))
            for f, words in group
        ),
        smoothness=tuple((name, s.value) for name, s in system.smoothness),
        mechanism=_mechanism(system),
        bearings=_bearings(system),
        run=_run(scene),
        files=files,
    )


def _size(system: System, output: Output) -> int:
    return system.bearing.ball.count if output.per_ball and system.bearing else 1


def _mechanism(system: System) -> mf.MechanismInfo | None:
    mechanism, linkage = system.scene.mechanism, system.linkage
    if mechanism is None or linkage is None:
        return None
    return mf.MechanismInfo(
        driver_joint=mechanism.driver.joint,
        speed=mechanism.driver.speed.path,
        start_angle=mechanism.driver.start_angle.path,
        joints=tuple((j.name, j.kind, j.bodies[0], j.points[0], j.bodies[1], j.points[1]) for j in mechanism.joints),
        points=tuple(mf.PointInfo(body=p.body, point=p.point) for p in linkage.points),
        margins=tuple(mf.MarginInfo(joint=m.joint, description=m.description) for m in linkage.margins),
        forces=drawn_forces(mechanism),
    )


def _bearings(system: System) -> tuple[mf.BearingInfo, ...]:
    bearing, scene = system.scene.bearing, system.scene
    if bearing is None:
        return ()
    speed = scene.mechanism.driver.speed if scene.mechanism else scene.shaft.speed if scene.shaft else None
    assert speed is not None
    return (
        mf.BearingInfo(
            name="",
            prefix="",
            path="bearing",
            balls=bearing.balls,
            joint=bearing.joint or "",
            shaft_speed=speed.path,
            outer_ring=bearing.outer is not None,
            damping_law=bearing.damping.law,
        ),
    )
