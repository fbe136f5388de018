"""Condition numbers of the reaction matrix A(q) of Eq. (1), A r = b, over a turn.

In: a model with a mechanism and its numbers.  Out: `Conditioning`: the largest condition number in a turn, of the
matrix as it stands (SI, with forces beside moments) and of the matrix with rows and columns scaled to like size, with
the crank angles where they are met.  The second one grows near a position where the linkage locks: reactions grow like
it there, and so does the effect of errors of lengths and masses on them.

Scaling: rows and columns are divided by the roots of their largest entries, in turns (D. Ruiz, A scaling algorithm to
equilibrate both rows and columns norms in matrices, RAL-TR-2001-034).
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ballpass.runtime.contract.errors import BallpassWarning
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.request.assembly import angles_reached
from ballpass.runtime.time import timeline
from ballpass.runtime.time.turning import TURN, past

if TYPE_CHECKING:
    from ballpass.runtime.contract.parameters import Numbers

#: Name of the generated function with A.
FUNCTION = "reaction_system"

#: Angles evaluated in a turn; around the largest value the maximum is refined.
ANGLES = 360

#: Sweeps around the largest sample, each so many times finer than the one before.
SWEEPS, FINE = 3, 16

#: Scaled condition number above which a warning is given [1].
BOUND = 1e4

#: Passes of the scaling; each halves the logarithm of the remaining imbalance.
PASSES = 12


class ConditioningWarning(BallpassWarning):
    """The reactions of a linkage near a position where it locks."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditioning:
    """Largest condition numbers of A(q) in a turn, in the 2-norm.

    Attributes
    ----------
    unscaled, scaled : of the matrix in SI, and with rows and columns of like size [1]
    unscaled_angle, scaled_angle : crank angles where they are met, in [0, 2 pi) [rad]
    """

    unscaled: float
    scaled: float
    unscaled_angle: float
    scaled_angle: float


def has_reactions(model: LoadedModel) -> bool:
    """Whether the model has a mechanism, and so the matrix."""
    return model.manifest.mechanism is not None and model.has(FUNCTION)


def conditioning(model: LoadedModel, numbers: Numbers, end: float = math.inf) -> Conditioning:
    """Condition numbers over the angles that the driver reaches up to a time [s], by default a turn.

    Warns
    -----
    ConditioningWarning
        The scaled condition number passes `BOUND`; names the crank angle.
    """
    manifest, kernel = model.manifest, model.kernel(FUNCTION)
    low, high = angles_reached(model, numbers, end)
    count = ANGLES * max(round((high - low) / TURN), 1)  # gears repeat after several turns
    step = (high - low) / count

    def matrices(angles: np.ndarray) -> np.ndarray:
        """At angles past the start angle."""
        at = timeline.turned(manifest, numbers.values, angles)
        fixed = {"t": 0.0, "p": numbers.p, "c": numbers.c}
        return np.array([kernel({**fixed, **{n: rows[k] for n, rows in at.items()}}) for k in range(len(angles))])

    angles = low + step * np.arange(count if step else 1)
    sampled, found = matrices(angles), []
    for condition in (_condition, lambda m: _condition(equilibrate(m))):
        values = condition(sampled)
        k = int(np.argmax(values))
        angle, largest = float(angles[k]), float(values[k])
        if step and math.isfinite(largest):
            reach = step
            for _ in range(SWEEPS):
                near = angle + reach * np.linspace(-1.0, 1.0, 2 * FINE + 1)
                near = near if count > ANGLES or high - low == TURN else near.clip(low, high)
                values = condition(matrices(near))
                k = int(np.argmax(values))
                angle, largest, reach = float(near[k]), float(values[k]), reach / FINE
        found.append((largest, float(past(timeline.start_angle(manifest, numbers.values) + angle))))
    (whole, whole_angle), (equal, equal_angle) = found
    if not equal <= BOUND:
        warnings.warn(
            f"The reactions are ill-conditioned at crank angle {math.degrees(equal_angle):.2f} deg: condition number "
            f"{equal:.3g} of the scaled matrix of Eq. (1), above {BOUND:.0e}. The linkage nearly locks there, and "
            "errors of lengths and masses grow that much in the forces. Change the lengths of the bodies, or keep the "
            "driver away from this angle.",
            ConditioningWarning,
            stacklevel=2,
        )
    return Conditioning(unscaled=whole, scaled=equal, unscaled_angle=whole_angle, scaled_angle=equal_angle)


def equilibrate(matrix: np.ndarray) -> np.ndarray:
    """Matrices with rows and columns scaled so that the largest entry of each is one in size; shape (..., n, n)."""
    scaled = matrix.copy()
    for _ in range(PASSES):
        for axis in (-2, -1):
            largest = np.max(np.abs(scaled), axis=axis, keepdims=True)
            scaled = scaled / np.sqrt(np.where(largest > 0.0, largest, 1.0))
    return scaled


def _condition(matrix: np.ndarray) -> np.ndarray:
    finite = np.all(np.isfinite(matrix), axis=(-2, -1))
    return np.where(finite, np.linalg.cond(np.where(finite[..., None, None], matrix, 0.0)), math.inf)
