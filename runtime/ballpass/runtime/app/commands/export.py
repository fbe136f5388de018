"""``ballpass export``: a scene as a program in C or as an FMU.

With ``--fmu --input mechanism.driver.speed`` a scene whose driver turns at constant speed is derived with the speed as
a table over time, whose rows are equal.  There the driver's angle and speed are states, so that the speed may change.
A scene without states is derived so in both formats: there is nothing to integrate in it as it is.
"""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer

from ballpass.runtime.app.commands import options
from ballpass.runtime.app.commands.load_scene import generated_folder, read_asked
from ballpass.runtime.app.commands.messages import note, warn_of_scene
from ballpass.runtime.app.commands.shared import check_folder, command, name_of, read_own, speed_over_time
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.extras import is_installed
from ballpass.runtime.contract.folder import read_artefact
from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.contract.options import Option
from ballpass.runtime.export.model_description import SPEED
from ballpass.runtime.export.targets import TARGETS


def export(
    scene: options.SceneOrFolder,
    c: Annotated[bool, Option(words="A C99 program with the model, the stepper, a Makefile and a main.")] = False,
    fmu: Annotated[
        bool,
        Option(words="An FMU for co-simulation, compiled for this machine and, with ziglang, for others."),
    ] = False,
    fmi: Annotated[
        int | None, Option(shown="VERSION", words="Write an FMU of this version of the FMI, 2 or 3; 3 if not given.")
    ] = None,
    inputs: Annotated[
        Sequence[str] | None,
        Option(
            shown="NAME",
            words="A load, force, torque or speed that is an input of the FMU, by its parameter name or the beginning "
            "of it. May be repeated.",
            flags=("--input",),
        ),
    ] = None,
    target: Annotated[
        Sequence[str] | None,
        Option(
            shown="SYSTEM",
            words="Compile for this system too: `linux`, `windows`, `macos`, or one kind of machines of it such as "
            "`linux-arm64`. Needs ziglang, the extra `compiler`. May be repeated. An FMU is for all if not given.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        Option(shown="PATH", words="Folder or FMU to write; `export/<scene>`, `export/<scene>.fmu` if not given."),
    ] = None,
) -> None:
    """Write a scene as a program in C or as an FMU, which run without Python."""
    with command(scene) as stages:
        fmu = fmu or fmi is not None
        if c == fmu:
            given = "both formats were" if c else "no format was"
            raise RequestError(f"export: {given} given. Allowed: --c, a program in C99, or --fmu, an FMU.")
        if inputs and not fmu:
            raise RequestError("export: --input is for --fmu. Values of the C program are set by its interface.")
        stages("reading the scene")
        path = out if out is not None else Path("export") / (f"{name_of(scene)}.fmu" if fmu else name_of(scene))
        check_folder(path.parent if fmu else path)
        if fmu and path.is_dir():
            raise RequestError(f"--out {path}: this is a folder. Name the FMU to write, as in export/press.fmu.")
        if fmu and path.suffix != ".fmu":
            raise RequestError(f"--out {path}: importers take an FMU by its ending. Allowed: a name that ends in .fmu.")
        if fmu:
            from ballpass.runtime.native.compilers import need_compiler

            need_compiler("ballpass export --fmu")
        chosen = tuple(inputs or ())
        over_time = scene.is_file() and not read_asked(scene, None)[0].integrated
        if over_time:
            chosen = (*chosen, SPEED) if fmu else chosen
            note(
                "all follows from the driver's angle in this scene. Angle and speed are states of what is written, and "
                f"the speed is {'an input' if fmu else 'a table over time'}."
            )
        else:
            manifest = read_own(scene, stages, lambda folder, own: read_artefact(folder, own=own), lambda found: found)
            over_time = scene.is_file() and _speed_becomes_input(manifest, chosen)
        with speed_over_time(scene, stages) if over_time else nullcontext(generated_folder(scene)) as folder:
            manifest = read_artefact(folder) if over_time else manifest
            stages("compiling the FMU" if fmu else "writing the C program")
            # here, because they import CasADi
            if fmu:
                from ballpass.runtime.export.fmu import export_fmu

                systems = ([*TARGETS] if is_installed("ziglang") else []) if target is None else target
                version = 3 if fmi is None else fmi
                export_fmu(
                    *(folder, path), inputs=chosen, manifest=manifest, version=version, targets=systems, progress=stages
                )
            else:
                from ballpass.runtime.export.c_program import export_c

                export_c(folder, path, manifest=manifest, targets=target or (), progress=stages)
        warn_of_scene(manifest)
    typer.echo(str(path))
    if c:
        place = shlex.quote(str(path))
        note(f"a program in C99, described in its README.md. make -C {place} run builds it and writes {place}/out.csv.")


def _speed_becomes_input(manifest: Manifest, inputs: Sequence[str]) -> bool:
    """Whether the inputs include the driver's speed of a scene in which that speed is constant."""
    mechanism = manifest.mechanism
    return mechanism is not None and not mechanism.angle and not {SPEED, "mechanism.driver"}.isdisjoint(inputs)
