"""Contradictions between the parts of a manifest: names used twice, names that do not exist, sizes that disagree."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ballpass.runtime.contract.manifest import Manifest, MechanismInfo

#: Names of scenes, which become names of files, of make targets and of programs.
_SCENE_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")


def contradictions(manifest: Manifest) -> list[str]:
    """Faults between the parts, each with its place; empty where there is none."""
    faults = []
    if not _SCENE_NAME.fullmatch(manifest.scene):
        faults.append(f"scene: a letter, then letters, digits and _, is expected, not {manifest.scene[:80]!r}")
    for name, _ in manifest.files:
        if name in ("", ".", "..") or re.search(r"[/\\\0]", name):
            faults.append(f"files: {name[:80]!r} is no name of a file in the folder")
    for group in ("parameters", "constants", "states", "inputs", "outputs", "functions", "quantities"):
        names = [item.name for item in getattr(manifest, group)]
        for name in dict.fromkeys(name for name in names if names.count(name) > 1):
            faults.append(f"{group}: the name {name!r} occurs {names.count(name)} times")
    parameters = {item.name for item in manifest.parameters}
    values = parameters | {item.name for item in manifest.constants}
    if len(manifest.initial) != len(manifest.states):
        faults.append(f"initial: {len(manifest.states)} names are expected, one per state, not {len(manifest.initial)}")
    used = [("initial", name, parameters) for name in manifest.initial]
    for item in manifest.inputs:
        place = f"inputs[{item.name}]"
        if item.kind in ("phase", "gate"):
            used += [(f"{place}.{key}", getattr(item, key), values) for key in ("offset", "rate")]
        used += [(f"{place}.windows", edge, values) for window in item.windows for edge in window]
        used += [(f"{place}.times", name, values) for name in item.times]
        used += [(f"{place}.values", name, values) for name in item.values]
        if item.kind in ("table", "table_rate") and (len(item.times) != len(item.values) or len(item.times) < 2):
            faults.append(f"{place}: as many times as values are expected, at least two")
    if manifest.mechanism is not None:
        used += [(f"mechanism.{k}", getattr(manifest.mechanism, k), values) for k in ("speed", "start_angle")]
        faults += _force_faults(manifest, manifest.mechanism, parameters)
    used += [(f"{bearing.path}.shaft_speed", bearing.shaft_speed, values) for bearing in manifest.bearings]
    faults += [f"{place}: {name!r} is no parameter or constant" for place, name, known in used if name not in known]
    if (manifest.run.cycles is None) == (manifest.run.duration is None):
        faults.append("run: exactly one of cycles and duration must be a number")
    return faults


def force_components(name: str) -> tuple[tuple[str, str], tuple[str, str]]:
    """Names of the parameters that hold an applied force: x and y [N], or magnitude [N] and direction [rad]."""
    path = f"mechanism.forces.{name}.force"
    return (f"{path}.x", f"{path}.y"), (f"{path}.magnitude", f"{path}.direction")


def _force_faults(manifest: Manifest, mechanism: MechanismInfo, parameters: set[str]) -> list[str]:
    faults = []
    points = {(item.body, item.point) for item in mechanism.points}
    gates = {item.name for item in manifest.inputs if item.kind == "gate"}
    for name, body, point, gate in mechanism.forces:
        place = f"mechanism.forces[{name}]"
        if (body, point) not in points:
            faults.append(f"{place}: {point!r} of {body!r} is no point of the mechanism")
        if gate and gate not in gates:
            faults.append(f"{place}: {gate!r} is no gate among the inputs")
        forms = force_components(name)
        if not any(parameters.issuperset(form) for form in forms):
            faults.append(f"{place}: the parameters {' or '.join(' and '.join(form) for form in forms)} are missing")
    return faults
