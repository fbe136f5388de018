"""Numbers that are allowed but unusual: a warning names them, none is refused.

In: the manifest and values, single ones or a column for each parameter.  Out: sentences, and warnings.
"""

from __future__ import annotations

import operator
import warnings
from collections.abc import Mapping
from functools import reduce
from typing import Any

import numpy as np

from ballpass.runtime.contract.errors import BallpassWarning
from ballpass.runtime.contract.manifest import Manifest, UsualInfo


class UnusualWarning(BallpassWarning):
    """A number, or a result of a run, is allowed but outside what real bearings and machines show."""


def unusual(manifest: Manifest, columns: Mapping[str, np.ndarray | float]) -> list[str]:
    """A sentence for each usual range that values lie outside of.

    Parameters
    ----------
    columns : values of all parameters by name: numbers, or arrays of one shape, a value for each member; and derived
        constants, where they are known
    """
    said = []
    for info in manifest.usual:
        if any(name not in columns for name in info.names):
            continue
        odd = _outside(info, columns)
        # an array for each range would take longer than a short run
        if odd if isinstance(odd, bool) else np.any(odd):
            said.append(_sentence(manifest, info, columns, np.atleast_1d(odd)))
    return said


def warn_unusual(manifest: Manifest, columns: Mapping[str, np.ndarray | float]) -> None:
    """Warn of the results of `unusual`."""
    for text in unusual(manifest, columns):
        warnings.warn(text, UnusualWarning, stacklevel=3)


def _outside(info: UsualInfo, columns: Mapping[str, Any]) -> Any:
    """Whether numbers lie outside of a range, or each of their arrays."""
    values = [columns[name] for name in info.names]
    if info.each:
        return reduce(operator.and_, ((value > 0.0) & (value < info.least) for value in values))
    total, scale = sum(values), abs(columns[info.of]) if info.of else 1.0
    odd: Any = False
    if info.least is not None:
        odd = odd | (total < info.least * scale)
    if info.most is not None:
        odd = odd | (total > info.most * scale)
    return odd & (scale > 0.0)  # a clearance of zero cannot be a scale


def usual_template(manifest: Manifest, info: UsualInfo) -> tuple[str, str]:
    """Sentence on unusual numbers as two templates of `str.format`: what was given, and what is usual.

    They are filled with the values of `names` and, behind these, the first one over `of`, else their sum.
    """
    known = {item.name: item.unit for item in manifest.parameters}
    known |= {item.name: item.unit for item in manifest.constants}
    units = {name: "" if unit == "1" else f" {unit}" for name, unit in known.items()}
    given = " and ".join(f"{name} = {{{k}:.4g}}{units[name]}" for k, name in enumerate(info.names))
    unit, behind = "" if info.of else units[info.names[0]], len(info.names)
    if info.of:
        given += f", {{{behind}:.3g}} of {info.of}"
    elif len(info.names) > 1 and not info.each:
        given += f", together {{{behind}:.4g}}{unit}"
    if info.each:
        usual = f"an edge above {info.least:.3g}{unit}"
    elif info.least is None:
        usual = f"at most {info.most:.4g}{unit}"
    else:
        usual = " to ".join(dict.fromkeys((f"{info.least:.4g}", f"{info.most:.4g}"))) + unit
    return given, f": unusual. Usual is {usual}. {info.hint}"


def _sentence(manifest: Manifest, info: UsualInfo, columns: Mapping[str, Any], odd: np.ndarray) -> str:
    """Sentence: the unusual numbers, the usual range, what to check; of many members the first."""
    k = int(np.argmax(odd))
    values = [float(np.atleast_1d(columns[name])[k]) for name in info.names]
    together = values[0] / abs(float(np.atleast_1d(columns[info.of])[k])) if info.of else sum(values)
    given, usual = (text.format(*values, together) for text in usual_template(manifest, info))
    if len(odd) > 1:
        given += f" (member {k}, the first of {np.count_nonzero(odd)} among {len(odd)})"
    return given + usual
