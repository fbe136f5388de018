"""Claims about the solution of M(q) a = f in generated code."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from ballpass.derive.lowering.functions import operations
from ballpass.derive.lowering.mass_matrix import factorize


def solver(n: int, pattern: np.ndarray) -> ca.Function:
    m, f = ca.SX.sym("M", n, n), ca.SX.sym("f", n)
    lower = [[m[i, j] if pattern[i, j] else ca.SX(0.0) for j in range(i + 1)] for i in range(n)]
    return ca.Function("solve", [m, f], [ca.vertcat(*factorize(lower).solve(ca.vertsplit(f)))])


@pytest.mark.parametrize("n", [1, 2, 3, 7])
def test_any_positive_definite_matrix_is_solved_as_lapack_does(n: int) -> None:
    rng = np.random.default_rng(n)
    root = rng.normal(size=(n, n))
    matrix, right = root @ root.T + 0.1 * np.eye(n), rng.normal(size=n)
    found = solver(n, np.ones((n, n), dtype=bool))(matrix, right).full()[:, 0]
    assert found == pytest.approx(np.linalg.solve(matrix, right), rel=1e-10)


def test_zeros_of_an_arrow_cost_nothing_when_its_point_comes_last() -> None:
    """Displacements first, the driver's angle last: no fill-in, so that the cost grows with n and not with n cubed."""
    counts = []
    for n in (4, 8):
        pattern = np.eye(n, dtype=bool)
        pattern[-1] = True
        counts.append(operations(solver(n, pattern)))
        rng = np.random.default_rng(0)
        matrix = np.diag(rng.uniform(1, 2, n))
        matrix[-1, :-1] = matrix[:-1, -1] = 0.1
        right = rng.normal(size=n)
        assert solver(n, pattern)(matrix, right).full()[:, 0] == pytest.approx(
            np.linalg.solve(matrix, right), rel=1e-12, abs=0.0
        )
    assert counts[1] < 2.5 * counts[0]
