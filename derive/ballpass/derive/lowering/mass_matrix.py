"""Accelerations from mass matrix and forcing, M a = f, and how they change.

A constant or diagonal row costs a division; any other M(q) is solved by L D L^T, unrolled, without pivoting (M is
positive definite), its zeros left out.  Derivatives come from the balance itself, M da = d(f - M a) with a held: the
factors are those of the solution, which differentiating its elimination would compute again for every direction.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from ballpass.derive.lowering.visitor import Visitor
from ballpass.derive.system import System


@dataclass(frozen=True, slots=True, kw_only=True)
class Accelerations:
    """Accelerations of a system's coordinates.

    Attributes
    ----------
    value : of each coordinate
    held : symbols that stand for them in `residual`; none where M is diagonal
    residual : f - M a; the accelerations themselves where M is diagonal
    factors : of M; None where it is diagonal
    """

    value: ca.SX
    held: ca.SX
    residual: ca.SX
    factors: Factors | None

    def solve(self, change: ca.SX) -> ca.SX:
        """Change of the accelerations, column by column, from that of the residual."""
        if self.factors is None:
            return change
        dense = ca.densify(change)
        columns = [ca.vertcat(*self.factors.solve(ca.vertsplit(dense[:, k]))) for k in range(dense.size2())]
        return ca.SX(ca.substitute(ca.sparsify(ca.horzcat(*columns)), self.held, self.value))


def accelerations(system: System, visit: Visitor) -> Accelerations:
    """Accelerations of a system's coordinates, with what their derivatives follow from."""
    n = len(system.coordinates)
    if system.mass.is_diagonal():
        value = ca.vertcat(*(visit(system.forcing[k] / system.mass[k, k]) for k in range(n)))
        return Accelerations(value=value, held=ca.SX(0, 1), residual=value, factors=None)
    mass = [[visit(system.mass[i, j]) for j in range(i + 1)] for i in range(n)]
    forcing = [visit(entry) for entry in system.forcing]
    factors = factorize(mass)
    held = ca.SX.sym("a", n)
    pull = ca.tril2symm(ca.vertcat(*(ca.horzcat(*row, ca.SX(1, n - len(row))) for row in mass))) @ held
    return Accelerations(
        value=ca.vertcat(*factors.solve(forcing)), held=held, residual=ca.vertcat(*forcing) - pull, factors=factors
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Factors:
    """L (rows below the diagonal) and D of a symmetric positive definite matrix L D L^T."""

    lower: tuple[tuple[ca.SX, ...], ...]
    diagonal: tuple[ca.SX, ...]

    def solve(self, right: list[ca.SX]) -> list[ca.SX]:
        """Solution for one right-hand side."""
        n = len(right)
        solution = list(right)
        for i in range(n):
            for j in range(i):
                solution[i] = solution[i] - self.lower[i][j] * solution[j]
        for i in reversed(range(n)):
            solution[i] = solution[i] / self.diagonal[i]
            for j in range(i + 1, n):
                solution[i] = solution[i] - self.lower[j][i] * solution[j]
        return solution


def factorize(lower: list[list[ca.SX]]) -> Factors:
    """Factors of M from its lower triangle, row by row."""
    factor: list[list[ca.SX]] = []
    diagonal: list[ca.SX] = []
    for i, row in enumerate(lower):
        scaled: list[ca.SX] = []  # L[i][j] D[j]
        factor.append([])
        for j in range(i):
            entry = row[j]
            for k in range(j):
                entry = entry - scaled[k] * factor[j][k]
            scaled.append(entry)
            factor[i].append(entry / diagonal[j])
        pivot = row[i]
        for j in range(i):
            pivot = pivot - scaled[j] * factor[i][j]
        diagonal.append(pivot)
    return Factors(lower=tuple(map(tuple, factor)), diagonal=tuple(diagonal))
