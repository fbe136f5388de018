"""Name the error instead of the method: run, run again tighter, until two whole runs agree within the target.

In: a model, a request, a relative error, quantities.  Out: a `Solution` whose ``accuracy`` has choice, estimate and
cost.

`LADDER` holds the ways to integrate, from loose to tight; the target says where to begin.  A way and the next but one
both integrate the whole run, and what their quantities differ in is the estimate for the looser of the two: its error
is many times that of the tighter one.  Where the difference is above the target, the rungs that cannot be enough are
left out.

Chaos: two runs that differ much are no proof, and two that agree by luck are none either.  So not only quantities are
compared but the motion of every state: calm motion forgets what two runs differ in, or carries it on as it is.  Where
it parts by more, and steps go over kinks, the run is repeated from a start moved by a picometre.  Where that parts as
well, a tight run and a moved one decide, the same ones at every target.  Motion in which even these two part is
chaotic.  Its numbers are known to what `STARTS` moved starts of the tight run differ in, for two of them may agree by
luck: a target above that is met.  Where the two do not part, the tight run is one more reference for the estimate.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ballpass.runtime.certify.method_choice import MethodChoice, compared_quantities, motion_of, stepper_run
from ballpass.runtime.contract.errors import RequestError, SimulationError
from ballpass.runtime.contract.parameters import Numbers, real
from ballpass.runtime.contract.refused_scenes import refuse_still
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.quantity.quantity_run import EvaluatedQuantities, QuantityRun
from ballpass.runtime.quantity.records import Quantity
from ballpass.runtime.report.numbers import rounded
from ballpass.runtime.request.locating import LOCATED
from ballpass.runtime.request.request import Request
from ballpass.runtime.request.resolve import Run
from ballpass.runtime.request.segments import check_count
from ballpass.runtime.solution.accuracy import Accuracy
from ballpass.runtime.solution.simulate import simulate
from ballpass.runtime.solution.solution import Solution

#: Ways from loose to tight, and the error that each usually keeps [1].  The last one only checks.
LADDER: tuple[tuple[MethodChoice, float], ...] = (
    (MethodChoice(method="stepper", rtol=1e-4), 3e-3),
    (MethodChoice(method="stepper", rtol=1e-5), 7e-4),
    *((MethodChoice(method="stepper", rtol=10.0**k, kinks=LOCATED), 10.0 ** (k + 2)) for k in range(-6, -11, -1)),
    (MethodChoice(method="stepper-dp54", rtol=1e-12, kinks=LOCATED), 0.0),
)

#: The loosest way that locates kinks.
FIRST_LOCATED = next(way for way, _ in LADDER if way.kinks == LOCATED)

#: Errors that may be asked for [1].
SMALLEST, LARGEST = 1e-8, 0.5

#: An estimate must be this much below the target.
SAFETY = 1.5

#: Two runs may agree by luck: no estimate is below so many tolerances.  What steps lose over a kink does not shrink
#: with the tolerance as their other errors do, and two runs that step over kinks share it.
LEAST, LEAST_STEPPED_OVER = 0.05, 0.5

#: Runs of a calm motion are less apart where steps end on kinks: in parts of a magnitude, and of a quantity [1].
#: Where they step over kinks, so many times that: each loses something else there.
SUSPECT, SUSPECT_QUANTITY, STEPPED_OVER_NOISE = 1e-4, 1e-3, 3.0

#: Rungs between a way and the one that it is compared with.  Neighbours may have almost the same steps and share an
#: error: of 1000 estimates from the next rung 7 were below a third of the error, one below a thirteenth.
TIGHTER = 2

#: How far a start is moved to see whether the motion forgets it [m], and how many starts say what chaos changes.
MOVED, STARTS = 1e-12, 8

#: The way that decides on chaos.  Motion that it and its moved run differ in by more than this is chaotic: a picometre,
#: 1e-8 of a magnitude, has grown ten thousand times [1].
CHAOS_REFERENCE, CHAOTIC = MethodChoice(method="stepper", rtol=1e-10, kinks=LOCATED), 1e-4


def checked_target(error: float) -> float:
    """A relative error within the bounds [1]; RequestError for another."""
    if not SMALLEST <= real(error) <= LARGEST:
        raise RequestError(
            f"{error!r:.80} is no error that can be asked for. Allowed: a relative error from {SMALLEST:g} "
            f"to {LARGEST:g}. Example: 0.01 for 1 %."
        )
    return real(error)


class TargetMissed(SimulationError):
    """No way meets the target; ``best`` is the most accurate one, None where nothing could be integrated."""

    def __init__(self, message: str, best: Accuracy | None) -> None:
        super().__init__(message)
        self.best = best


def simulate_to_error(
    model: LoadedModel, numbers: Numbers, request: Request, target: float, of: str | Sequence[str] | None
) -> Solution:
    """Simulate with the error of quantities named instead of method and tolerance.

    Raises
    ------
    RequestError
        A wrong request: a model without states, unknown quantities.
    TargetMissed
        No way meets the target.
    """
    refuse_still("error", integrated=model.manifest.integrated)
    quantities = compared_quantities(model, of)
    run = stepper_run(model, numbers, request)
    check_count(model.manifest, numbers, run.duration, run.stretch)  # before a search that may take long
    found = meet_target(run, target, quantities)
    solution = simulate(model, numbers, replace(request, method=found.method, rtol=found.rtol, kinks=found.kinks))
    return replace(
        solution, accuracy=found, statistics=replace(solution.statistics, reason=f"for an error of {found.target:g}")
    )


@dataclass(slots=True, kw_only=True)
class _Search:
    """What was integrated of a run so far, by way and displacement of the start."""

    run: Run
    quantities: QuantityRun
    done: dict[tuple[MethodChoice, float], EvaluatedQuantities] = field(default_factory=dict)
    fault: SimulationError | None = None

    def __call__(self, way: MethodChoice, moved: float = 0.0) -> EvaluatedQuantities:
        if (way, moved) not in self.done:
            self.done[way, moved] = way.measure(self.quantities, self.run, moved)
        return self.done[way, moved]

    @property
    def seconds(self) -> float:
        return sum(one.seconds for one in self.done.values())


def meet_target(run: Run, target: float, quantities: Sequence[Quantity]) -> Accuracy:
    """Find a way that keeps a relative error on all quantities.

    Raises
    ------
    RequestError
        A target out of bounds.
    TargetMissed
        No way meets the target, or the motion is chaotic; the message says what the best one keeps.
    """
    target, names = checked_target(target), tuple(item.name for item in quantities)
    search = _Search(run=run, quantities=QuantityRun(run.model, quantities, motion=True))
    tried: list[tuple[str, float]] = []
    best: Accuracy | None = None
    place = min(next(k for k, (_, usual) in enumerate(LADDER) if usual <= target), len(LADDER) - 2)
    while place < len(LADDER) - 1:
        way, check = LADDER[place][0], LADDER[min(place + TIGHTER, len(LADDER) - 1)][0]
        try:
            estimates, chaotic = _compare(search, way, check)
        except SimulationError as fault:
            # one way that fails is no reason to give up: the next one is tighter
            search.fault = fault
            place += 1
            continue
        estimate = max(estimates)
        found = Accuracy(
            target=target,
            estimate=estimate,
            of=names,
            values=dict(zip(names, search(way).values.tolist(), strict=True)),
            estimates=dict(zip(names, estimates, strict=True)),
            method=way.method,
            rtol=way.rtol,
            kinks=way.kinks,
            check=check.words,
            tried=tuple(tried),
            time=search(way).seconds,
            check_time=search.seconds - search(way).seconds,
        )
        if chaotic and SAFETY * estimate > target:
            raise TargetMissed(_chaos(found), found)
        if SAFETY * estimate <= target:
            return found
        tried.append((way.words, estimate))
        if best is None or estimate < best.estimate:
            best = found
        # a rung is a decade of tolerance, and about a decade of error
        missing = math.log10(SAFETY * estimate / target) if math.isfinite(estimate) else 0.0
        place = max(place + 1, min(place + 1 + math.floor(missing), len(LADDER) - 2))
    raise TargetMissed(_refusal(target, names, best, search.fault), best)


def _compare(search: _Search, way: MethodChoice, check: MethodChoice) -> tuple[list[float], bool]:
    """Estimates of the errors of a way from a tighter one, and whether the motion is chaotic.

    Raises
    ------
    SimulationError
        One of them could not reach the end.
    """
    loose = search(way)
    least = LEAST if way.kinks == LOCATED else LEAST_STEPPED_OVER
    estimates = _relative(loose, search(check), least * way.rtol)
    pairs = [((way, 0.0), (check, 0.0))]
    if way.kinks != LOCATED:
        # what steps lose at kinks differs; the growth of a picometre shows more, and best where kinks are located
        stepped = way if check.kinks == LOCATED else check
        pairs += [((one, 0.0), (one, MOVED)) for one in (stepped, FIRST_LOCATED)]
    for one, other in pairs:
        changes = _relative(search(*other), search(*one))
        estimates = [max(pair) for pair in zip(estimates, changes, strict=True)]
        noise = 1.0 if one[0].kinks == LOCATED else STEPPED_OVER_NOISE
        if _apart(search, one, other) <= noise * SUSPECT and max(changes) <= noise * SUSPECT_QUANTITY:
            return estimates, False
    chaotic = _apart(search, (CHAOS_REFERENCE, 0.0), (CHAOS_REFERENCE, MOVED)) > CHAOTIC
    starts = [search(CHAOS_REFERENCE, k * MOVED) for k in range(STARTS + 1 if chaotic else 2)]
    spread = zip(*(_relative(one, start) for start in starts for one in (loose, starts[0])), strict=True)
    return [max(pair) for pair in zip(estimates, map(max, spread), strict=True)], chaotic


def _apart(search: _Search, one: tuple[MethodChoice, float], other: tuple[MethodChoice, float]) -> float:
    """How far the extremes of all states are apart, in magnitudes [1]."""
    first, second = (motion_of(search.run, search(*which)) for which in (one, other))
    return float(np.abs(first - second).max())


def _relative(one: EvaluatedQuantities, other: EvaluatedQuantities, least: float = 0.0) -> list[float]:
    """Relative differences of quantities, at least `least`; infinite where one is zero or no number.

    Where both runs say zero, and where they agree to the last bit, it is a rounding.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        found = np.abs(one.values - other.values) / np.abs(other.values)
    rounding = np.finfo(float).eps
    found = np.where(np.isfinite(found), np.maximum(found, max(least, rounding)), np.inf)
    return np.where(one.values == other.values, rounding, found).tolist()  # type: ignore[no-any-return]


def _chaos(found: Accuracy) -> str:
    return (
        f"An error of {100 * found.target:g} % on {', '.join(found.of)} cannot be kept here: the motion is chaotic. A "
        f"start moved by {MOVED:g} m, or another tolerance, changes what is asked for by "
        f"{rounded(100 * found.estimate, 2)} % within the run, and no tolerance mends that. Only "
        "statistics mean something: take many turns or many starts (simulate_many), or ask for a shorter run."
    )


def _refusal(target: float, names: tuple[str, ...], best: Accuracy | None, fault: SimulationError | None) -> str:
    asked = f"An error of {100 * target:g} % on {', '.join(names)} cannot be met"
    if best is None:
        why = f" The last one said: {fault}" if fault is not None else ""
        return f"{asked}: no method could integrate this run. Check initial state, damping and parameters.{why}"
    return (
        f"{asked}. The best is {rounded(100 * best.estimate, 2)} %, by {best.method} at rtol {best.rtol:g}. Where "
        "tightening does not help, the motion amplifies small errors, or the quantity is nearly zero: "
        "ask for a shorter run, for a larger error, or for another quantity."
    )
