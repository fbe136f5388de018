"""``ballpass new``: a copy of a shipped scene or data set, to run and edit."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

from ballpass.runtime.app.commands.messages import note, show
from ballpass.runtime.app.commands.shared import command
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.extras import can_derive
from ballpass.runtime.contract.options import Option
from ballpass.runtime.contract.parameters import unknown_name

#: The scene to begin with.
PRESS = "punching_press.toml"


def _names(incomplete: str) -> list[str]:
    """Names that the shell completes; none where only the runtime is installed."""
    if not can_derive():
        return []
    from ballpass.derive.scene.shipped import shipped_data_sets, shipped_scenes

    return [name for name in (*shipped_scenes(), *shipped_data_sets()) if name.startswith(incomplete)]


def new(
    name: Annotated[
        str | None,
        Option(
            shown="NAME",
            words="Name of a scene: press, four-bar, engine, rotor ...",
            positional=True,
            complete=_names,
        ),
    ] = None,
    folder: Annotated[
        Path, Option(shown="DIR", words="Folder to copy it to; made if it does not exist.", positional=True)
    ] = Path(),
    all_: Annotated[
        bool, Option(words="Copy all scenes and data sets into the folder named; what is there already stays.")
    ] = False,
    list_: Annotated[bool, Option(words="Print names and titles of all scenes; so without NAME.")] = False,
) -> None:
    """Copy a scene or a data set that comes with ballpass into a folder. An existing file is not overwritten."""
    with command():
        from ballpass.derive.scene.shipped import scene_of, shipped_data_sets, shipped_scenes, title_of

        scenes, data_sets = shipped_scenes(), shipped_data_sets()
        known = {**scenes, **data_sets}
        if all_:
            place = Path(name or ".")
            if place.is_file():
                raise RequestError(f"new --all: {place} is a file. Allowed: a folder, existing or not.")
            place.mkdir(parents=True, exist_ok=True)
            for each, path in known.items():
                copy = place / path.name
                if copy.exists():
                    show(f"{copy}: was there already")
                else:
                    _write(copy, scene_of(path)[1] if each in data_sets else path.read_text(encoding="utf-8"))
            show(f"{len(known)} scenes and data sets in {place}\nNext: ballpass run {shlex.quote(str(place / PRESS))}")
            return
        if list_ or name is None:
            width = max(map(len, known))
            for each, path in known.items():
                show(f"{each:<{width}}  {'Data set: ' if each in data_sets else ''}{title_of(path)}")
            if name is None:
                note("ballpass new NAME copies one.")
            return
        source = known.get(name.replace("_", "-")) or {path.stem: path for path in known.values()}.get(name)
        if source is None:
            raise RequestError(f"new: {unknown_name('scene', name, known)}")
        if folder.suffix == ".toml" or folder.is_file():
            raise RequestError(
                f"new: {folder} must be the folder for the copy, {source.name}. Allowed: a folder, "
                "existing or not. Copy first and rename the file then."
            )
        folder.mkdir(parents=True, exist_ok=True)
        target = folder / source.name
        if source in scenes.values():
            _write(target, source.read_text(encoding="utf-8"))
            show(f"{target}\nNext: ballpass run {shlex.quote(str(target))}")
            return
        scene, text = scene_of(source)
        beside = folder / scene.name
        _write(target, text)
        show(str(target))
        if beside.exists():
            show(f"{beside}: its scene, which was there already")
        else:
            _write(beside, scene.read_text(encoding="utf-8"))
            show(f"{beside}: its scene")
        show(f"Next: ballpass dataset {shlex.quote(str(target))}")


def _write(target: Path, text: str) -> None:
    try:
        with target.open("x", encoding="utf-8") as copy:
            copy.write(text)
    except FileExistsError:
        raise RequestError(
            f"{target} exists already and was not overwritten. Allowed: a folder without it. Give another folder, "
            "or move the file."
        ) from None
