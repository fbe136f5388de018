"""Let the user name the error: choose method and tolerance, run, estimate the error of that very run, tighten.

In: a prepared run, quantities, a relative error.  Out: an `Accuracy`: choice, values, estimate, cost.

Ways to compute are ranked from cheap to accurate, by a stored trade of the scene where there is one, else by a ladder
that was measured on the shipped scenes.  A candidate is integrated, and so is a companion that is at least five times
as accurate where both behave as ranked; their difference is the estimate of the candidate's error.  It estimates the
error of this run, not of runs like it: contact makes the error of a single run a lottery, and a companion that is less
accurate (a looser tolerance, scaled) would draw another ticket.  Where the estimate is above the target, the next
candidate that can be enough follows; integrations are kept, so that a companion may become a candidate at no cost.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from raceway.runtime.accuracy.prepared import Integrated, Prepared, check_observables, default_observables, prepare
from raceway.runtime.accuracy.trade import FULL, Measured, Trade
from raceway.runtime.errors import RequestError, SimulationError
from raceway.runtime.integrate.magnitudes import model_scales
from raceway.runtime.integrate.simulate import simulate

if TYPE_CHECKING:
    from raceway.runtime.model import Model
    from raceway.runtime.parameters import Numbers
    from raceway.runtime.request import Request
    from raceway.runtime.solution import Solution

#: An estimate must be this much below the target: the companion has an error as well.
SAFETY = 1.2

#: A companion from a trade is at least this much more accurate than the candidate.
FINER = 0.2

#: Where fastest decay over fastest natural frequency is above, explicit methods are held down by stability.
STIFF = 2.0

#: Errors that may be asked for [1].
SMALLEST, LARGEST = 1e-8, 0.5

#: Most steps of a way: so many times those of the longest one before, and at least so many a cycle.  Ten times as
#: tight takes twice the steps; a way that takes far more is stuck at the resolution of numbers.
GROWTH, SPARE = 20, 100_000

#: Method and tolerance.
Way = tuple[str, float]


def _ladder(fine: str) -> tuple[Way, ...]:
    return (
        ("stepper-rodas4", 1e-1),
        ("stepper-rodas4", 1e-2),
        *((fine, 10.0**decade) for decade in (-3, -4, -5, -6, -7, -8, -9, -10)),
        ("stepper-rodas5p", 1e-11),
    )


#: Ways from cheap to accurate, where nothing was measured on the scene: for models that are not stiff, and stiff ones.
LADDER, STIFF_LADDER = _ladder("stepper-dop853"), _ladder("stepper-rodas5p")

#: How many rungs higher on a ladder a companion stands.
RUNGS = 2

#: Where on a ladder to start for a target: the error that each rung is expected to keep.
EXPECTED = (0.1, 0.01, 0.001, 0.0001)


@dataclass(frozen=True, slots=True, kw_only=True)
class Accuracy:
    """What was asked, chosen and found.

    Attributes
    ----------
    target : relative error asked for [1]
    estimate : of the worst quantity of this run [1]
    of : quantities
    values : of the quantities, in SI
    estimates : of each quantity [1]
    method, rtol : chosen
    companion : method and tolerance of the run that the estimate is the difference to
    tried : ways that were integrated and did not meet the target, with their estimates
    reason : why the search began where it did
    time, companion_time : of the chosen integration, and of everything else that was integrated [s]
    """

    target: float
    estimate: float
    of: tuple[str, ...]
    values: dict[str, float]
    estimates: dict[str, float]
    method: str
    rtol: float
    companion: Way
    tried: tuple[tuple[str, float, float], ...]
    reason: str
    time: float
    companion_time: float

    def plain(self) -> dict[str, Any]:
        """Plain data for JSON; an estimate that is infinite becomes None."""
        data = asdict(self)
        data["tried"] = [(*way, e if math.isfinite(e) else None) for *way, e in self.tried]
        return data

    @property
    def words(self) -> str:
        """One paragraph for people."""
        worst = max(self.estimates, key=lambda name: self.estimates[name])
        other = f"{self.companion[0]} at rtol {self.companion[1]:g}"
        return (
            f"error asked for {100 * self.target:g} %, estimated {100 * self.estimate:.2g} % (worst of "
            f"{', '.join(self.of)}: {worst}): {self.method} at rtol {self.rtol:g}, {self.reason}. Integrated in "
            f"{1e3 * self.time:.3g} ms; {1e3 * self.companion_time:.3g} ms more went into the estimate, by {other}"
            + (f", after {len(self.tried)} other ways." if self.tried else ".")
        )


class TargetMissed(SimulationError):
    """No way meets the target; ``best`` is the most accurate one, None where nothing could be integrated."""

    def __init__(self, message: str, best: Accuracy | None) -> None:
        super().__init__(message)
        self.best = best


@dataclass(slots=True, kw_only=True)
class _Search:
    """Integrations so far, by way."""

    run: Prepared
    observables: tuple[tuple[str, str], ...]
    done: dict[Way, Integrated | None] = field(default_factory=dict)

    def __call__(self, way: Way) -> Integrated | None:
        if way not in self.done:
            try:
                longest = max((one.steps or 0 for one in self.done.values() if one is not None), default=0)
                limit = max(GROWTH * longest, math.ceil(SPARE * self.run.cycles))
                self.done[way] = self.run.run(self.observables, *way, max_steps=limit)
            except SimulationError:
                # one way that fails is no reason to give up: the next one is tighter
                self.done[way] = None
        return self.done[way]

    @property
    def seconds(self) -> float:
        return sum(one.seconds for one in self.done.values() if one is not None)


def meet_target(run: Prepared, target: float, of: Sequence[str], trade: Trade | None = None) -> Accuracy:
    """Find a way that keeps a relative error on all quantities, and integrate by it.

    Parameters
    ----------
    target : relative error [1]
    of : quantities
    trade : a measurement of this scene, whose ranking is used

    Raises
    ------
    RequestError
        A target out of bounds, or unknown quantities.
    TargetMissed
        No way meets the target; the message says what the best one keeps.
    """
    names = (of,) if isinstance(of, str) else tuple(of)
    if isinstance(target, bool) or not isinstance(target, int | float) or not SMALLEST <= target <= LARGEST:
        raise RequestError(
            f"error: a relative error from {SMALLEST:g} to {LARGEST:g} is expected, not {target!r}. "
            "Example: error=0.01 for 1 %."
        )
    search = _Search(run=run, observables=check_observables(run.model, names))
    pairs, reason = _pairs(run, target, names, trade)
    tried: list[tuple[str, float, float]] = []
    best: Accuracy | None = None
    place = 0
    while place < len(pairs):
        way, companion = pairs[place]
        place += 1
        found, other = search(way), search(companion)
        if found is None or other is None:
            continue
        estimates = _differences(found, other)
        estimate = max(estimates)
        reached = Accuracy(
            target=float(target),
            estimate=estimate,
            of=names,
            values=dict(zip(names, found.values, strict=True)),
            estimates=dict(zip(names, estimates, strict=True)),
            method=way[0],
            rtol=way[1],
            companion=companion,
            tried=tuple(tried),
            reason=reason,
            time=found.seconds,
            companion_time=search.seconds - found.seconds,
        )
        if SAFETY * estimate <= target:
            return reached
        tried.append((*way, estimate))
        # a rung is a decade of tolerance, and about a decade of error: those that cannot be enough are left out
        if 1 < place < len(pairs) and estimate < math.inf:
            place = min(place + max(0, math.floor(math.log10(SAFETY * estimate / target))), len(pairs) - 1)
        if best is None or estimate < best.estimate:
            best = reached
    raise TargetMissed(_refusal(target, names, best), best)


def _differences(found: Integrated, other: Integrated) -> list[float]:
    """Relative differences; infinite for a quantity that is zero or no number."""
    out = []
    for value, reference in zip(found.values, other.values, strict=True):
        difference = abs(value - reference) / abs(reference) if reference != 0.0 else math.inf
        # two runs that agree to the last bit still round
        out.append(max(difference, np.finfo(float).eps) if not math.isnan(difference) else math.inf)
    return out


def _pairs(
    run: Prepared, target: float, names: tuple[str, ...], trade: Trade | None
) -> tuple[list[tuple[Way, Way]], str]:
    """Candidates with their companions, from where the search begins to the most accurate, and why there."""
    stiffness = model_scales(run.model, run.numbers, run.initial, run.duration, run.turn).stiffness
    ladder = STIFF_LADDER if stiffness > STIFF else LADDER
    rungs = [(ladder[k], ladder[k + RUNGS]) for k in range(len(ladder) - RUNGS)]
    first = next((k for k, expected in enumerate(EXPECTED) if expected <= target), len(EXPECTED) - 1)
    preferred = prefer(trade, target, names) if trade is not None else None
    if preferred is None:
        kind = "a stiff model" if ladder is STIFF_LADDER else "a model that is not stiff"
        return rungs[first:], f"the ladder for {kind}, as no trade of this scene was measured"
    # what was measured on other parameters may not hold for these: then the ladder goes on from there
    way, companion = ((one.configuration.method, one.configuration.rtol) for one in preferred)
    return [(way, companion), *rungs[first:]], "the cheapest that the scene's trade allows"


def prefer(trade: Trade, target: float, of: Sequence[str]) -> tuple[Measured, Measured] | None:
    """Cheapest way of a trade that keeps the target on all quantities, and a companion that is more accurate by far.

    None where the trade has no such pair, or was not measured of these quantities.  Models with another structure are
    not taken: they are the user's to choose.
    """
    if any(name not in trade.quantities for name in of):
        return None
    ways = [
        one
        for one in trade.measured
        if one.configuration.model == FULL
        and not one.configuration.switch
        and one.configuration.method.startswith(("stepper", "quasi"))
        and one.failures == 0
    ]
    # with room for the companion's error where there is such a way, else without: the estimate has the last word
    fits = ([w for w in ways if all(room * w.promised[name] <= target for name in of)] for room in (SAFETY, 1.0))
    fit = next((found for found in fits if found), None)
    if fit is None:
        return None
    chosen = min(fit, key=lambda m: m.time)
    worst = max(chosen.median[name] for name in of)
    finer = [one for one in ways if all(one.promised[name] <= FINER * worst for name in of)]
    return (chosen, min(finer, key=lambda m: m.time)) if finer else None


def _refusal(target: float, names: tuple[str, ...], best: Accuracy | None) -> str:
    asked = f"An error of {100 * target:g} % on {', '.join(names)} cannot be met"
    if best is None:
        return f"{asked}: no method could integrate this run. Check initial state, damping and parameters."
    return (
        f"{asked}. The best is {100 * best.estimate:.2g} %, by {best.method} at rtol {best.rtol:g}. Where tightening "
        "does not help, the motion amplifies rounding (chaos), or the quantity is nearly zero: ask for a shorter run, "
        "a statistic (mean, rms) instead of an extreme, or a larger error."
    )


def simulate_to_error(
    model: Model,
    numbers: Numbers,
    request: Request,
    target: float,
    of: str | Sequence[str] | None,
    trade: Trade | None,
) -> Solution:
    """Simulate with the error of quantities named instead of method and tolerance; see `meet_target`.

    Raises
    ------
    RequestError
        A wrong request: method or tolerance named besides, a model without states.
    TargetMissed
        No way meets the target.
    """
    if request.method is not None or request.rtol is not None:
        raise RequestError(
            "error was given, and method or rtol as well: with an error named, the tool chooses both. Give one or the "
            "other."
        )
    if not model.states:
        raise RequestError("error: this model has no states; its outputs follow from time alone, without an error.")
    names = default_observables(model) if of is None else (of,) if isinstance(of, str) else tuple(of)
    run = prepare(
        model,
        numbers.parameters,
        cycles=request.cycles,
        duration=request.duration if request.times is None else float(np.asarray(request.times)[-1]),
        transient=request.transient_cycles,
        initial=request.initial,
    )
    found = meet_target(run, target, names, trade)
    solution = simulate(model, numbers, replace(request, method=found.method, rtol=found.rtol))
    statistics = replace(solution.statistics, reason=found.words)
    return replace(solution, statistics=statistics, accuracy=found)
