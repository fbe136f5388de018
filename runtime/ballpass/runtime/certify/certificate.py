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
) -> Check:
    """Compare a derivative with that of a second route.

    Parameters
    ----------
    derivative, second : both numbers
    own_uncertainty, uncertainty : theirs, same unit
    quantum : derivative that counts as nothing, same unit
    agreement : relative disagreement that is allowed [1]
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
    if apart > allowed:
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
    """Derivatives by a second route: shapes (quantities, parameters); and its values of the quantities themselves."""

    route: str
    value: Array
    uncertainty: Array
    quantities: Array


def by_differences(
    measure: Measure,
    at: Mapping[str, float],
    scales: Array,
    *,
    quantum: Array,
    agreement: float = AGREEMENT,
) -> Second:
    """Derivatives of quantities by Richardson-extrapolated central differences, with step control.

    Parameters
    ----------
    measure : values of all quantities for many changes at once; NaN where one cannot be simulated
    at : values of the parameters to differentiate by
    scales : change of each that is a large one, shape (parameters,)
    quantum : derivatives that count as nothing, shape (quantities, parameters)
    agreement : relative disagreement that will be allowed [1]
    """
    names, centre = list(at), np.array(list(at.values()))
    step, left = np.full(len(names), FIRST_STEP), np.arange(len(names))
    noise = quantities = np.zeros(len(quantum))
    value, error = np.full(quantum.shape, np.nan), np.full(quantum.shape, np.inf)
    for tried in range(1, TRIANGLES + 1):
        halves = 0.5 ** np.arange(HALVINGS)
        reach = (step * scales)[left, None] * halves
        upper, lower = centre[left, None] + reach, centre[left, None] - reach
        changes = [
            {names[k]: moved}
            for side in (upper, lower)
            for k, row in zip(left, side.tolist(), strict=True)
            for moved in row
        ]
        jitter = _jittered(at, scales) if tried == 1 else []
        found = measure([*jitter, *changes])
        if jitter:
            noise, quantities = _noise(found[: len(jitter)]), found[len(jitter) // 2]
        table = found[len(jitter) :].reshape(2, len(left), HALVINGS, len(noise))
        poor = np.zeros(len(left), dtype=bool)
        for place, k in enumerate(left.tolist()):
            triangle = extrapolated(table[0, place], table[1, place], (upper - lower)[place], noise)
            better = triangle.error < error[:, k]
            value[:, k] = np.where(better, triangle.value, value[:, k])
            error[:, k] = np.where(better, triangle.error, error[:, k])
            wanting = error[:, k] > 0.3 * (agreement * np.abs(value[:, k]) + quantum[:, k])
            poor[place] = np.any(wanting)
            # noise over the width of the smallest difference, twice as `extrapolated` counts it
            share = 2.0 * noise[wanting] / (upper - lower)[place, -1]
            noisy = bool(np.any(share > 0.2 * error[wanting, k]))
            step[k] = FIRST_STEP * (LARGER if noisy and tried == 1 else SMALLER ** (tried if not noisy else tried - 1))
        left = left[poor]
        if not len(left):
            break
    return Second(route="differences", value=value, uncertainty=error, quantities=quantities)


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
