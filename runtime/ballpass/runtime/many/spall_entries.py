"""When balls reach the edge of a spall: the openings of its window, which are known before a run.

In: a model, parameters of members.  Out: times by spall.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ballpass.runtime.many.members import make_members
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.run import driver_angle

#: Names of the inputs of spalls.
_GATE = "gate."


def spalls_of(model: LoadedModel) -> tuple[str, ...]:
    """Names of the spalls of a model, as ``defects.spall``."""
    names = [item.name.removeprefix(_GATE) for item in model.manifest.inputs if item.kind == "gate"]
    return tuple(name for name in names if "defects." in name)


def entry_times(
    model: LoadedModel, parameters: Mapping[str, np.ndarray], begin: float, end: float
) -> dict[str, np.ndarray]:
    """Times at which a ball reaches a spall, at constant speed.

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
        offset, rate = columns[item.offset], columns[item.rate]
        opening = [np.where(rate > 0.0, columns[first], columns[last]) for first, last in item.windows]
        turn = np.divide(driver_angle.TURN, np.abs(rate), out=np.full(len(rate), np.inf), where=rate != 0.0)
        count = int(np.ceil(np.max((end - begin) / turn))) + 1
        phase = np.array([np.mod(np.sign(rate) * (at - offset - rate * begin), driver_angle.TURN) for at in opening])
        first = begin + phase / driver_angle.TURN * np.where(np.isfinite(turn), turn, np.nan)
        times = (first[..., None] + np.arange(count) * turn[:, None]).transpose(1, 0, 2).reshape(len(rate), -1)
        times = np.sort(np.where(times < end, times, np.nan), axis=1)  # NaN last
        found[name] = times[:, : int(np.max(np.sum(np.isfinite(times), axis=1), initial=1))]
    return found
