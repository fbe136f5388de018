"""Newton's method for positions at rest, also from a start without any contact.

In: forces on the coordinates and their stiffness.  Out: positions where the forces vanish, or the last positions.

Pseudo-transient continuation: ``q += (h I + K)^-1 f(q)`` with h falling as the residual falls.  Without
contact (K = 0) this moves along the force; with contact it is Newton's method.  (Kelley and Keyes, SIAM
J. Numer. Anal. 35 (1998) 508, doi:10.1137/S0036142996304796.)
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

#: First step [m, or the coordinate's unit]: well inside any clearance.
FIRST_STEP = 1e-9

#: Least h, relative to the largest stiffness: along a free direction nothing moves.
FREE = 1e-10


class SearchEnd(Enum):
    """How a search for equilibrium ended."""

    FOUND = "found"
    UNHELD = "nothing holds the body"
    STUCK = "the residual does not fall"


@dataclass(frozen=True, slots=True, kw_only=True)
class RestPositions:
    """Positions, the force left there, how the search ended, and its iterations."""

    q: np.ndarray
    force: np.ndarray
    end: SearchEnd
    iterations: int


def settle(
    force: Callable[[np.ndarray], np.ndarray],
    stiffness: Callable[[np.ndarray], np.ndarray],
    start: np.ndarray,
    *,
    weights: np.ndarray,
    done: Callable[[np.ndarray, np.ndarray, np.ndarray], bool],
    gone: Callable[[np.ndarray], bool],
    iterations: int,
    free: float = FREE,
) -> RestPositions:
    """Positions at rest.

    Parameters
    ----------
    force, stiffness : force on each coordinate, and -d(force)/d(position)
    start : positions, shape (coordinates,)
    weights : of the coordinates in the residual that has to fall
    done : whether the forces count as zero, from positions, force and stiffness there
    gone : whether these positions are so far away that nothing holds the body
    iterations : most of them
    free : smallest stiffness, also in place of zero, relative to the largest
    """
    q, net = start.copy(), force(start)
    size = float(np.linalg.norm(weights * net))
    if size == 0.0:
        return RestPositions(q=q, force=net, end=SearchEnd.FOUND, iterations=0)
    held = float(np.linalg.norm(net)) / (FIRST_STEP * (1.0 + float(np.max(np.abs(q)))))
    matrix = stiffness(q)
    for iteration in range(1, iterations + 1):
        held = max(held, free * float(np.max(np.abs(matrix))))
        try:
            trial = q + np.linalg.solve(held * np.eye(len(q)) + matrix, net)
        except np.linalg.LinAlgError:
            break
        there = force(trial)
        size_there = float(np.linalg.norm(weights * there))
        if not math.isfinite(size_there) or size_there > 1.5 * size:
            held *= 8.0
            continue
        if gone(trial):
            return RestPositions(q=q, force=net, end=SearchEnd.UNHELD, iterations=iteration)
        q, net, matrix = trial, there, stiffness(trial)
        if size_there == 0.0 or done(q, net, matrix):
            return RestPositions(q=q, force=net, end=SearchEnd.FOUND, iterations=iteration)
        held /= 4.0 * min(max(size / size_there, 1.0), 16.0)
        size = size_there
    return RestPositions(q=q, force=net, end=SearchEnd.STUCK, iterations=iterations)
