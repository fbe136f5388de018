"""One step of an explicit or linearly implicit method in plain NumPy, straight from the formulas of the records."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from order_conditions import all_stages

from ballpass.runtime.contract.tableaus import ExplicitTableau, RosenbrockTableau, Row, Rows

Vector = NDArray[np.inexact]
Slope = Callable[[float, Vector], Vector]


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceStep:
    """End of a step, differences to the embedded solutions, and the dense output as a function of theta."""

    end: Vector
    errors: tuple[Vector, ...]
    dense: Callable[[float], Vector]


def floats(rows: Rows, size: int) -> NDArray[np.float64]:
    """Ragged rows as a rectangular array, shape (len(rows), size)."""
    array = np.zeros((len(rows), size))
    for place, row in enumerate(rows):
        array[place, : len(row)] = [float(number) for number in row]
    return array


def weighted(row: Row, vectors: Vector) -> Vector:
    """Sum of the vectors, shape (s, n), with the figures of a row; the row may be shorter."""
    return np.array([float(number) for number in row]) @ vectors[: len(row)]


def explicit_step(tableau: ExplicitTableau, slope: Slope, time: float, start: Vector, step: float) -> ReferenceStep:
    """All stages of an explicit method, those of the dense output included."""
    nodes = [float(c) for c in (*tableau.nodes, 1, *tableau.dense_nodes)]
    slopes = np.zeros((len(nodes), len(start)), dtype=start.dtype)
    for stage, row in enumerate(all_stages(tableau)):
        slopes[stage] = slope(time + nodes[stage] * step, start + step * weighted(row, slopes))
    end = start + step * weighted(tableau.weights, slopes)
    delta = end - start
    first, last = step * slopes[0], step * slopes[tableau.stages]
    terms = [delta, first - delta, 2 * delta - first - last]
    terms += [step * weighted(row, slopes) for row in tableau.dense_rows]

    def dense(theta: float) -> Vector:
        nested = np.zeros_like(start)
        for place in range(len(terms) - 1, -1, -1):
            nested = (theta if place % 2 == 0 else 1 - theta) * (terms[place] + nested)
        return start + nested

    errors = tuple(step * weighted(estimate.weights, slopes) for estimate in tableau.error_estimates)
    return ReferenceStep(end=end, errors=errors, dense=dense)


def rosenbrock_step(
    tableau: RosenbrockTableau,
    slope: Slope,
    jacobian: Vector,
    time_derivative: Vector,
    time: float,
    start: Vector,
    step: float,
    mass: Vector | None = None,
) -> ReferenceStep:
    """One step for ``mass y' = slope(t, y)``; Jacobian and time derivative at the beginning of the step.

    A singular mass matrix makes it an index-1 system.
    """
    mass = np.eye(len(start)) if mass is None else mass
    system = mass / (step * float(tableau.gamma)) - jacobian
    stages = np.zeros((tableau.stages, len(start)), dtype=start.dtype)
    for stage in range(tableau.stages):
        at = time + float(tableau.nodes[stage]) * step
        right_hand_side = slope(at, start + weighted(tableau.matrix[stage], stages))
        right_hand_side = right_hand_side + mass @ weighted(tableau.coupling[stage], stages) / step
        right_hand_side = right_hand_side + step * float(tableau.time_weights[stage]) * time_derivative
        stages[stage] = np.linalg.solve(system, right_hand_side)
    end = start + weighted(tableau.weights, stages)
    terms = [weighted(row, stages) for row in tableau.dense_rows]

    def dense(theta: float) -> Vector:
        nested = np.zeros_like(start)
        for term in reversed(terms):
            nested = term + theta * nested
        return start + theta * (end - start + (1 - theta) * nested)

    return ReferenceStep(end=end, errors=(weighted(tableau.error_weights, stages),), dense=dense)
