"""Claims on the linear systems of the linearly implicit methods: right for any matrix, pivoted where they must be."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from ballpass.derive import generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime.native.compile import find_compiler
from ballpass.runtime.native.driver_library import DRIVER, FLAGS
from ballpass.runtime.native.method_tables import METHOD_TABLES, method_tables

#: The driver's factorization and what it makes of a right-hand side, as it uses them in a stage.
HARNESS = """
#include <math.h>
#include "single.h"
int size(void) { return BP_NQ; }
int solve(const double *A, const double *B, double s, const double *R, double *kv)
{
    bp_matrix m;
    if (!bp_factorize(&m, A, B, s)) return -1;
    for (int i = 0; i < BP_NQ; i++) {
        kv[i] = 0.0;
        for (int j = 0; j < BP_NX; j++) kv[i] += m.solve[j][i] * R[j];
    }
    return m.pivoted;
}
"""

Solve = Callable[[np.ndarray, np.ndarray, float, np.ndarray], tuple[int, np.ndarray]]


@pytest.fixture(scope="module", params=["punching_press", "varying_compliance"])
def solve(
    request: pytest.FixtureRequest, scene_text: Callable[..., str], tmp_path_factory: pytest.TempPathFactory
) -> Solve:
    """Velocities' part kv of (s I - J) k = R, and whether it was pivoted; of four coordinates and of two."""
    compiler = find_compiler()
    if compiler is None:
        pytest.skip("no C compiler")
    folder: Path = generate(
        scene_from_text(scene_text(request.param), request.param), tmp_path_factory.mktemp("s") / "s"
    )
    source, library = folder.parent / "harness.c", folder.parent / "harness.so"
    source.write_text(HARNESS)
    (folder.parent / METHOD_TABLES).write_text(method_tables(), encoding="utf-8")
    include = [f"-I{place}" for place in (DRIVER, folder, folder.parent)]
    command = [
        *compiler.command,
        *FLAGS,
        "-std=gnu99",
        "-shared",
        "-fPIC",
        *include,
        str(source),
        "-o",
        str(library),
        "-lm",
    ]
    subprocess.run(command, check=True)
    harness = ctypes.CDLL(str(library))
    n = harness.size()

    def call(A: np.ndarray, B: np.ndarray, s: float, R: np.ndarray) -> tuple[int, np.ndarray]:
        given = [np.ascontiguousarray(v[:n, :n] if v.ndim == 2 else v[: 2 * n]) for v in (A, B, R)]
        found = np.zeros(n)
        address = [v.ctypes.data_as(ctypes.c_void_p) for v in (*given, found)]
        pivoted = harness.solve(address[0], address[1], ctypes.c_double(s), address[2], address[3])
        return pivoted, found

    return call


def expected(A: np.ndarray, B: np.ndarray, s: float, R: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """The same from the whole system of 2 n equations, by NumPy; and the matrix W = s I - B - A/s."""
    whole = s * np.eye(2 * n) - np.block([[np.zeros((n, n)), np.eye(n)], [A[:n, :n], B[:n, :n]]])
    return np.linalg.solve(whole, R[: 2 * n])[n:], s * np.eye(n) - B[:n, :n] - A[:n, :n] / s


def test_systems_of_any_kind_are_solved_and_pivoted_where_rows_are_not_dominated(solve: Solve) -> None:
    """Two thousand random Jacobians, from steps that resolve the motion to steps far too long for it."""
    rng = np.random.default_rng(20261121)
    seen = {0: 0, 1: 0}
    for _ in range(2000):
        A, B = rng.normal(size=(4, 4)), rng.normal(size=(4, 4))
        s, R = float(10.0 ** rng.uniform(-1.5, 1.5)), rng.normal(size=8)
        pivoted, found = solve(A, B, s, R)
        n = len(found)
        right, W = expected(A, B, s, R, n)
        rest = np.abs(W).sum(axis=1) - np.abs(np.diag(W))
        assert pivoted == int(not np.all(np.abs(np.diag(W)) >= rest))
        seen[pivoted] += 1
        assert np.allclose(found, right, rtol=0.0, atol=1e-13 * np.linalg.cond(W) * np.abs(right).max())
    assert min(seen.values()) > 200


def test_a_zero_on_the_diagonal_is_no_obstacle(solve: Solve) -> None:
    """Elimination without pivoting would divide by it."""
    swap = np.array([[0.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0]])
    R = np.arange(1.0, 9.0)
    pivoted, found = solve(np.zeros((4, 4)), np.eye(4) - swap, 1.0, R)  # W = swap
    n = len(found)
    assert pivoted == 1
    assert found == pytest.approx((swap[:n, :n] @ R[n : 2 * n]).tolist(), abs=1e-15)


def test_a_singular_system_says_so(solve: Solve) -> None:
    pivoted, _ = solve(np.zeros((4, 4)), np.eye(4), 1.0, np.ones(8))
    assert pivoted == -1
