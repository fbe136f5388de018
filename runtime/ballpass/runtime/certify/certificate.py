"""The second opinion on a derivative: another route to the same number, and what their comparison says.

In: two numbers with their uncertainties.  Out: a `Check` with a verdict.

verified      both agree within the tolerance, and the second is known well enough to say so.  Where they agree only
              because a derivative below the quantum counts as nothing, the check says that too: `Check.bounded`
disagrees     they differ by more than the tolerance and by more than their uncertainties explain
not checked   the user turned the check off, or the uncertainties are too large for either answer (the reason is told):
              in chaos, and where a contact grazes, no route gives a derivative that means anything
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.certify.differences import extrapolated

Array = NDArray[np.float64]

#: Relative disagreement that is allowed [1].
AGREEMENT = 1e-3

#: Disagreement of the dimensionless derivative (p/Q) dQ/dp that is allowed besides: below it nothing is told apart [1].
FLOOR = 1e-5

#: Uncertainties, estimated from neighbouring approximations, may be too small by this factor.
CAUTION = 4.0

#: Largest step of the first triangle of difference quotients, relative to the parameter's scale; the next is larger
#: where noise is what limits an entry, and smaller where it is curvature.
FIRST_STEP, LARGER, SMALLER = 1e-3, 10.0, 0.1

#: Most triangles of a parameter, and steps of each.
TRIANGLES, HALVINGS = 3, 3

#: Slopes on both sides of a parameter's value that differ by so many times what is allowed are those of a kink.
KINK = 5.0

#: Parameters that are moved together: the most of them, the smallest effect relative to the largest, and how often.
TOGETHER, SPREAD, VECTORS = 8, 1e-2, 2

#: Relative change of parameters that shows the noise of a run: what step sizes that are chosen anew do to its values.
JITTER, JITTERED = 1e-7, 5

#: Parameters that differ from those of a run, and what it measures of all quantities, shape (runs, quantities).
Measure = Callable[[Sequence[Mapping[str, float]]], Array]


class Verdict(Enum):
    """What a check says; values are for people."""

    VERIFIED = "verified"
    DISAGREES = "disagrees"
    NOT_CHECKED = "not checked"


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """A derivative by a second route, and the comparison.

    Attributes
    ----------
    route : of the second number
    value : second number, in the derivative's unit; None where there is none
    uncertainty : of the second number, same unit
    disagreement : distance of both, same unit
    verdict : see above
    reason : why nothing is said, else ""
    sides : slopes below and above the parameter's value where they differ: at a kink, where there is no derivative
    quantum : derivative that counts as nothing, same unit; None where nothing was compared
    bounded : verified, but only to within the quantum: relative to their size the numbers differ by more than is
        allowed, or the second is not known that well
    """

    route: str
    value: float | None
    uncertainty: float | None
    disagreement: float | None
    verdict: Verdict
    reason: str = ""
    quantum: float | None = None
    bounded: bool = False
    sides: tuple[float, float] | None = None

    def is_nothing(self, derivative: float) -> bool:
        """Whether all that is verified is that `derivative` and the second number lie below the quantum."""
        if not self.bounded or self.value is None or self.quantum is None:
            return False
        return max(abs(derivative), abs(self.value)) <= self.quantum


#: The check that was turned off.
UNCHECKED = Check(
    route="none",
    value=None,
    uncertainty=None,
    disagreement=None,
    verdict=Verdict.NOT_CHECKED,
    reason="the check was turned off",
)


def compare(
    derivative: float,
    own_uncertainty: float,
    second: float,
    uncertainty: float,
    *,
    route: str,
    quantum: float,
    agreement: float = AGREEMENT,
    sides: tuple[float, float] | None = None,
) -> Check:
    """Compare a derivative with that of a second route.

    Parameters
    ----------
    derivative, second : both numbers
    own_uncertainty, uncertainty : theirs, same unit
    quantum : derivative that counts as nothing, same unit
    agreement : relative disagreement that is allowed [1]
    sides : slopes by the second route below and above, where they differ
    """
    if not (np.isfinite(derivative) and np.isfinite(second) and np.isfinite(uncertainty)):
        fine = np.isfinite(second) and np.isfinite(uncertainty)
        why = "the derivative is no finite number" if fine else "the second route gives no finite number"
        return Check(
            route=route,
            value=None,
            uncertainty=None,
            disagreement=None,
            verdict=Verdict.DISAGREES if fine else Verdict.NOT_CHECKED,
            reason=why,
        )
    apart = abs(derivative - second)
    relative = agreement * max(abs(derivative), abs(second))
    allowed = relative + quantum
    verdict, reason = Verdict.VERIFIED, ""
    if sides is not None:
        verdict = Verdict.NOT_CHECKED
        reason = f"a kink: the slope is {sides[0]:.6g} below the parameter's value and {sides[1]:.6g} above"
    elif apart > allowed:
        explained = CAUTION * (own_uncertainty + uncertainty)
        verdict = Verdict.DISAGREES if apart > explained else Verdict.NOT_CHECKED
        if verdict is Verdict.NOT_CHECKED:
            reason = _blame(own_uncertainty, uncertainty, allowed)
    elif uncertainty > allowed:
        verdict, reason = Verdict.NOT_CHECKED, _blame(own_uncertainty, uncertainty, allowed)
    return Check(
        route=route,
        value=second,
        uncertainty=uncertainty,
        disagreement=apart,
        verdict=verdict,
        reason=reason,
        quantum=quantum,
        bounded=verdict is Verdict.VERIFIED and max(apart, uncertainty) > relative,
        sides=sides,
    )


def _blame(own: float, second: float, allowed: float) -> str:
    """Which number is not known well enough, and what may help."""
    if own > second:
        return (
            f"the derivative itself is uncertain by {own:.1e}, more than the {allowed:.1e} that is allowed: take a "
            "tighter sensitivity_rtol or fewer turns, or see whether the motion is chaotic"
        )
    return (
        f"the second route is uncertain by {second:.1e}, more than the {allowed:.1e} that is allowed: grazing contact, "
        "a chaotic motion, or a tolerance that is too loose"
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Second:
    """Derivatives by a second route: shapes (quantities, parameters); and its values of the quantities themselves.

    `below` and `above` are NaN but where slopes on both sides differ.
    """

    route: str
    value: Array
    uncertainty: Array
    quantities: Array
    below: Array
    above: Array

    def sides(self, row: int, column: int) -> tuple[float, float] | None:
        """Slopes on both sides of a kink."""
        pair = float(self.below[row, column]), float(self.above[row, column])
        return pair if np.all(np.isfinite(pair)) else None


def by_differences(
    measure: Measure,
    at: Mapping[str, float],
    scales: Array,
    *,
    quantum: Array,
    agreement: float = AGREEMENT,
    slopes: Array | None = None,
) -> Second:
    """Derivatives of quantities by Richardson-extrapolated central differences, with step control.

    Where derivatives are given, parameters are moved together first: groups of those of about one effect, each moved
    by so much that it has its share, up or down by chance, twice with other signs.  What such a difference and the sum
    of the given derivatives are apart is held against each of the group as if it was all its own.  Parameters for which
    that is too much, or not known well enough, are moved alone.

    Parameters
    ----------
    measure : values of all quantities for many changes at once; NaN where one cannot be simulated
    at : values of the parameters to differentiate by
    scales : change of each that is a large one, shape (parameters,)
    quantum : derivatives that count as nothing, shape (quantities, parameters)
    agreement : relative disagreement that will be allowed [1]
    slopes : the derivatives that are to be checked, shape (quantities, parameters)
    """
    names, centre = list(at), np.array(list(at.values()))
    jitter = measure(_jittered(at, scales))
    noise, quantities = _noise(jitter), jitter[len(jitter) // 2]
    value, error = np.full(quantum.shape, np.nan), np.full(quantum.shape, np.inf)
    below, above = np.full(quantum.shape, np.nan), np.full(quantum.shape, np.nan)
    left = np.arange(len(names))
    if slopes is not None and len(names) > TOGETHER:
        value, error = _together(measure, names, centre, scales, slopes, quantum, noise)
        allowed = agreement * np.maximum(np.abs(slopes), np.abs(value)) + quantum
        vouched = (np.abs(value - slopes) <= allowed) & (error <= allowed)
        left = np.flatnonzero(~np.all(vouched, axis=0))
        value[:, left], error[:, left] = np.nan, np.inf
    step = np.full(len(names), FIRST_STEP)
    for tried in range(1, TRIANGLES + 1):
        if not len(left):
            break
        halves = 0.5 ** np.arange(HALVINGS)
        reach = (step * scales)[left, None] * halves
        upper, lower = centre[left, None] + reach, centre[left, None] - reach
        changes = [
            {names[k]: moved}
            for side in (upper, lower)
            for k, row in zip(left, side.tolist(), strict=True)
            for moved in row
        ]
        table = measure(changes).reshape(2, len(left), HALVINGS, len(noise))
        poor = np.zeros(len(left), dtype=bool)
        for place, k in enumerate(left.tolist()):
            triangle = extrapolated(table[0, place], table[1, place], (upper - lower)[place], noise)
            # triangles that exclude each other know no more than their distance
            apart = np.nan_to_num(np.abs(triangle.value - value[:, k]))
            apart = np.where(apart > triangle.error + error[:, k], apart, 0.0)
            fresh, error[:, k] = np.maximum(triangle.error, apart), np.maximum(error[:, k], apart)
            better = fresh < error[:, k]
            sides = _sides(quantities, table[:, place], 0.5 * (upper - lower)[place])
            allowed = (
                agreement * np.max(np.abs(sides), axis=0) + quantum[:, k] + 4.0 * noise / (upper - lower)[place, -1]
            )
            kinked = better & (np.abs(sides[1] - sides[0]) > KINK * allowed)
            below[:, k] = np.where(better, np.where(kinked, sides[0], np.nan), below[:, k])
            above[:, k] = np.where(better, np.where(kinked, sides[1], np.nan), above[:, k])
            value[:, k] = np.where(better, triangle.value, value[:, k])
            error[:, k] = np.where(better, fresh, error[:, k])
            wanting = error[:, k] > 0.3 * (agreement * np.abs(value[:, k]) + quantum[:, k])
            poor[place] = np.any(wanting)
            # noise over the width of the smallest difference, twice as `extrapolated` counts it
            share = 2.0 * noise[wanting] / (upper - lower)[place, -1]
            noisy = bool(np.any(share > 0.2 * error[wanting, k]))
            step[k] = FIRST_STEP * (LARGER if noisy and tried == 1 else SMALLER ** (tried if not noisy else tried - 1))
        left = left[poor]
    return Second(route="differences", value=value, uncertainty=error, quantities=quantities, below=below, above=above)


def _sides(here: Array, table: Array, reach: Array) -> Array:
    """Slopes below and above by differences to one side, extrapolated once, shape (2, quantities).

    Where those of larger and of smaller steps are not alike, neither is known, and both are given as one.
    """
    slopes = (here - table) * np.array([-1.0, 1.0])[:, None, None] / reach[:, None]
    finer = 2.0 * slopes[:, 1:] - slopes[:, :-1]
    known = np.max(np.abs(finer[:, -1] - finer[:, -2]), axis=0) < 0.1 * np.abs(finer[0, -1] - finer[1, -1])
    return np.asarray(np.where(known, finer[::-1, -1], np.mean(finer[:, -1], axis=0)))


def _together(
    measure: Measure,
    names: Sequence[str],
    centre: Array,
    scales: Array,
    slopes: Array,
    quantum: Array,
    noise: Array,
) -> tuple[Array, Array]:
    """Derivatives by differences along groups of parameters, the other ones of a group taken as given; uncertainties.

    The worse of both sign vectors, shapes (quantities, parameters).
    """
    # relative change of the quantities by a large change of the parameter; below the quantum none is told apart
    effect = np.nan_to_num(np.max(FLOOR * np.maximum(np.abs(slopes), quantum) / quantum, axis=0), nan=1.0, posinf=1.0)
    signs, moves = np.random.default_rng(1), []
    for group in _groups(effect):
        share = scales[group] * effect[group[-1]] / effect[group]
        moves += [(group, share * signs.choice((-1.0, 1.0), len(group))) for _ in range(VECTORS)]
    halves = np.array([FIRST_STEP * 0.5**k for k in range(HALVINGS)])
    changes = [
        {names[k]: float(centre[k] + side * half * shift) for k, shift in zip(group, move, strict=True)}
        for group, move in moves
        for side in (1.0, -1.0)
        for half in halves.tolist()
    ]
    table = measure(changes).reshape(len(moves), 2, HALVINGS, len(noise))
    value, error = slopes.copy(), np.zeros(slopes.shape)
    for (group, move), (upper, lower) in zip(moves, table, strict=True):
        found = extrapolated(upper, lower, 2.0 * halves, noise)
        apart = (found.value - slopes[:, group] @ move)[:, None] / move
        worse = np.abs(apart) >= np.abs(value - slopes)[:, group]
        value[:, group] = np.where(worse, slopes[:, group] + apart, value[:, group])
        error[:, group] = np.maximum(error[:, group], found.error[:, None] / np.abs(move))
    return value, error


def _groups(effect: Array) -> list[NDArray[np.int_]]:
    """Parameters of about one effect, strongest first."""
    groups: list[list[int]] = []
    for k in np.argsort(-effect, kind="stable").tolist():
        if not groups or len(groups[-1]) == TOGETHER or effect[k] < SPREAD * effect[groups[-1][0]]:
            groups.append([])
        groups[-1].append(k)
    return [np.array(group) for group in groups]


def _jittered(at: Mapping[str, float], scales: Array) -> list[dict[str, float]]:
    """Tiny changes of all parameters together."""
    moves = JITTER * np.arange(-(JITTERED // 2), JITTERED // 2 + 1)
    return [
        {name: value + move * scale for (name, value), scale in zip(at.items(), scales.tolist(), strict=True)}
        for move in moves.tolist()
    ]


def _noise(values: Array) -> Array:
    """Noise of the quantities: half the largest second difference over tiny changes, shape (quantities,)."""
    return np.asarray(np.max(np.abs(np.diff(values, n=2, axis=0)), axis=0) / 2.0)
