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
    found = _named(_folder())
    return {"press": found.pop("press"), **found}


def shipped_data_sets() -> dict[str, Path]:
    """Specifications of data sets that come with ballpass, by the names that ``ballpass new`` has for them."""
    return _named(_folder() / "data_sets")


def title_of(scene: Path) -> str:
    """Title of a scene file, or of the specification of a data set."""
    return str(tomllib.loads(scene.read_text(encoding="utf-8"))["title"])


def scene_of(spec: Path) -> tuple[Path, str]:
    """The scene of a data set, and the specification's text for a folder that has both."""
    text = spec.read_text(encoding="utf-8")
    given = tomllib.loads(text)["scene"]
    scene = (spec.parent / given).resolve()
    return scene, text.replace(f'"{given}"', f'"{scene.name}"')


def _folder() -> Path:
    here = Path(__file__).resolve()
    packaged = here.parents[1] / "scenes"
    return packaged if packaged.is_dir() else here.parents[4] / "scenes"


def _named(folder: Path) -> dict[str, Path]:
    return {SHORT.get(path.stem, path.stem.replace("_", "-")): path for path in sorted(folder.glob("*.toml"))}
