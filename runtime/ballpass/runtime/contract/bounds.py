"""Which values a model's parameters may have: signs, bounds, and what they must be to each other.

In: the manifest and values, single ones or a column for each parameter.  Out: a mask or messages.  A scene file is
checked by whoever reads it; these are the same bounds, for numbers given in Python.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from ballpass.runtime.contract import Manifest, ParameterInfo


def allowed(info: ParameterInfo) -> str:
    """The values a parameter may have, in words; empty where it may have any."""
    words = (("above", info.above), ("from", info.least), ("to", info.most), ("below", info.below))
    return " ".join(f"{word} {bound:g}" for word, bound in words if bound is not None)


def outside(info: ParameterInfo, values: np.ndarray | float) -> np.ndarray:
    """Whether each value violates the parameter's bounds; of the shape of `values`."""
    given = np.asarray(values, dtype=float)
    bad = np.zeros(given.shape, dtype=bool)
    if info.above is not None:
        bad |= ~(given > info.above)
    if info.least is not None:
        bad |= ~(given >= info.least)
    if info.most is not None:
        bad |= ~(given <= info.most)
    if info.below is not None:
        bad |= ~(given < info.below)
    return bad


def violations(manifest: Manifest, columns: Mapping[str, np.ndarray | float]) -> Iterator[tuple[np.ndarray, str]]:
    """Masks of values that are not allowed, each with what is allowed.

    Parameters
    ----------
    columns : values of all parameters by name: numbers, or arrays of one shape
    """
    for info in manifest.parameters:
        given = columns[info.name]
        # an array for each of forty numbers would take longer than a short run
        if isinstance(given, float) and not _number_outside(info, given):
            continue
        bad = outside(info, given)
        if bad.any():
            yield bad, f"{info.name}: allowed is a number {allowed(info)} [{info.unit}]"
    for name, factor, other in manifest.relations:
        bad = ~(np.asarray(columns[name], dtype=float) > factor * np.asarray(columns[other], dtype=float))
        if bad.any():
            yield bad, f"{name}: allowed is a number above {factor:.9g} times {other}"


def _number_outside(info: ParameterInfo, value: float) -> bool:
    return not (
        (info.above is None or value > info.above)
        and (info.least is None or value >= info.least)
        and (info.most is None or value <= info.most)
        and (info.below is None or value < info.below)
    )
