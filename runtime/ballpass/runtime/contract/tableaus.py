"""What an integration method of the stepper is: a tableau, exact figures as printed in its source, checked in shape.

A tableau is a frozen record of coefficients; it says what to compute and holds no code of a step.  The methods are the
files of `methods`, one each, and `method_registry` finds them.  The tests check that the figures have the orders
printed for them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeAlias

from ballpass.runtime.contract.errors import BallpassError

Row: TypeAlias = tuple[Fraction, ...]
Rows: TypeAlias = tuple[Row, ...]


class TableauError(BallpassError, ValueError):
    """Rows of a tableau have too many or too few figures; all of them are listed."""


def row_of(text: str) -> Row:
    """Figures separated by blanks, as printed: decimals or quotients of integers."""
    return tuple(Fraction(figure) for figure in text.split())


def rows_of(*texts: str) -> Rows:
    """One row of figures for each text."""
    return tuple(row_of(text) for text in texts)


def require_lengths(name: str, *needed: tuple[str, Sequence[Row], Sequence[int]]) -> None:
    """Raise `TableauError` if rows of the tableau `name`, given by label, have other lengths than needed."""
    faults = [
        f"\n  {label}: rows of {found} figures, needed {list(lengths)}"
        for label, rows, lengths in needed
        if (found := [len(row) for row in rows]) != list(lengths)
    ]
    if faults:
        raise TableauError(f"tableau {name}:{''.join(faults)}\n  remedy: compare the figures with the source")


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorEstimate:
    """Error weights ``e = b - b_hat`` of one embedded solution.

    Attributes
    ----------
    weights : e_i of the stages and, last, of the slope at the end of the step; shape (s + 1,)
    order : order of the embedded solution
    share : its share in the denominator of the combined error, see `ExplicitTableau`
    """

    weights: Row
    order: int
    share: Fraction = Fraction(1)


@dataclass(frozen=True, slots=True, kw_only=True)
class StabilityLimits:
    """Largest steps of an explicit method, as ``auto`` judges them (`driver/control.h`).

    Attributes
    ----------
    decay : step size times rate of a decay at the limit [1]
    undamped : step size times frequency of an oscillation without damping at the limit [1]
    damped, exponent : the same with the damping ratio r is ``damped r**exponent``, between `undamped` and `decay`
    reach : product of step size and dominant eigenvalue at which the steps themselves show the limit [1]
    """

    decay: float
    undamped: float
    damped: float
    exponent: float
    reach: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Tableau:
    """What methods have in common.

    Attributes
    ----------
    name : name of the method
    number : of the method in C, from 1 on; never changed, for exported programs take it
    order, dense_order : of solution and dense output
    nodes : c_i, shape (s,)
    matrix : a_ij, s rows, row i with i figures (0-based)
    weights : of the stages in the solution, shape (s,)
    dense_rows : of the stages in the dense output
    source : where the figures are printed
    """

    name: str
    number: int
    order: int
    dense_order: int
    nodes: Row
    matrix: Rows
    weights: Row
    dense_rows: Rows
    source: str

    @property
    def stages(self) -> int:
        """Slopes, or linear systems, of a step; the first slope of an explicit method is known from the step before."""
        return len(self.nodes)

    @property
    def error_exponent(self) -> int:
        """q in error ∝ h**q, for the step size controller."""
        raise NotImplementedError


@dataclass(frozen=True, slots=True, kw_only=True)
class ExplicitTableau(Tableau):
    """An explicit Runge–Kutta pair with dense output.

    ``k_i = f(t + c_i h, y0 + h sum_j a_ij k_j)`` for s stages, ``y1 = y0 + h sum_i b_i k_i``.  Stage s + 1 is the end
    slope ``f(t + h, y1)``, the first stage of the next step, whether the error estimate uses it or not.  The r stages
    of the dense output follow; they are needed only in steps that contain a requested point.

    Error: with ``E_m = h sum_i e_mi k_i`` and the root mean square norm scaled by ``atol + rtol |y|``, the error of the
    step is ``|E_1|**2 / sqrt(sum_m share_m |E_m|**2)``; for a single estimate that is ``|E_1|``.

    Dense output: with ``Delta = y1 - y0``, ``F1 = h k_1 - Delta``, ``F2 = 2 Delta - h (k_1 + k_end)``, ``F3, F4, ...``
    from `dense_rows` and ``x = 1 - theta``,

        y(t + theta h) = y0 + theta (Delta + x (F1 + theta (F2 + x (F3 + theta (F4 + x (...))))))

    so that it meets y0, y1 and the slopes there whatever the figures are.

    Attributes
    ----------
    weights : b_i
    error_estimates : at least one; the first has share 1
    dense_nodes : c_i of the stages of the dense output, shape (r,)
    dense_matrix : a_ij of these, r rows, row i with s + 1 + i figures
    dense_rows : d_mi of ``F_(m + 3) = h sum_i d_mi k_i``, each of shape (s + 1 + r,)
    stability : limits for a method that ``auto`` takes

    Raises
    ------
    TableauError : a row has too many or too few figures
    """

    error_estimates: tuple[ErrorEstimate, ...]
    dense_nodes: Row
    dense_matrix: Rows
    stability: StabilityLimits | None = None

    def __post_init__(self) -> None:
        stages, all_stages = self.stages, self.stages + 1 + len(self.dense_nodes)
        estimates = [estimate.weights for estimate in self.error_estimates]
        require_lengths(
            self.name,
            ("matrix", self.matrix, range(stages)),
            ("weights", (self.weights,), (stages,)),
            ("error weights", estimates, (stages + 1,) * len(estimates)),
            ("dense_matrix", self.dense_matrix, range(stages + 1, all_stages)),
            ("dense_rows", self.dense_rows, (all_stages,) * len(self.dense_rows)),
        )

    @property
    def error_exponent(self) -> int:
        """q in error ∝ h**q, for the step size controller."""
        lowest = min(estimate.order for estimate in self.error_estimates)
        return 2 * (self.error_estimates[0].order + 1) - (lowest + 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class RosenbrockTableau(Tableau):
    """A linearly implicit pair with dense output, in the form that needs no product with the Jacobian.

    With ``u_i = h sum_j gamma_ij k_j``, stage i solves

        (I / (h gamma) - J) u_i = f(t + c_i h, y0 + sum_j a_ij u_j) + sum_j C_ij u_j / h + h d_i f_t

    where J and f_t are exact and taken at (t, y0).  Then ``y1 = y0 + sum_i m_i u_i``, and the error of the step is the
    root mean square norm of ``sum_i e_i u_i`` scaled by ``atol + rtol |y|``.

    Dense output: with ``Delta = y1 - y0``, ``H_m = sum_i h_mi u_i`` and ``x = 1 - theta``,

        y(t + theta h) = y0 + theta (Delta + x (H1 + theta (H2 + theta H3)))

    so that it meets y0 and y1 whatever the figures are.

    Attributes
    ----------
    embedded_order : of the embedded solution
    gamma : the diagonal of gamma_ij
    coupling : C_ij, s rows, row i with i figures
    time_weights : d_i, the row sums of gamma_ij, shape (s,)
    weights : m_i
    error_weights : e_i, shape (s,)
    dense_rows : h_mi of H1, H2, ..., each of shape (s,).  The figures of the last stage are free as far as the order
        goes: its u is the error estimate, no larger than what the dense output leaves out

    Raises
    ------
    TableauError : a row has too many or too few figures
    """

    embedded_order: int
    gamma: Fraction
    coupling: Rows
    time_weights: Row
    error_weights: Row

    def __post_init__(self) -> None:
        size = self.stages
        require_lengths(
            self.name,
            ("matrix", self.matrix, range(size)),
            ("coupling", self.coupling, range(size)),
            (
                "time_weights, weights, error_weights",
                (self.time_weights, self.weights, self.error_weights),
                (size,) * 3,
            ),
            ("dense_rows", self.dense_rows, (size,) * len(self.dense_rows)),
        )

    @property
    def error_exponent(self) -> int:
        """q in error ∝ h**q, for the step size controller."""
        return self.embedded_order + 1
