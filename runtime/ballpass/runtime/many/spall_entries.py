"""When balls reach the edge of a spall: the openings of its window, known before a run or decided by its motion.

In: a model, parameters of members, or a manifest.  Out: times by spall; spalls whose times the motion decides.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ballpass.runtime.contract.manifest import InputInfo, Manifest
from ballpass.runtime.many.members import make_members
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.time import timeline
from ballpass.runtime.time.breakpoints import edge_times
from ballpass.runtime.time.turning import Turning

#: Names of the inputs of spalls.
_GATE = "gate."


def spalls_of(model: LoadedModel) -> tuple[str, ...]:
    """Names of the spalls of a model, as ``defects.spall``."""
    names = [item.name.removeprefix(_GATE) for item in model.manifest.inputs if item.kind == "gate"]
    return tuple(name for name in names if "defects." in name)


def driven_spalls(manifest: Manifest) -> dict[str, str]:
    """Spalls that balls enter when the motion decides, as ``defects.spall``, by what their edges begin with."""
    edges = dict.fromkeys(edge.rpartition(".")[0] for edge in manifest.edges if "defects." in edge)
    prefixes = {bearing.path: bearing.prefix for bearing in manifest.bearings}
    return {
        edge: f"{prefixes[path]}defects.{name}" for edge in edges for path, _, name in [edge.partition(".defects.")]
    }


def entry_times(
    model: LoadedModel, parameters: Mapping[str, np.ndarray], begin: float, end: float
) -> dict[str, np.ndarray]:
    """Times at which a ball reaches a spall, of a driver whose angle is known; the slip of the cage may change.

    Parameters
    ----------
    parameters : overrides by name, each of shape (members,) [SI]
    begin, end : of the interval [s]

    Returns
    -------
    By spall, increasing, shape (members, most entries of a member); NaN after the last one [s]
    """
    found: dict[str, np.ndarray] = {}
    spalls = spalls_of(model)
    if not spalls:
        return found
    columns = make_members(model, parameters, bounded=False).columns
    for item in model.manifest.inputs:
        name = item.name.removeprefix(_GATE)
        if name not in spalls:
            continue
        used = timeline.names_of_input(model.manifest, item)
        members = [
            _entries(model.manifest, item, {key: float(columns[key][k]) for key in used}, begin, end)
            for k in range(len(columns[used[0]]))
        ]
        found[name] = np.full((len(members), max(1, *map(len, members))), np.nan)
        for row, times in zip(found[name], members, strict=True):
            row[: len(times)] = times
    return found


def _entries(manifest: Manifest, item: InputInfo, values: Mapping[str, float], begin: float, end: float) -> np.ndarray:
    """Times from `begin` to before `end` at which a window opens, increasing [s]."""
    info = timeline.info_of(manifest, item)
    times = []
    for name, passed in edge_times(manifest, item, values, begin, end):
        # the edge that opens it is the first where the angle grows there
        opening = {first: 1.0 for first, _ in item.windows} | {last: -1.0 for _, last in item.windows}
        times.append(passed[np.sign(Turning.of(info, values).at(passed)[1]) == opening[name]])
    found = np.sort(np.concatenate([np.zeros(0), *times]))
    return found[found < end]
