"""Derivatives by differences: the second route that generated derivatives are compared with.

In: a function of one number, a point, a largest step.  Out: value, error estimate and step, for each entry of the
function's result.

Central differences at steps that halve are extrapolated to step zero (Richardson), and for each entry the element of
the triangle with the smallest estimated error is taken: large steps suffer from curvature and from kinks between the
two points, small ones from rounding, and the estimate sees both.  (C. J. F. Ridders, Adv. Eng. Software 4 (1982) 75,
doi:10.1016/S0141-1195(82)80057-0.)
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.contract.errors import RequestError

Array = NDArray[np.float64]

#: Steps of a triangle: the last is 2^-11 of the first.
STEPS = 12

#: Columns of the triangle: orders 2, 4, 6, 8; more gain nothing over rounding.
ORDERS = 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Difference:
    """A derivative by differences, entry by entry in the shape of the function's result.

    Attributes
    ----------
    value : derivative [result's unit / argument's unit]
    error : estimate of its error, same unit; infinite where no step gave finite numbers
    step : step of the element taken, in the argument's unit
    evaluations : calls of the function
    """

    value: Array
    error: Array
    step: Array
    evaluations: int


def richardson(
    function: Callable[[float], float | Array],
    at: float,
    scale: float,
    *,
    steps: int = STEPS,
    resolution: float | Array = 0.0,
) -> Difference:
    """Derivative of a function of one number by extrapolated central differences.

    Parameters
    ----------
    function : number to number or array of one shape; it should be as exact as can be: its noise is divided by the step
    at : where
    scale : largest step; a length over which the function changes smoothly, a tenth of it is as good
    steps : number of steps, each half the one before
    resolution : error of the function's values besides rounding (an integrator's tolerance, say), in its unit

    Raises
    ------
    RequestError
        A point or step that is no finite number, a step of zero or less, fewer than two steps.
    """
    if not (math.isfinite(at) and math.isfinite(scale) and scale > 0.0 and steps >= 2):
        raise RequestError(
            f"richardson: a finite point, a finite step above 0 and at least 2 steps are expected, not {at!r}, "
            f"{scale!r} and {steps!r}."
        )
    best: Array | None = None
    error = chosen = np.zeros(0)
    row: list[Array] = []
    for k in range(steps):
        h = scale * 0.5**k
        above, below = at + h, at - h
        width = above - below  # the steps as they are after rounding
        if width == 0.0:
            break
        upper, lower = np.asarray(function(above), dtype=float), np.asarray(function(below), dtype=float)
        with np.errstate(invalid="ignore", over="ignore"):
            fresh = [(upper - lower) / width]
            noise = (np.finfo(float).eps * np.maximum(np.abs(upper), np.abs(lower)) + resolution) / width
            for j in range(1, min(k, ORDERS - 1) + 1):
                fresh.append(fresh[j - 1] + (fresh[j - 1] - row[j - 1]) / (4.0**j - 1.0))
        if best is None:
            best, error, chosen = fresh[0].copy(), np.full(fresh[0].shape, np.inf), np.full(fresh[0].shape, h)
        for j in range(1, len(fresh)):
            with np.errstate(invalid="ignore", over="ignore"):
                # neighbours in the triangle; extrapolation magnifies rounding by less than two
                spread = np.maximum(np.abs(fresh[j] - fresh[j - 1]), np.abs(fresh[j] - row[j - 1])) + 2.0 * noise
            better = np.isfinite(spread) & (spread < error)
            best, error, chosen = (
                np.where(better, fresh[j], best),
                np.where(better, spread, error),
                np.where(better, h, chosen),
            )
        row = fresh
    if best is None:
        raise RequestError(f"richardson: the step {scale!r} vanishes beside the point {at!r}. Give a larger step.")
    return Difference(value=best, error=error, step=chosen, evaluations=2 * (k + 1))
