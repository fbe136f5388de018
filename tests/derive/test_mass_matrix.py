"""Claims about the solution of M(q) a = f in generated code."""

from __future__ import annotations

from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
import sympy as sp

from ballpass.derive.lowering.functions import operations
from ballpass.derive.lowering.mass_matrix import accelerations


def solver(n: int, pattern: np.ndarray) -> ca.Function:
    m, f = ca.SX.sym("M", n, n), ca.SX.sym("f", n)
    mass = sp.Matrix(n, n, lambda i, j: sp.Symbol(f"m{max(i, j)}_{min(i, j)}") if pattern[max(i, j), min(i, j)] else 0)
    known = {sp.Symbol(f"m{i}_{j}"): m[i, j] for i in range(n) for j in range(i + 1)}
    known |= {sp.Symbol(f"f{i}"): f[i] for i in range(n)} | {sp.S.Zero: ca.SX(0.0)}
    system = SimpleNamespace(coordinates=range(n), mass=mass, forcing=sp.Matrix([sp.Symbol(f"f{i}") for i in range(n)]))
    return ca.Function("solve", [m, f], [accelerations(system, known.__getitem__).value])  # type: ignore[arg-type]


@pytest.mark.parametrize("n", [2, 3, 7])
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
