"""Scales of the parameters: the tolerance of a derivative is relative to them.

In: a model's manifest, parameter values, magnitudes of the states.  Out: a scale for each parameter.

The error allowed in a derivative dx/dp is ``rtol * magnitude of x / scale of p``: that of the change of x which a
change of p by its scale would bring.  Scales are

- an angle: a radian, because its value depends on the choice of zero;
- a state at the start: its own magnitude, or its value where that is larger;
- anything else: its value; where that is zero, the largest value among the parameters of the same unit, else one unit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ballpass.runtime.contract.manifest import Manifest

#: Unit of angles in the manifest.
ANGLE = "rad"


def direction_scales(
    manifest: Manifest, values: Mapping[str, float], names: Sequence[str], magnitude: np.ndarray
) -> np.ndarray:
    """Scale of each named parameter, shape (names,) [the parameters' units].

    Parameters
    ----------
    values : of the parameters by name
    names : parameters of the model
    magnitude : of the states, shape (states,)
    """
    units = {info.name: info.unit for info in manifest.parameters}
    at_start = dict(zip(manifest.initial, np.asarray(magnitude, dtype=float).tolist(), strict=True))
    scales = []
    for name in names:
        value, unit = abs(values[name]), units[name]
        if unit == ANGLE:
            scale = 1.0
        elif name in at_start:
            scale = max(value, at_start[name])
        else:
            scale = value or max(abs(values[other]) for other, of in units.items() if of == unit)
        scales.append(scale or 1.0)
    return np.array(scales)
