"""Check whether a linkage can be assembled: at every angle of a turn, and at one instant."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.time import timeline
from ballpass.runtime.time.turning import TURN, past

if TYPE_CHECKING:
    from ballpass.runtime.contract.parameters import Numbers

#: Angles checked in a turn; between them minima are refined.
ANGLES = 720

#: Sweeps around the smallest sample, each so many times finer than the one before.
SWEEPS, FINE = 3, 128


def check_assembly(model: LoadedModel, numbers: Numbers) -> None:
    """Check every margin of the linkage over a turn.

    Raises
    ------
    RequestError
        A dyad cannot be assembled; names its joint and the crank angle at which it is worst.  A body with a bearing
        turns too fast for its angle to be followed.
    """
    mechanism = model.manifest.mechanism
    if mechanism is None or not mechanism.margins:
        return
    moves = timeline.is_free(model.manifest) or timeline.driver(model.manifest, numbers.values).fastest > 0.0
    angles = TURN * np.arange(ANGLES * mechanism.repeats) / ANGLES if moves else np.zeros(1)
    margins = _margins(model, numbers, angles)
    faults = []
    for row, info in enumerate(mechanism.margins):
        k = int(np.argmin(margins[:, row]))
        angle, worst = float(angles[k]), float(margins[k, row])
        if worst > 0.0 and moves:
            angle, worst = _refine(model, numbers, row, angle, TURN / ANGLES)
        if worst <= 0.0:
            place = math.degrees(past(timeline.start_angle(model.manifest, numbers.values) + angle))
            faults.append(
                f"The linkage cannot be assembled at joint {info.joint!r}, worst at crank angle {place:.2f} deg "
                f"({info.description}: margin {worst:.4g})."
            )
    if faults:
        raise RequestError("\n".join(faults) + "\nChange the lengths of the bodies that meet at the joint.")
    for constant in model.manifest.constants:
        if constant.name.endswith(".turns") and not math.isfinite(numbers.values[constant.name]):
            what = constant.name.removeprefix("body.").removesuffix(".turns")
            raise RequestError(
                f"The angle of {what} changes by more than three eighths of a turn while the driver turns by 7.5 "
                "degrees: which way round is unknown. Change lengths so that no joint passes another so near."
            )


def check_assembled(model: LoadedModel, numbers: Numbers, t: float, there: Mapping[str, Any]) -> None:
    """Check every margin of the linkage at one instant alone, not over the turn.

    Parameters
    ----------
    t : the instant [s]
    there : arguments of generated functions at it, by name: t, u, p, c

    Raises
    ------
    RequestError
        A dyad cannot be assembled there; names its joint and the crank angle.
    """
    mechanism = model.manifest.mechanism
    if mechanism is None or not mechanism.margins:
        return
    kernel = model.kernel("assembly")
    kernel.run(there)
    (margins,) = kernel.outputs.values()
    heights = margins.tolist()
    if all(height > 0.0 for height in heights):  # NaN: it cannot be assembled
        return
    angle = math.degrees(timeline.crank_angle(model.manifest, numbers.values, t))
    faults = [
        f"The linkage cannot be assembled at joint {info.joint!r} at {t:.6g} s, crank angle {angle:.2f} deg "
        f"({info.description}: margin {height:.4g})."
        for info, height in zip(mechanism.margins, heights, strict=True)
        if not height > 0.0
    ]
    raise RequestError(
        "\n".join(faults)
        + "\nChange the lengths of the bodies that meet at the joint, or ask at an angle at which they "
        "reach each other."
    )


def _margins(model: LoadedModel, numbers: Numbers, angles: np.ndarray) -> np.ndarray:
    """Margins at angles past the start [rad], shape (angles, margins); NaN: it cannot be assembled."""
    at = timeline.turned(model.manifest, numbers.values, angles)
    arguments = {"t": 0.0, "p": numbers.p, "c": numbers.c}
    (found,) = model.loop("assembly", tuple(at))(len(angles), {**at, **arguments}).values()
    return np.where(np.isnan(found), -np.inf, found)


def _refine(model: LoadedModel, numbers: Numbers, row: int, angle: float, reach: float) -> tuple[float, float]:
    """Angle and value of the minimum of a margin within `reach` of a sample."""
    for _ in range(SWEEPS):
        angles = angle + reach * np.linspace(-1.0, 1.0, 2 * FINE + 1)
        heights = _margins(model, numbers, angles)[:, row]
        k = int(np.argmin(heights))
        angle, worst, reach = float(angles[k]), float(heights[k]), reach / FINE
    return angle, worst
