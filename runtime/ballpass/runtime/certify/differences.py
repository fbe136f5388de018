"""Derivatives by differences: the second route that generated derivatives are compared with.

In: a function of one number, a point, a largest step.  Out: value and error estimate, for each entry of the function's
result.

Central differences at steps that halve are extrapolated to step zero (Richardson), and for each entry the element of
the triangle with the smallest estimated error is taken: large steps suffer from curvature and from kinks between the
two points, small ones from rounding, and the estimate sees both.  An element counts only with one of the same order
from larger steps beside it.  (C. J. F. Ridders, Adv. Eng. Software 4 (1982) 75,
doi:10.1016/S0141-1195(82)80057-0.)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Steps of a triangle: the last is 2^-11 of the first.
STEPS = 12

#: So many have none of the same order beside the first extrapolation: its error is its distance from the wider one.
FEWEST = 2

#: Columns of the triangle: orders 2, 4, 6, 8; more gain nothing over rounding.
ORDERS = 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Difference:
    """A derivative by differences, entry by entry in the shape of the function's result.

    Attributes
    ----------
    value : derivative [result's unit / argument's unit]
    error : estimate of its error, same unit; infinite where no step gave finite numbers
    """

    value: Array
    error: Array


def richardson(
    function: Callable[[float], float | Array],
    at: float,
    scale: float,
    *,
    resolution: float | Array = 0.0,
) -> Difference:
    """Derivative of a function of one number by extrapolated central differences.

    Parameters
    ----------
    function : number to number or array of one shape; it should be as exact as possible: the step divides its noise
    at : the point
    scale : largest step; a length over which the function changes smoothly; a tenth of it gives the same accuracy
    resolution : error of the function's values besides rounding (an integrator's tolerance, say), in its unit
    """
    upper, lower, width = [], [], []
    for k in range(STEPS):
        h = scale * 0.5**k
        above, below = at + h, at - h
        if above - below == 0.0:
            break
        upper.append(np.asarray(function(above), dtype=float))
        lower.append(np.asarray(function(below), dtype=float))
        width.append(above - below)  # the steps as they are after rounding
    return extrapolated(np.array(upper), np.array(lower), np.array(width), resolution)


def extrapolated(upper: Array, lower: Array, width: Array, resolution: float | Array = 0.0) -> Difference:
    """Derivative from values on both sides of a point.

    Parameters
    ----------
    upper, lower : values of a function above and below, at steps that halve, shape (steps, ...)
    width : distances between both, shape (steps,)
    resolution : error of the values besides rounding
    """
    wide = width.reshape(-1, *[1] * (upper.ndim - 1))
    with np.errstate(invalid="ignore", over="ignore"):
        column = (upper - lower) / wide
        noise = (np.finfo(float).eps * np.maximum(np.abs(upper), np.abs(lower)) + resolution) / wide
        best, error = column[0].copy(), np.full(column[0].shape, np.inf)
        for order in range(1, min(len(width), ORDERS)):
            fresh = column[1:] + (column[1:] - column[:-1]) / (4.0**order - 1.0)
            if len(width) == FEWEST:
                best, error = fresh[0], np.abs(fresh[0] - column[0]) + 2.0 * noise[-1]
            for row, value in enumerate(fresh[1:], start=1):
                k = row + order
                # neighbours in the triangle, and the same order of larger steps: one sequence may agree by chance;
                # extrapolation magnifies rounding by less than two
                neighbours = np.abs(value - np.stack([column[row + 1], column[row], fresh[row - 1]]))
                spread = np.max(neighbours, axis=0) + 2.0 * noise[k]
                better = np.isfinite(spread) & (spread < error)
                best, error = np.where(better, value, best), np.where(better, spread, error)
            column = fresh
    return Difference(value=best, error=error)
