"""Minimum by IPOPT, an interior point method for smooth functions that is inside CasADi.

In: values and slopes at points, a start.  Out: `BundleMinimum`.  IPOPT trusts one slope and stops short of a kink: the
tangent planes of `bundle` continue from the best point that it saw, find what is left, and say whether it is a kink.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import casadi
import numpy as np

from ballpass.runtime.search.bundle import BundleMinimum, Plane, minimize_by_planes

#: Most evaluations, for at a kink IPOPT does not end, and its tolerance: planes do the rest [1].
EVALUATIONS, CLOSE = 50, 1e-5


def minimize_by_ipopt(evaluate: Callable[[np.ndarray], Plane], start: np.ndarray) -> BundleMinimum:
    """Search within 0 to 1 in each variable; the functions are of the order of one."""
    seen, failed = [evaluate(start)], list[BaseException]()
    size = len(seen[0].values)

    def at(x: np.ndarray) -> Plane:
        if np.array_equal(x, seen[-1].x):
            return seen[-1]
        if failed or len(seen) == EVALUATIONS:  # IPOPT takes no exceptions, and ends by what is no number
            return Plane(x=x, values=np.full(size, np.nan), slopes=np.full((size, len(x)), np.nan))
        try:
            seen.append(evaluate(x))
        except BaseException as error:
            failed.append(error)
        return at(x)

    slopes = _Callback("slopes", [len(start), size], (size, len(start)), lambda x: at(x).slopes)
    values = _Callback("values", [len(start)], (size, 1), lambda x: at(x).values, slopes)
    x = casadi.MX.sym("x", len(start))
    every = values(x)
    ipopt = {"hessian_approximation": "limited-memory", "tol": CLOSE, "max_iter": EVALUATIONS}
    silent = {"print_time": False, "show_eval_warnings": False}
    problem: Any = {"x": x, "f": every[0], "g": every[1:]}
    options: Any = {"ipopt": {**ipopt, "print_level": 0, "sb": "yes"}, **silent}
    casadi.nlpsol("search", "ipopt", problem, options)(x0=start, lbx=0.0, ubx=1.0, ubg=0.0)
    if failed:
        raise failed[0]
    found = minimize_by_planes(evaluate, min(seen, key=lambda one: one.merit).x)
    return replace(found, trace=(*seen, *found.trace))


class _Callback(casadi.Callback):
    """A Python function of a vector as a function of CasADi; its Jacobian is another one."""

    def __init__(
        self,
        name: str,
        sizes: list[int],
        shape: tuple[int, int],
        function: Callable[[np.ndarray], np.ndarray],
        slopes: _Callback | None = None,
    ) -> None:
        super().__init__()
        self._sizes, self._shape, self._function, self._slopes = sizes, shape, function, slopes
        self.construct(name)

    def get_n_in(self) -> int:
        return len(self._sizes)

    def get_sparsity_in(self, k: int) -> casadi.Sparsity:
        return casadi.Sparsity.dense(self._sizes[k])

    def get_sparsity_out(self, _k: int) -> casadi.Sparsity:
        return casadi.Sparsity.dense(*self._shape)

    def eval(self, given: Sequence[casadi.DM]) -> list[np.ndarray]:
        return [self._function(np.array(given[0]).ravel())]

    def has_jacobian(self) -> bool:
        return self._slopes is not None

    def get_jacobian(self, *_names: Any) -> Any:
        return self._slopes
