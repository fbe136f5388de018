"""The scenes that come with ballpass: in the installed package, or in the repository that it is installed from."""

from __future__ import annotations

import tomllib
from pathlib import Path

#: Short names of scenes; the others are called like their files, with "-" for "_".
SHORT = {"punching_press": "press", "toggle_press": "toggle"}


def shipped_scenes() -> dict[str, Path]:
    """Scene files that come with ballpass, by the names that ``ballpass new`` has for them, the press first.

    Examples
    --------
    >>> scenes = shipped_scenes()
    >>> list(scenes)[0], scenes["four-bar"].name
    ('press', 'four_bar.toml')
    >>> folder = generate(scenes["press"])
    """
    here = Path(__file__).resolve()
    packaged = here.parents[1] / "scenes"
    folder = packaged if packaged.is_dir() else here.parents[4] / "scenes"
    found = {SHORT.get(path.stem, path.stem.replace("_", "-")): path for path in sorted(folder.glob("*.toml"))}
    return {"press": found.pop("press"), **found}


def title_of(scene: Path) -> str:
    """Title of a scene file."""
    return str(tomllib.loads(scene.read_text(encoding="utf-8"))["title"])
