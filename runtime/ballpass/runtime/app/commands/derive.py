"""``ballpass derive`` and ``ballpass equations``: the derived equations of a scene, as files or printed."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ballpass.runtime.app.commands import options
from ballpass.runtime.app.commands.messages import complain, warn_of_scene
from ballpass.runtime.app.commands.shared import command
from ballpass.runtime.contract.folder import read_manifest
from ballpass.runtime.contract.options import Option


def derive(
    scene: options.SceneFile,
    out: Annotated[Path | None, Option(shown="DIR", words="Folder to write; `generated/<scene>` if not given.")] = None,
    check: Annotated[
        bool, Option(words="Write nothing; exit code 1 if the folder differs from a new derivation.")
    ] = False,
) -> None:
    """Derive the equations of a scene and generate its C, functions, manifest and EQUATIONS.md."""
    with command(scene) as stages:
        import ballpass.derive as deriving

        if check:
            stages("deriving to compare")
            result = deriving.check(scene, out)
        else:
            folder = deriving.generate(scene, out, progress=stages)
            warn_of_scene(read_manifest(folder))
    if not check:
        typer.echo(str(folder))
    elif result.stale:
        state = f"is stale: {', '.join(result.stale)}" if result.folder.is_dir() else "does not exist"
        remedy = f"ballpass derive {scene}" + (f" --out {out}" if out is not None else "")
        complain(f"{result.folder} {state}. Run: {remedy}")
        raise typer.Exit(1)
    else:
        typer.echo(f"{result.folder} is up to date")


def equations(scene: options.SceneFile) -> None:
    """Print the derived equations of a scene as Markdown with LaTeX."""
    with command(scene):
        import ballpass.derive as deriving

        text = deriving.equations(deriving.derive(deriving.read_scene(scene)))
    typer.echo(text, nl=False)
