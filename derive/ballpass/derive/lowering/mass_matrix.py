"""Accelerations from mass matrix and forcing: M a = f.

A constant or diagonal row costs a division; any other M(q) is solved by L D L^T, unrolled, without pivoting (M is
positive definite), its zeros left out.
"""

from __future__ import annotations

import casadi as ca

from ballpass.derive.lowering.visitor import Visitor
from ballpass.derive.system import System


def accelerations(system: System, visit: Visitor) -> list[ca.SX]:
    """Accelerations of a system's coordinates."""
    n = len(system.coordinates)
    if system.mass.is_diagonal():
        return [visit(system.forcing[k] / system.mass[k, k]) for k in range(n)]
    mass = [[visit(system.mass[i, j]) for j in range(i + 1)] for i in range(n)]
    return solve_ldl(mass, [visit(entry) for entry in system.forcing])


def solve_ldl(lower: list[list[ca.SX]], right: list[ca.SX]) -> list[ca.SX]:
    """Solution of M a = right for the lower triangle of a symmetric positive definite M."""
    n = len(right)
    factor = [[ca.SX(0.0)] * n for _ in range(n)]
    diagonal: list[ca.SX] = []
    for i in range(n):
        scaled: list[ca.SX] = []  # L[i][j] D[j]
        for j in range(i):
            entry = lower[i][j]
            for k in range(j):
                entry = entry - scaled[k] * factor[j][k]
            scaled.append(entry)
            factor[i][j] = entry / diagonal[j]
        pivot = lower[i][i]
        for j in range(i):
            pivot = pivot - scaled[j] * factor[i][j]
        diagonal.append(pivot)
    solution = list(right)
    for i in range(n):
        for j in range(i):
            solution[i] = solution[i] - factor[i][j] * solution[j]
    for i in reversed(range(n)):
        solution[i] = solution[i] / diagonal[i]
        for j in range(i + 1, n):
            solution[i] = solution[i] - factor[j][i] * solution[j]
    return solution
