"""Minimum by SLSQP of SciPy, sequential quadratic programs for smooth functions.

In: values and slopes at points, a start.  Out: `BundleMinimum`.  SLSQP trusts one slope and stops short of a kink: the
tangent planes of `bundle` continue from the best point that it saw.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize

from ballpass.runtime.search.bundle import BundleMinimum, Plane, minimize_by_planes

#: Most evaluations, for at a kink SLSQP does not converge, and its tolerance: planes do the rest [1].
EVALUATIONS, CLOSE = 50, 1e-10


def minimize_by_slsqp(evaluate: Callable[[np.ndarray], Plane], start: np.ndarray) -> BundleMinimum:
    """Search within 0 to 1 in each variable; the functions are of the order of one."""
    seen = [evaluate(start)]

    def at(x: np.ndarray) -> Plane:
        if not np.array_equal(x, seen[-1].x):
            if len(seen) == EVALUATIONS:
                raise StopIteration
            seen.append(evaluate(np.clip(x, 0.0, 1.0)))
        return seen[-1]

    kept = {"type": "ineq", "fun": lambda x: -at(x).values[1:], "jac": lambda x: -at(x).slopes[1:]}
    with suppress(StopIteration):
        minimize(
            lambda x: at(x).values[0],
            start,
            jac=lambda x: at(x).slopes[0],
            bounds=[(0.0, 1.0)] * len(start),
            constraints=[kept] if len(seen[0].values) > 1 else [],
            method="SLSQP",
            options={"maxiter": EVALUATIONS, "ftol": CLOSE},
        )
    found = minimize_by_planes(evaluate, min(seen, key=lambda one: one.merit).x)
    return replace(found, trace=(*seen, *found.trace))
