"""Allowed values of a model's parameters: signs, bounds, and rules between several parameters.

In: the manifest and values, single ones or a column for each parameter.  Out: a mask or messages.  A scene file is
checked when it is read; these are the same bounds, for numbers given in Python.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from ballpass.runtime.contract.manifest import Manifest, ParameterInfo
from ballpass.runtime.contract.units import FAR_ANGLE, MOST_ANGLE

#: Name of a bound, its words in messages, and the comparison that a value must satisfy.
_BOUNDS: tuple[tuple[str, str, Callable[[Any, float], Any]], ...] = (
    ("above", "above", operator.gt),
    ("least", "from", operator.ge),
    ("most", "to", operator.le),
    ("below", "below", operator.lt),
)


def allowed(info: ParameterInfo) -> str:
    """The values a parameter may have, in words; empty where it may have any."""
    bounds = ((word, getattr(info, name)) for name, word, _ in _BOUNDS)
    return " ".join(f"{word} {bound:g}" for word, bound in bounds if bound is not None)


def outside(info: ParameterInfo, values: Any) -> Any:
    """Whether a number violates the bounds, or each of an array; NaN violates any."""
    within: Any = True if isinstance(values, float) else np.ones(np.shape(values), dtype=bool)
    for name, _, fulfils in _BOUNDS:
        bound = getattr(info, name)
        if bound is not None:
            within = within & fulfils(values, bound)
    return not within if isinstance(values, float) else ~within


def counts(manifest: Manifest) -> tuple[str, ...]:
    """Parameters that are numbers of bearings; derivatives treat them as any other."""
    known, own = {info.name for info in manifest.parameters}, (f"{b.path}.count" for b in manifest.bearings)
    return tuple(name for name in own if name in known)


def violations(manifest: Manifest, columns: Mapping[str, np.ndarray | float]) -> Iterator[tuple[np.ndarray, str]]:
    """Masks of values that are not allowed, each with the allowed ones in words.

    Parameters
    ----------
    columns : values of all parameters by name: numbers, or arrays of one shape
    """
    for info in manifest.parameters:
        bad = outside(info, columns[info.name])
        # an array for each of forty numbers would take longer than a short run
        if bad if isinstance(bad, bool) else bad.any():
            yield np.asarray(bad), f"{info.name}: allowed is a number {allowed(info)} [{info.unit}]"
        if info.unit == "rad" and np.any(far := np.abs(columns[info.name]) >= MOST_ANGLE):
            yield np.asarray(far), f"{info.name}: {FAR_ANGLE}"
    for name in counts(manifest):
        bad = np.asarray(columns[name], dtype=float) % 1.0 != 0.0
        if bad.any():
            yield bad, f"{name}: allowed is a whole number from 1"
    for name, factor, other in manifest.relations:
        bad = ~(np.asarray(columns[name], dtype=float) > factor * np.asarray(columns[other], dtype=float))
        if bad.any():
            yield bad, f"{name}: allowed is a number above {factor:.9g} times {other}"
