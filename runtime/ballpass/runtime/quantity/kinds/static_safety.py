"""Static safety s_0 of a bearing by the highest load of an element in a run, and its derivative; ISO 76.

In: the data of a run for a kind of quantity.  Out: an `Estimate` [1].
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ballpass.runtime.contract.manifest import BearingInfo, Manifest
from ballpass.runtime.quantity.extreme_value import extreme
from ballpass.runtime.quantity.records import Array, Estimate, Kind, Quantity, ReducedRuns, View
from ballpass.runtime.ratings.life import static_safety
from ballpass.runtime.ratings.of_bearing import geometry_of, ratings_of


def _of_one_newton(bearing: BearingInfo, values: Mapping[str, Any]) -> Any:
    """s_0 where the most loaded element bears 1 N: it bears 5/Z of P_0."""
    load = bearing.balls * geometry_of(bearing, values).nominal_cosine / 5.0
    return static_safety(ratings_of(bearing, values).static, load)


def _safety(view: View, quantity: Quantity) -> Estimate:
    bearing, peak = quantity.bearing(view.manifest), extreme(view, quantity, "max")
    if peak.value <= 0.0:
        return replace(peak, value=np.inf, slope=np.zeros(view.directions))
    value = float(_of_one_newton(bearing, view.numbers.values)) / peak.value
    (rated,) = view.rated_slopes(bearing, lambda values: _of_one_newton(bearing, values))
    return replace(peak, value=value, slope=(rated - value * peak.slope) / peak.value)


def _check(manifest: Manifest, values: Mapping[str, float], quantity: Quantity) -> None:
    ratings_of(quantity.bearing(manifest), values)  # refuses elements that no standard rates


def _reduced(runs: ReducedRuns, quantity: Quantity) -> Array:
    with np.errstate(divide="ignore"):
        peak = np.maximum(runs.entry("max", quantity.channel), 0.0)
        return np.asarray(_of_one_newton(quantity.bearing(runs.manifest), runs.values) / peak)


KINDS = (
    Kind(
        name="static_safety",
        also=("s_0",),
        summary="static safety s_0 of the bearing, ISO 76: C_0 over Z/5 of the highest force of a ball",
        words="Static safety",
        takes="bearing",
        unit="1",
        check=_check,
        evaluate=_safety,
        extremes=("max",),
        reduced=_reduced,
        rows=("max",),
    ),
)
