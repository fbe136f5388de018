"""Derivative of the flow of a model by differences of tight runs, without its tangents."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ballpass.runtime import Model


def differences(
    model: Model,
    parameters: Mapping[str, float],
    start: np.ndarray,
    duration: float,
    steps: Sequence[float],
    kinks: str | None = None,
) -> np.ndarray:
    """The state after a time by that at its start, by differences over steps and half of them, extrapolated."""
    columns = []
    for k, step in enumerate(steps):
        ends = []
        for side in (1.0, -1.0, 0.5, -0.5):
            moved = start.copy()
            moved[k] += side * step
            run = model.simulate(
                duration=duration, initial=moved, parameters=parameters, rtol=1e-12, outputs=[], kinks=kinks
            )
            ends.append(run.x[-1])
        rough, fine = (ends[0] - ends[1]) / (2.0 * step), (ends[2] - ends[3]) / step
        columns.append((4.0 * fine - rough) / 3.0)
    return np.column_stack(columns)
