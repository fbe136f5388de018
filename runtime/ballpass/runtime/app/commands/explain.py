"""``ballpass explain``: what a scene models and what it leaves out, the reasons, the cost, and the effects on a run."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ballpass.runtime.app.commands import options
from ballpass.runtime.app.commands.load_scene import read_with_settings
from ballpass.runtime.app.commands.messages import show_json
from ballpass.runtime.app.commands.shared import command, load_model
from ballpass.runtime.ratings.elements import element_words
from ballpass.runtime.report.report import Marked, Report, ReportTable, Words
from ballpass.runtime.report.text import show as show_report
from ballpass.runtime.report.units import with_units

if TYPE_CHECKING:
    from ballpass.derive import Scene
    from ballpass.derive.features import Cost
    from ballpass.derive.scene.bearing_records import Bearing
    from ballpass.runtime.contract.manifest import Manifest
    from ballpass.runtime.point.explain import Explanation

#: Names of derivatives and of the values that they are taken of, which the table sums up.
_DERIVATIVE = re.compile(r"_jac(_[a-z])?$|_tangent$|_quantities$|^static_forces$")

#: Effects that no scene can ask for; listed to show the limits of the model.
_NEVER = (
    "lubricant film and friction of the contacts",
    "slip of the balls; their inertia and centrifugal force",
    "axial motion of the rings, and moments with which bearings resist tilts",
    "elasticity of the mechanism's bodies and of the rings themselves",
)


def explain(scene: options.SceneFile, set_: options.Settings = None, json_: options.Json = False) -> None:
    """Say what a scene models and which of its lines asked for it, what it leaves out, the cost of each part, and the
    time scales that decide about the method. Simulates nothing."""
    with command(scene) as stages:
        stages("reading the scene")
        read, _, overrides = read_with_settings(scene, set_)
        model = load_model(scene, stages, "cvodes", integrated=read.integrated)
        from ballpass.derive.features import cost

        stages("counting operations")
        counted = cost(read)
        stages("computing time scales")
        said = model.explain(overrides)
    report = _report(scene, read, counted, said, model.manifest)
    if json_:
        show_json(with_units(report))
    else:
        show_report(_render(report, said))


def _report(path: Path, scene: Scene, counted: Cost, said: Explanation, manifest: Manifest) -> dict[str, Any]:
    """The whole report as plain numbers and text; angles in degrees, everything else SI."""
    from ballpass.derive.features import features
    from ballpass.derive.scene.toml_lines import index_lines

    lines = index_lines(path.read_text(encoding="utf-8"))
    kernels = {k.removeprefix("kernel."): v for k, v in counted.functions.items() if k.startswith("kernel.")}
    named = features(scene)
    # operations that the parts do not add by themselves are those of the contacts
    shares = [(part.path, counted.added[part.name].get("rhs", 0)) for part in named if part.name in counted.added]
    parts: list[dict[str, Any]] = []
    contacts = [f"{bearing.path}.contact" for bearing in scene.bearings]
    for part in named:
        added = counted.added.get(part.name)
        # of several bearings the row of the last one has their common operations
        rest = added is None and part.path in contacts[-1:] and "rhs" in counted.functions
        parts.append(
            {
                "name": part.name,
                "path": part.path,
                "line": lines.find(tuple(part.path.split("."))),
                "what": part.modelled,
                "operations": None if added is None else {k: v for k, v in added.items() if v},
                "rest": _rest(shares, counted) if rest else None,
            }
        )

    def worded(text: str) -> str:
        return element_words(text, [bearing.element for bearing in scene.bearings])

    return {
        "scene": scene.name,
        "mechanism": scene.mechanism is not None,
        "title": scene.title,
        "file": str(path),
        "files_of_columns": list(scene.notes),
        "modelled": parts,
        "not_modelled": [*_absent(scene), *map(worded, _NEVER), *_of_drive(scene)],
        "functions": {f.name: {"operations": f.operations, "what": worded(f.description)} for f in manifest.functions},
        "step": _step(kernels, scene.bearings),
        **said.to_json(),
    }


def _rest(shares: list[tuple[str, int]], counted: Cost) -> int:
    """Operations of the right-hand side that belong to no single part; a part within another counts with that one."""
    paths = [path for path, _ in shares]
    within = [any(path.startswith(f"{other}.") for other in paths) for path in paths]
    return counted.functions["rhs"] - sum(v for (_, v), inner in zip(shares, within, strict=True) if not inner)


def _step(kernels: dict[str, int], bearings: Sequence[Bearing]) -> dict[str, int]:
    """Operations of one evaluation of the right-hand side in the stepper, by part."""
    if not kernels:
        return {}
    # each ball turns its direction and adds its force to two sums
    around = 2 * 3 + 2
    parts = {
        "load and mechanism": kernels["stage"],
        "motion of the rings": kernels["relative"] + kernels["acceleration"],
        element_words("ball contacts", [b.element for b in bearings]): sum(
            b.balls * (kernels[f"{b.prefix}ball.forces"] + around) for b in bearings
        ),
    }
    return parts | {"all": sum(parts.values())}


def _of_drive(scene: Scene) -> list[str]:
    """Effects that a drive at constant speed leaves out."""
    uneven = scene.mechanism is not None and scene.mechanism.driver.turns_unevenly
    return [] if uneven else ["variation of the drive's speed"]


def _absent(scene: Scene) -> list[str]:
    """Effects that this scene leaves out, and the keys that would add them."""
    from ballpass.derive.bearing.effects import EFFECTS

    out = []
    mechanism = scene.mechanism
    if mechanism is None:
        out.append("a mechanism: the load is given ([mechanism])")
    else:
        if mechanism.gravity is None:
            out.append("weight of the mechanism's bodies (mechanism.gravity)")
        if not mechanism.forces:
            out.append("forces, torques and springs ([mechanism.forces.NAME], torques, springs, torsion_springs)")
            out.append("stops and friction of joints ([mechanism.stops.NAME], torsion_stops, friction, guide_friction)")
    if not scene.bearings:
        out.append("a bearing: forces of the mechanism only ([bearing])")
    left: dict[tuple[str, str], list[str]] = {}  # words and key: the bearings without it
    for bearing in scene.bearings:
        lacking = []
        if mechanism is not None and bearing.coupling == "one-way":
            words = "play and forces of the bearing that act back on the linkage"
            lacking.append((words, 'coupling = "two-way"'))
        if not bearing.damping.numbers:
            lacking.append(("damping at the balls", "damping"))
        if bearing.inner is not None and bearing.inner.damping is None:
            lacking.append(("viscous damping of the inner ring to the frame", "inner_ring.damping"))
        if bearing.outer is None:
            lacking.append(("motion of the outer ring", 'outer_ring, support = "elastic"'))
        if not (bearing.cage and bearing.cage.slipping):
            lacking.append(("slip of the cage", "cage.slip"))
        present = {effect.kind for effect in bearing.effects}
        lacking += [(effect.words, kind) for kind, effect in EFFECTS.items() if kind not in present]
        for words, key in lacking:
            left.setdefault((element_words(words, [bearing.element]), key), []).append(bearing.name)
    for (words, key), names in left.items():
        path = f"bearings.{names[0]}" if len(names) == 1 and names[0] else "bearings.NAME" if names[0] else "bearing"
        named = f"; NAME: {', '.join(names)}" if len(names) > 1 else ""
        out.append(f"{words} ({path}.{key}{named})")
    return out


def _render(report: dict[str, Any], said: Explanation) -> Report:
    parts: list[Words | ReportTable] = ["", _modelled(report), "", Marked("Not modelled", "head")]
    parts += [f"  - {text}" for text in report["not_modelled"]]
    if report["files_of_columns"]:
        parts += ["", Marked("Files of columns", "head"), *(f"  - {text}" for text in report["files_of_columns"])]
    parts += ["", Marked("States", "head", f": {', '.join(report['states']) or 'none'}"), "", _functions(report)]
    if report["step"]:
        shares = ", ".join(f"{name} {count}" for name, count in report["step"].items() if name != "all")
        words = f": {report['step']['all']} operations ({shares})"
        parts += ["", Marked("One evaluation in the stepper", "head", words)]
    parts += ["", *said.report().parts]
    return Report(title=report["title"], parts=parts)


def _modelled(report: dict[str, Any]) -> ReportTable:
    """The parts of the model, and how much of the right-hand side each one is."""
    total = report["functions"].get("rhs", {}).get("operations", 0)
    several = sum(part["path"].endswith(".contact") for part in report["modelled"]) > 1
    rows, last = [], []
    for part in report["modelled"]:
        counts, rest = part["operations"], part["rest"]
        added = rest if counts is None else counts.get("rhs", 0)
        cell = "" if added is None or not total else f"{added} ({100 * added / total:.0f} %)"
        line = str(part["line"] or "")
        if rest is None:
            rows.append((part["name"], line, part["what"], cell))
        elif several:
            rows.append((part["name"], line, part["what"], ""))
            last.append(("the rest", "", "contacts and rings of all bearings", cell))
        else:
            rows.append((f"the rest: {part['name']} and rings", line, part["what"], cell))
    return ReportTable(
        title="Modelled",
        heads=("part", "line", "what", "operations"),
        rows=[*rows, *last],
        right=("line", "operations"),
        wrapped=("what",),
        caption="Operations of one evaluation of the equations of motion (rhs), and their share.",
    )


def _functions(report: dict[str, Any]) -> ReportTable:
    functions = report["functions"].items()
    rows = [
        (name, str(info["operations"]), info["what"])
        for name, info in functions
        if info["operations"] and not _DERIVATIVE.search(name)
    ]
    queries = sum(_DERIVATIVE.search(name) is not None for name, _ in functions)
    rows.append(("for derivatives", "", f"{queries} functions, compiled when a query first needs them (--json)"))
    return ReportTable(
        title="Generated functions",
        heads=("function", "operations", "what"),
        rows=rows,
        right=("operations",),
        wrapped=("what",),
    )
