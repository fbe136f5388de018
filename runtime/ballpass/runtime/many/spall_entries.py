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
    gates = [item for item in model.manifest.inputs if item.kind == "gate" and "defects." in item.name]
    columns = make_members(model, parameters, bounded=False).columns if gates else {}
    for item in gates:
        used = timeline.names_of_input(model.manifest, item)
        members = [
            _entries(model.manifest, item, {key: float(columns[key][k]) for key in used}, begin, end)
            for k in range(len(columns[used[0]]))
        ]
        table = np.full((len(members), max(1, *map(len, members))), np.nan)
        for row, times in zip(table, members, strict=True):
            row[: len(times)] = times
        found[item.name.removeprefix("gate.")] = table
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
