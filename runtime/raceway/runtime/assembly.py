"""Whether a linkage can be assembled at every angle of a turn."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from raceway.runtime import clock
from raceway.runtime.errors import RequestError
from raceway.runtime.kernel import Kernel

if TYPE_CHECKING:
    from raceway.runtime.model import Model
    from raceway.runtime.simulate import Numbers

#: Angles looked at in a turn; between them minima are refined.
ANGLES = 720


def check_assembly(model: Model, numbers: Numbers) -> None:
    """Look at every margin of the linkage over a turn.

    Raises
    ------
    RequestError
        A dyad cannot be assembled; names its joint and the crank angle at which it is worst.
    """
    mechanism = model.manifest.mechanism
    if mechanism is None or not mechanism.margins:
        return
    turn = clock.period(model.manifest, numbers.values)
    times = turn * np.arange(ANGLES) / ANGLES if math.isfinite(turn) else np.zeros(1)
    fixed = {"u": clock.inputs_at(model.manifest.inputs, numbers.values, 0.0), "p": numbers.p, "c": numbers.c}
    (margins,) = model.loop("assembly", ("t",))(len(times), {"t": times, **fixed}).values()
    kernel = model.kernel("assembly")
    faults = []
    for row, info in enumerate(mechanism.margins):
        # no number is no assembly
        samples = np.where(np.isnan(margins[:, row]), -np.inf, margins[:, row])
        k = int(np.argmin(samples))
        time, worst = float(times[k]), float(samples[k])
        if worst > 0.0 and len(times) > 1:
            time, worst = _refine(kernel, fixed, row, time, turn / ANGLES, worst)
        if worst <= 0.0:
            angle = math.degrees(clock.crank_angle(model.manifest, numbers.values, time))
            faults.append(
                f"The linkage cannot be assembled at joint {info.joint!r}, worst at crank angle {angle:.2f} deg "
                f"({info.description}: margin {worst:.4g})."
            )
    if faults:
        raise RequestError("\n".join(faults) + "\nChange the lengths of the bodies that meet at the joint.")


def _refine(
    kernel: Kernel, fixed: dict[str, np.ndarray], row: int, time: float, reach: float, value: float
) -> tuple[float, float]:
    """Minimum of a margin within `reach` of a sample, by golden section."""
    ratio = 0.5 * (math.sqrt(5.0) - 1.0)

    def margin(t: float) -> float:
        found = float(kernel({**fixed, "t": t})[row])
        return -math.inf if math.isnan(found) else found

    low, high = time - reach, time + reach
    best = (value, time)
    inner = [high - ratio * (high - low), low + ratio * (high - low)]
    heights = [margin(t) for t in inner]
    for _ in range(30):
        best = min(best, *zip(heights, inner, strict=True))
        if heights[0] < heights[1]:
            high, inner[1], heights[1] = inner[1], inner[0], heights[0]
            inner[0] = high - ratio * (high - low)
            heights[0] = margin(inner[0])
        else:
            low, inner[0], heights[0] = inner[0], inner[1], heights[1]
            inner[1] = low + ratio * (high - low)
            heights[1] = margin(inner[1])
    return best[1], best[0]
