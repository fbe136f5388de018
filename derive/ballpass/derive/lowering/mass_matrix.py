"""Accelerations from mass matrix and forcing, M a = f, and how they change.

A diagonal M costs a division a row; any other M(q) is solved by CasADi's L D L^T, unrolled, without pivoting (M is
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
    factors : of M, as `casadi.ldl` gives them; None where it is diagonal
    """

    value: ca.SX
    held: ca.SX
    residual: ca.SX
    factors: tuple[ca.SX, ca.SX, list[int]] | None

    def solve(self, change: ca.SX) -> ca.SX:
        """Change of the accelerations, column by column, from that of the residual."""
        if self.factors is None:
            return change
        solved = ca.sparsify(ca.ldl_solve(ca.densify(change), *self.factors))
        return ca.SX(ca.substitute(solved, self.held, self.value))


def accelerations(system: System, visit: Visitor) -> Accelerations:
    """Accelerations of a system's coordinates, with what their derivatives follow from."""
    n = len(system.coordinates)
    if system.mass.is_diagonal():
        value = ca.vertcat(*(visit(system.forcing[k] / system.mass[k, k]) for k in range(n)))
        return Accelerations(value=value, held=ca.SX(0, 1), residual=value, factors=None)
    lower = ca.SX(n, n)
    for i in range(n):
        for j in range(i + 1):
            lower[i, j] = visit(system.mass[i, j])
    mass = ca.tril2symm(ca.sparsify(lower))
    forcing = ca.vertcat(*(visit(entry) for entry in system.forcing))
    # no other order of rows: the driver's angle, to which all are coupled, comes last
    factors = ca.ldl(mass, False)
    held = ca.SX.sym("a", n)
    value = ca.ldl_solve(forcing, *factors)
    return Accelerations(value=value, held=held, residual=forcing - mass @ held, factors=factors)
