"""``ballpass explore``: a scene as a page with the solver in it.

In: a scene.  Out: one HTML file with sliders, which needs no server, no network and no installation.
"""

from __future__ import annotations

import re
import tomllib
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from ballpass.runtime.app.commands import options
from ballpass.runtime.app.commands.load_scene import read_asked
from ballpass.runtime.app.commands.messages import show, size_words
from ballpass.runtime.app.commands.shared import command, load_model, results_file, speed_over_time
from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.contract.units import QuantityError, parse_quantity

#: What a scene file writes: a number, then its unit.
_QUANTITY = re.compile(r"\s*[+-]?[0-9.]+(?:[eE][+-]?[0-9]+)?\s*(.+?)\s*")

#: Components of a vector by the last part of their name, and the place that they have in a list.
_COMPONENTS = {"x": 0, "y": 1}


def explore(scene: options.SceneOrFolder, out: options.ResultsFile = None) -> None:
    """Write a scene as a page with the solver in it: move a number, and curves and peaks follow.

    The page is one file. It needs no server, no network and no installation where it is opened.
    Its address carries the numbers that were changed: explore.html#bearing.clearance=30 um.
    """
    with command(scene) as stages:
        from ballpass.runtime.export.web_assembly import check_compiler

        stages("reading the scene")
        check_compiler()
        source, _ = read_asked(scene, None)
        path = results_file(out, scene, "explore.html", ("html",))
        over_time = scene.is_file() and not source.integrated
        with speed_over_time(scene, stages) if over_time else nullcontext(scene) as place:
            model = load_model(place, stages, source.run.method, integrated=source.integrated)
            stages("compile for pages")
            path.parent.mkdir(parents=True, exist_ok=True)
            model.explore(path, units={} if scene.is_dir() else scene_units(scene, model.manifest))
    show(f"{path} ({size_words(path.stat().st_size)})")


def scene_units(scene: Path, manifest: Manifest) -> dict[str, str]:
    """The unit that a scene file writes each of its numbers in; without those that it does not write itself."""
    content = tomllib.loads(scene.read_text(encoding="utf-8"))
    found = {}
    for info in manifest.parameters:
        written = _QUANTITY.fullmatch(_text(content, info.name.split(".")))
        if written is None:
            continue
        try:
            parse_quantity(f"1 {written[1]}", info.unit)
        except QuantityError:  # a designation, say, or a unit that the page does not know
            continue
        found[info.name] = written[1]
    return found


def _text(content: Any, path: list[str]) -> str:
    """What stands at a path; empty where nothing does, or no text."""
    for key in path:
        if isinstance(content, list):
            content = content[_COMPONENTS[key]] if key in _COMPONENTS and len(content) == len(_COMPONENTS) else None
        else:
            content = content.get(key) if isinstance(content, dict) else None
    return content if isinstance(content, str) else ""
