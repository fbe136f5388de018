"""Minimum of a function with kinks, under bounds and constraints: linear programs over tangent planes.

In: values and slopes at points, a start.  Out: `BundleMinimum`.

A peak over balls and time is the largest of smooth functions, and its least value lies on a kink as a rule.  There one
slope points the wrong way whichever side it is from, and a method that trusts it stops short.  Here the tangent planes
at points seen nearby stand together: a linear program (HiGHS, of SciPy) finds the least of the highest plane within a
box about the best point.  A step that does not lessen the function makes the box smaller and leaves its plane behind,
which is the slope from the other side.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linprog

#: Usual half width of the first and largest box, and that at which the search is done; most evaluations.
BOX, DONE, EVALUATIONS = 0.1, 1e-7, 300

#: Planes within so many half widths of the best point are taken: a box is halved after a step to its edge [1].
NEAR = 4.5

#: Share of the promised decrease that a step must give; planes kept; penalty of a violated constraint.
ENOUGH, PLANES, PENALTY = 0.1, 24, 1e3

#: Distances from the optimum at which both sides of it are compared [1].
BESIDE, NEARER = 1e-5, 1e-6

#: What stays of a difference between the sides from the one distance to the other at a kink or a jump: at a smooth
#: optimum a tenth does.  Smallest jump; smallest change of slope, in shares of the largest slope seen [1].
STAYS, JUMP, CHANGE = 0.5, 1e-5, 1e-4

#: Weight of a plane that takes part [1].
TAKES_PART = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plane:
    """Values and slopes at a point: of the goal first, then of constraints, which must not be above 0.

    Attributes
    ----------
    x : shape (variables,), 0 to 1
    values : shape (functions,)
    slopes : shape (functions, variables)
    """

    x: np.ndarray
    values: np.ndarray
    slopes: np.ndarray

    @property
    def merit(self) -> float:
        """The goal, with a penalty for violated constraints."""
        return float(self.values[0] + PENALTY * np.sum(np.maximum(self.values[1:], 0.0)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BundleMinimum:
    """The least value found.

    Attributes
    ----------
    best : the point, with values and slopes
    sides : points whose slopes of the goal balance each other there; one where the goal is smooth
    multipliers : of the constraints, shape (functions - 1,)
    trace : of all evaluations, in order
    converged : whether the box became small enough
    kind : ``smooth``, ``kink`` or ``jump``, as both sides say (`seen_from_both_sides`)
    """

    best: Plane
    sides: tuple[Plane, ...]
    multipliers: np.ndarray
    trace: tuple[Plane, ...]
    converged: bool
    kind: str = "smooth"


def minimize_by_planes(evaluate: Callable[[np.ndarray], Plane], start: np.ndarray, box: float = BOX) -> BundleMinimum:
    """Search within 0 to 1 in each variable; the functions are of the order of one.

    Parameters
    ----------
    box : first and largest half width of the box
    """
    best = evaluate(start)
    seen, half = [best], box
    while half > DONE and len(seen) < EVALUATIONS:
        near = [one for one in seen if np.max(np.abs(one.x - best.x)) <= NEAR * half][-PLANES:]
        step, promised, _, _ = _program(best, near, half)
        if best.merit - promised < 1e-12 * max(abs(best.merit), 1.0):
            half /= 4.0
            continue
        # a step onto a bound is exact but for the rounding of the linear program
        then = evaluate(np.clip(np.round(best.x + step, 12), 0.0, 1.0))
        seen.append(then)
        if best.merit - then.merit >= ENOUGH * (best.merit - promised):
            best, half = then, min(2.0 * half, box)
        else:
            if then.merit < best.merit:
                best = then
            half /= 2.0
    near = [one for one in seen if np.max(np.abs(one.x - best.x)) <= BESIDE]
    _, _, weights, multipliers = _program(best, near, BESIDE)
    sides = tuple(one for one, weight in zip(near, weights, strict=True) if weight > TAKES_PART)
    return BundleMinimum(
        best=best, sides=sides or (best,), multipliers=multipliers, trace=tuple(seen), converged=len(seen) < EVALUATIONS
    )


def seen_from_both_sides(evaluate: Callable[[np.ndarray], Plane], found: BundleMinimum) -> BundleMinimum:
    """The same with its kind: what values and slopes a little way off on both sides, and nearer, have in common."""
    best, slopes = found.best, np.array([one.slopes[0] for one in found.sides])
    across = slopes[0] - slopes[np.argmin(slopes @ slopes[0])]  # the edge where two parts meet
    held = not np.any(across) and np.any(found.multipliers > 0.0)  # by a constraint
    # else the way down that one slope promises; an end of a range holds the others
    ways = (across, slopes[0], np.ones_like(across))
    along = np.where(np.abs(best.x - 0.5) < 0.5 - BESIDE, next(way for way in ways if np.any(way)), 0.0)
    size = float(np.linalg.norm(along))
    if held or not size:
        return replace(found, sides=(best,))
    points = [best.x + way * along / size for way in (-BESIDE, BESIDE, -NEARER, NEARER)]
    planes = [evaluate(point) for point in points]
    far, near = (_step_between(planes[k], planes[k + 1], along / size, best.x) for k in (0, 2))
    largest = max(float(np.max(np.abs(one.slopes[0]))) for one in (*found.trace, *planes))
    if abs(near[0]) > max(JUMP, STAYS * abs(far[0])):
        return replace(found, sides=tuple(planes[2:]), kind="jump")
    if near[1] > max(CHANGE * largest, STAYS * far[1]):
        return replace(found, sides=found.sides if np.any(across) else tuple(planes[2:]), kind="kink")
    return replace(found, sides=(best,))


def _step_between(below: Plane, above: Plane, along: np.ndarray, x: np.ndarray) -> tuple[float, float]:
    """By how much value and slope at a point, as two planes have them, change from the one to the other."""
    values = [float(one.values[0] + one.slopes[0] @ (x - one.x)) for one in (below, above)]
    return values[1] - values[0], float((above.slopes[0] - below.slopes[0]) @ along)


def _program(best: Plane, near: list[Plane], half: float) -> tuple[np.ndarray, float, np.ndarray, np.ndarray]:
    """Step to the least of the highest planes in the box, what it promises, and weights of planes and constraints."""
    variables, constraints = len(best.x), len(best.values) - 1
    # unknown: step, height of the goal, violation of each constraint
    cost = np.concatenate([np.zeros(variables), [1.0], np.full(constraints, PENALTY)])
    rows, limits = [], []
    for function in range(constraints + 1):
        for one in near:
            height = one.values[function] + one.slopes[function] @ (best.x - one.x)
            height = min(height, best.values[function])  # a plane above the best point is one of another valley
            row = np.zeros(len(cost))
            row[:variables], row[variables + function] = one.slopes[function], -1.0
            rows.append(row)
            limits.append(-height)
    box = [(max(-half, -float(x)), min(half, 1.0 - float(x))) for x in best.x]
    found = linprog(cost, np.array(rows), np.array(limits), bounds=[*box, (None, None), *[(0.0, None)] * constraints])
    duals = -np.asarray(found.ineqlin.marginals).reshape(constraints + 1, len(near))
    return found.x[:variables], float(found.fun), duals[0], duals[1:].sum(axis=1)
