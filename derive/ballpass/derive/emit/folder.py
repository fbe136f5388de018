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
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

import casadi as ca

from ballpass.derive.emit.describe import describe, run_info
from ballpass.derive.emit.equations import equations
from ballpass.derive.emit.kernel_headers import ensemble_header, kernels_header, switches_header, tangents_header
from ballpass.derive.emit.methods_header import methods_header
from ballpass.derive.emit.replace_folder import refuse_foreign, replace_folder
from ballpass.derive.lower.functions import Functions, lower
from ballpass.derive.lower.jacobians import DERIVATIVES, Described
from ballpass.derive.mechanism.linkage import check_assembly
from ballpass.derive.scene.read import read_scene
from ballpass.derive.scene.records import Scene
from ballpass.derive.system import System, derive
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
        run=run_info(scene),
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
    for name, text in _headers(system, functions).items():
        (folder / name).write_text(text, encoding="utf-8", newline="\n")
    _pack(folder / "model.casadi", functions.functions)
    # values only: where there is no compiler, the runtime makes their derivatives when they are asked for
    values = [entry for entry in functions.jacobians if not entry[0].name().endswith(DERIVATIVES)]
    _pack(folder / "jacobians.casadi", values)
    (folder / "EQUATIONS.md").write_text(equations(system), encoding="utf-8", newline="\n")
    files = tuple((p.name, _digest(p)) for p in sorted(folder.iterdir()))
    manifest = describe(system, functions, signature=signature(system.scene), versions=_versions(), files=files)
    mf.write(folder, manifest)


def _headers(system: System, functions: Functions) -> dict[str, str]:
    """Texts of the headers for the project's own stepper, by name; none where it does not take the model."""
    kernels = functions.kernels
    if kernels is None:
        return {}
    headers = {
        "kernels.h": kernels_header(system, functions, kernels),
        "methods.h": methods_header(),
        "ensemble_kernels.h": ensemble_header(kernels),
        "tangents.h": tangents_header(kernels),
    }
    switches = switches_header(system, kernels)
    return {**headers, "switches.h": switches} if switches is not None else headers


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
