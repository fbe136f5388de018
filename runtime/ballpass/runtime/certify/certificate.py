"""The certificate of a derivative: a second route to the same number, and the verdict of their comparison.

In: two numbers with their uncertainties.  Out: a `Check` with a verdict.

verified      both agree within the tolerance, and the second is known well enough to say so.  Where they agree only
              because a derivative below the quantum counts as nothing, the check says that too: `Check.bounded`
disagrees     they differ by more than the tolerance and by more than their uncertainties explain
not checked   the user turned the check off, or the uncertainties are too large for either answer (the reason is given):
              in chaos, and where a contact grazes, no route gives a derivative that means anything
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.certify.differences import FEWEST, extrapolated

Array = NDArray[np.float64]

#: Relative disagreement that is allowed [1].
AGREEMENT = 1e-3

#: Disagreement of the dimensionless derivative (p/Q) dQ/dp allowed besides: smaller ones count as none [1].
FLOOR = 1e-5

#: Uncertainties, estimated from neighbouring approximations, may be too small by this factor.
CAUTION = 4.0

#: Stated uncertainty of a derivative by steps, over its distance from that at a looser tolerance: two tolerances may be
#: nearer each other than both to the limit, in 188 random pairs by up to 6.2 times [1].
STATED = 8.0

#: Largest step of the first triangle of difference quotients, relative to the parameter's scale; the next is larger
#: where noise is what limits an entry, and smaller where it is curvature.
FIRST_STEP, LARGER, SMALLER = 1e-3, 10.0, 0.1

#: Most triangles of a parameter, and steps of each.
TRIANGLES, HALVINGS = 3, 3

#: Part of the disagreement that is allowed, within which a number is known well enough [1].
KNOWN = 0.3

#: Slopes on both sides of a parameter's value that differ by so many times what is allowed are those of a kink.
KINK = 5.0

#: Two numbers that are apart by more than this part of the larger one have no digit in common [1].
WILD = 0.5

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
    value: float | None = None
    uncertainty: float | None = None
    disagreement: float | None = None
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
UNCHECKED = Check(route="none", verdict=Verdict.NOT_CHECKED, reason="the check was turned off")


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
            value=second if fine else None,
            uncertainty=uncertainty if fine else None,
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
            reason = (
                f"the routes differ by {apart:.1e} where {allowed:.1e} is allowed, which their uncertainties "
                f"({own_uncertainty:.1e} and {uncertainty:.1e}) explain: {_remedy(own_uncertainty > uncertainty)}"
            )
    elif uncertainty > allowed:
        verdict = Verdict.NOT_CHECKED
        reason = (
            f"the second route is uncertain by {uncertainty:.1e}, more than the {allowed:.1e} that is allowed: "
            + _remedy(False)
        )
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


def _remedy(first: bool) -> str:
    """What may help where the first, or the second, number is not known well enough."""
    if first:
        return "take a tighter sensitivity_rtol or fewer turns, or see whether the motion is chaotic"
    return "grazing contact, a chaotic motion, or a tolerance that is too loose"


def better_known(derivative: float, own_uncertainty: float, check: Check) -> tuple[float, float, bool]:
    """The number to give: that which is known better, its uncertainty, and whether it is the second one.

    Both uncertainties come from neighbouring approximations: what is given is `STATED` and `CAUTION` times as much.
    Where the second number excludes the first, the uncertainty of the first is at least their distance.
    NaN where nothing is known: the routes have no digit in common, and neither is known to one or they exclude each
    other.
    """
    value, uncertainty = check.value, check.uncertainty
    own = STATED * own_uncertainty
    if value is None or uncertainty is None or check.sides is not None:
        return derivative, own, False
    cautious, apart = CAUTION * uncertainty, abs(derivative - value)
    second = cautious < own_uncertainty or not np.isfinite(derivative)
    if apart > own_uncertainty + uncertainty:
        own = max(own, apart)
    best = (value, cautious, True) if second else (derivative, own, False)
    wild = not apart <= WILD * max(abs(derivative), abs(value))
    if check.verdict is Verdict.VERIFIED or not wild or not np.isfinite(derivative):
        return best
    if check.verdict is Verdict.NOT_CHECKED and best[1] <= WILD * abs(best[0]):
        return best
    return np.nan, best[1], best[2]


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
    jitter: Sequence[Mapping[str, float]],
    agreement: float = AGREEMENT,
    expected: Array | None = None,
) -> Second:
    """Derivatives of quantities by Richardson-extrapolated central differences, with step control.

    What is found of a pair of quantity and parameter does not depend on the other pairs.

    Parameters
    ----------
    measure : values of all quantities for many changes at once; NaN where one cannot be simulated
    at : values of the parameters to differentiate by
    scales : change of each that is a large one, shape (parameters,)
    quantum : derivatives that count as nothing, shape (quantities, parameters)
    jitter : tiny changes, evenly spaced and the middle one none, that show the noise of a run: what step sizes that are
        chosen anew do to its values
    agreement : relative disagreement that will be allowed [1]
    expected : derivatives that the differences will be compared with, same shape: where those of two steps agree with
        them and with each other, a third step is not taken
    """
    names, centre = list(at), np.array(list(at.values()))
    jittered = measure(jitter)
    noise, quantities = _noise(jittered), jittered[len(jittered) // 2]
    value, error = np.full(quantum.shape, np.nan), np.full(quantum.shape, np.inf)
    below, above = np.full(quantum.shape, np.nan), np.full(quantum.shape, np.nan)
    step, wanting = np.full(quantum.shape, FIRST_STEP), np.ones(quantum.shape, dtype=bool)
    halves = 0.5 ** np.arange(HALVINGS)
    for tried in range(1, TRIANGLES + 1):
        # each parameter is moved by the steps that any of its quantities asks for
        moves = [(k, size) for k in range(len(names)) for size in np.unique(step[wanting[:, k], k]).tolist()]
        reach = np.array([size * scales[k] * halves for k, size in moves]).reshape(-1, HALVINGS)
        places = centre[[k for k, _ in moves], None]
        upper, lower = places + reach, places - reach
        asked = [wanting[:, k] & (step[:, k] == size) for k, size in moves]
        table = np.empty((2, len(moves), HALVINGS, len(noise)))
        few = 0 if expected is None else FEWEST
        for some in (slice(0, few), slice(few, HALVINGS)):
            left = [place for place, mine in enumerate(asked) if np.any(mine)]
            changes = [
                {names[moves[place][0]]: moved}
                for side in (upper, lower)
                for place in left
                for moved in side[place, some].tolist()
            ]
            if not changes:
                continue
            table[:, left, some] = measure(changes).reshape(2, len(left), -1, len(noise))
            for place in left:
                k, mine = moves[place][0], asked[place]
                width = (upper - lower)[place, : some.stop]
                found = extrapolated(table[0, place, : some.stop], table[1, place, : some.stop], width, noise)
                # triangles that exclude each other know no more than their distance
                apart = np.nan_to_num(np.abs(found.value - value[:, k]))
                apart = np.where(apart > found.error + error[:, k], apart, 0.0)
                fresh = np.maximum(found.error, apart)
                known = np.maximum(error[:, k], apart)
                sides = _sides(quantities, table[:, place, : some.stop], 0.5 * width)
                allowed = agreement * np.max(np.abs(sides), axis=0) + quantum[:, k] + 4.0 * noise / width[-1]
                kinked = np.abs(sides[1] - sides[0]) > KINK * allowed
                if expected is not None and some.stop < HALVINGS:
                    enough = KNOWN * agreement * np.abs(found.value)  # without the quantum: nothing is then bounded
                    mine = mine & ~kinked & (fresh <= enough) & (np.abs(found.value - expected[:, k]) <= enough)
                    asked[place] = asked[place] & ~mine
                better = mine & (fresh < known)
                below[better, k] = np.where(kinked, sides[0], np.nan)[better]
                above[better, k] = np.where(kinked, sides[1], np.nan)[better]
                value[better, k] = found.value[better]
                error[mine, k] = np.where(better, fresh, known)[mine]
                wanting[mine, k] = (error[:, k] > KNOWN * (agreement * np.abs(value[:, k]) + quantum[:, k]))[mine]
                # noise over the width of the smallest difference, twice as `extrapolated` counts it
                noisy = 2.0 * noise / width[-1] > 0.2 * error[:, k]
                larger = noisy & (tried == 1)
                factor = np.where(larger, LARGER, SMALLER ** (tried - noisy.astype(float)))
                step[mine, k] = (FIRST_STEP * factor)[mine]
    return Second(route="differences", value=value, uncertainty=error, quantities=quantities, below=below, above=above)


def _sides(here: Array, table: Array, reach: Array) -> Array:
    """Slopes below and above by differences to one side, extrapolated once, shape (2, quantities).

    Where those of larger and of smaller steps are not alike, neither is known, and both are given as one.
    """
    slopes = (here - table) * np.array([-1.0, 1.0])[:, None, None] / reach[:, None]
    finer = 2.0 * slopes[:, 1:] - slopes[:, :-1]
    if finer.shape[1] == 1:
        return np.asarray(finer[::-1, -1])
    known = np.max(np.abs(finer[:, -1] - finer[:, -2]), axis=0) < 0.1 * np.abs(finer[0, -1] - finer[1, -1])
    return np.asarray(np.where(known, finer[::-1, -1], np.mean(finer[:, -1], axis=0)))


def _noise(values: Array) -> Array:
    """Noise of the quantities: half the largest second difference over tiny changes, shape (quantities,)."""
    return np.asarray(np.max(np.abs(np.diff(values, n=2, axis=0)), axis=0) / 2.0)
