"""Let the user name the error: choose model, method and tolerance, run, estimate the error of that very run, tighten.

In: a prepared run, quantities, a relative error.  Out: an `Accuracy`: choice, values, estimate, cost.

Candidates come from `candidates`, cheapest first.  One is integrated, in parts; a companion, which is more accurate,
integrates a part of the run again from the run's own state (`companion`), and the difference is the estimate.  Where a
trade of the scene was measured, the errors it found for that way weigh in: a single difference may be small by luck.
Where the estimate is above the target, the next candidate that can be enough follows.  The samples of a solution are
written by the integration that is judged: nothing is integrated again for them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from ballpass.runtime.certify.candidates import DIFFERENT, Candidate, prefer, rungs
from ballpass.runtime.certify.companion import check
from ballpass.runtime.certify.ladder import Way
from ballpass.runtime.certify.parts import InParts, integrate_parts, values_of
from ballpass.runtime.certify.prepared import Observable, Prepared, check_observables
from ballpass.runtime.certify.trade import FULL, Trade
from ballpass.runtime.contract.errors import RequestError, SimulationError
from ballpass.runtime.contract.parameters import real
from ballpass.runtime.run.magnitudes import model_scales
from ballpass.runtime.run.request import start_state
from ballpass.runtime.run.trajectory import Trajectory

#: Where fastest decay over fastest natural frequency is above, explicit methods are held down by stability.
STIFF = 2.0

#: Fastest oscillations in a turn above which they are as well: vibrations that have died out would still be stepped.
MANY_OSCILLATIONS = 5000.0

#: Errors that may be asked for [1].
SMALLEST, LARGEST = 1e-8, 0.5

#: Most steps of a way: so many times those of the longest one before, and at least so many a cycle.  Ten times as
#: tight takes twice the steps; a way that takes far more is stuck at the resolution of numbers.
GROWTH, SPARE = 20, 100_000

#: Weight of the difference in an estimate, the rest is that of the trade's median error, in logarithms [1].
WEIGHT = 0.6

#: A difference below this part of the trade's median error is luck, and counts as that much [1].
LUCK = 0.03


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
    model : chosen, ``full`` or the name of a simpler one
    method, rtol : chosen
    companion : method and tolerance that the estimate was made with
    part : of the run that the companion integrated: begin and end [s]
    tried : models, methods and tolerances that were integrated and did not meet the target, with their estimates
    reason : why the search began where it did
    time, companion_time : of the chosen integration, and of everything else that was integrated [s]
    """

    target: float
    estimate: float
    of: tuple[str, ...]
    values: dict[str, float]
    estimates: dict[str, float]
    model: str
    method: str
    rtol: float
    companion: Way
    part: tuple[float, float]
    tried: tuple[tuple[str, str, float, float], ...]
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
        chosen = self.method if self.model == FULL else f"{self.model}, {self.method}"
        begin, end = self.part
        values = ", ".join(f"{name} = {value:.7g}" for name, value in self.values.items())
        return (
            f"{values} (SI, extremes between samples included): "
            f"error asked for {100 * self.target:g} %, estimated {100 * self.estimate:.2g} % (worst of "
            f"{', '.join(self.of)}: {worst}): {chosen} at rtol {self.rtol:g}, {self.reason}. Integrated in "
            f"{1e3 * self.time:.3g} ms; {1e3 * self.companion_time:.3g} ms more went into the estimate, by "
            f"{self.companion[0]} at rtol {self.companion[1]:g} from t = {begin:.4g} to {end:.4g} s"
            + (f", after {len(self.tried)} other ways." if self.tried else ".")
        )


class TargetMissed(SimulationError):
    """No way meets the target; ``best`` is the most accurate one, None where nothing could be integrated."""

    def __init__(self, message: str, best: Accuracy | None) -> None:
        super().__init__(message)
        self.best = best


@dataclass(slots=True, kw_only=True)
class Search:
    """A search under way.

    Attributes
    ----------
    run : of the full model
    simpler : runs of simpler models, by name, prepared when first asked for
    recorder : makes memory for the samples of a run, where they are wanted
    progress : called with the finished fraction of the candidate that is integrated
    record : samples of the last candidate
    fault : why the last way that failed did
    longest : steps of the longest candidate
    """

    run: Prepared
    simpler: Callable[[str], Prepared] | None = None
    recorder: Callable[[Prepared], Trajectory] | None = None
    progress: Callable[[float], None] | None = None
    record: Trajectory | None = None
    done: InParts | None = None
    fault: SimulationError | None = None
    seconds: float = 0.0
    longest: int = field(default=0)

    @property
    def limit(self) -> int:
        return max(GROWTH * self.longest, math.ceil(SPARE * self.run.cycles))

    def prepared(self, model: str) -> Prepared:
        """The run of a model."""
        if model == FULL or self.simpler is None:
            return self.run
        return self.simpler(model)

    def integrate(self, candidate: Candidate, run: Prepared, observables: Sequence[Observable]) -> InParts:
        """Integrate all of a run, with its samples.

        Raises
        ------
        SimulationError
            The way could not reach the end.
        """
        self.record = self.recorder(run) if self.recorder is not None else None
        self.done = integrate_parts(
            run,
            observables,
            *candidate.way,
            max_steps=self.limit,
            trajectory=self.record,
            progress=self.progress,
        )
        self.seconds += self.done.seconds
        self.longest = max(self.longest, self.done.steps)
        return self.done


def meet_target(
    run: Prepared,
    target: float,
    of: Sequence[str],
    trade: Trade | None = None,
    *,
    models: Sequence[str] = (FULL,),
    quasi_static: bool = True,
    search: Search | None = None,
) -> Accuracy:
    """Find a way that keeps a relative error on all quantities, and integrate by it.

    Parameters
    ----------
    run : of the full model
    target : relative error [1]
    of : quantities
    trade : a measurement of this scene, whose ranking is used
    models : names of the models that may be taken; those of simpler ones must be known to the search
    quasi_static : whether the quasi-static model may be taken
    search : keeps what was integrated last, for the caller

    Raises
    ------
    RequestError
        A target out of bounds, or unknown quantities.
    TargetMissed
        No way meets the target; the message says what the best one keeps.
    """
    names = (of,) if isinstance(of, str) else tuple(of)
    if not SMALLEST <= real(target) <= LARGEST:
        raise RequestError(
            f"The error asked for is {target!r:.80}. Allowed: a relative error from {SMALLEST:g} to {LARGEST:g}. "
            "Example: error=0.01 for 1 %."
        )
    target = real(target)
    observables = check_observables(run.model, names)
    search = search or Search(run=run)
    scales = model_scales(run.model, run.numbers, run.initial, run.duration, run.turn)
    oscillations = scales.frequency * min(run.turn, run.duration) / (2.0 * math.pi)
    stiff = scales.stiffness > STIFF or oscillations > MANY_OSCILLATIONS
    preferred = None
    if trade is not None and like_those_measured(run, trade):
        preferred = prefer(trade, target, names, models, quasi_static=quasi_static)
    elif trade is not None:
        # the ranking may still be right, the errors need not; and what a simpler model leaves out, a companion over a
        # part of the run need not meet
        preferred = prefer(trade, target, names, quasi_static=False)
        if preferred is not None:
            reason = f"{preferred.reason} (measured with other numbers, or length)"
            preferred = replace(preferred, median={}, promised={}, reason=reason)
    # what was measured on other parameters may not hold for these: then the ladder goes on from there
    waiting = [*([preferred] if preferred is not None else []), *rungs(target, observables, stiff=stiff)]
    tried: list[tuple[str, str, float, float]] = []
    best: Accuracy | None = None
    place = 0
    while place < len(waiting):
        candidate = waiting[place]
        place += 1
        reached = _judged(search, candidate, observables, names, target, tried)
        if reached is None:
            continue
        if candidate.safety * reached.estimate <= target:
            return reached
        tried.append((candidate.model, *candidate.way, reached.estimate))
        # a rung is a decade of tolerance, and about a decade of error: those that cannot be enough are left out
        if place < len(waiting) and (preferred is None or place > 1) and reached.estimate < math.inf:
            skipped = max(0, math.floor(math.log10(candidate.safety * reached.estimate / target)))
            place = min(place + skipped, len(waiting) - 1)
        if best is None or reached.estimate < best.estimate:
            best = reached
    raise TargetMissed(_refusal(target, names, best, search.fault), best)


def like_those_measured(run: Prepared, trade: Trade) -> bool:
    """Whether a run is one of those that a trade was measured on: numbers near the trade's, the start and length."""
    model = run.model
    asked = model.manifest.run.transient_cycles * run.turn if math.isfinite(run.turn) else 0.0
    return (
        run.numbers.parameters.keys() == trade.numbers.keys()
        and all(
            abs(value - trade.numbers[name]) <= 2.0 * trade.spread * abs(trade.numbers[name])
            for name, value in run.numbers.parameters.items()
        )
        and math.isclose(run.cycles, trade.cycles, rel_tol=2.0 * trade.spread)
        and math.isclose(run.start, asked, rel_tol=1e-9)
        and bool(np.all(run.initial == start_state(model, run.numbers, None)))
    )


def _judged(
    search: Search,
    candidate: Candidate,
    observables: Sequence[Observable],
    names: tuple[str, ...],
    target: float,
    tried: Sequence[tuple[str, str, float, float]],
) -> Accuracy | None:
    """A candidate, integrated and compared; None where it or its companion could not reach the end."""
    run = search.prepared(candidate.model)
    try:
        done = search.integrate(candidate, run, observables)
        # a trade has measured errors over whole runs, with all that the motion remembers
        own = None if candidate.promised else candidate.way
        verdict = check(run, done, observables, search.run, candidate.companion, candidate.rate, search.limit, own)
    except SimulationError as fault:
        # one way that fails is no reason to give up: the next one is tighter
        search.fault = fault
        return None
    search.seconds += verdict.seconds
    values = values_of(run, observables, done.rows)
    allowed = DIFFERENT * target if candidate.simple else 0.0
    estimates = [
        estimated(difference, candidate.median.get(name), candidate.promised.get(name), allowed)
        for name, difference in zip(names, verdict.differences, strict=True)
    ]
    return Accuracy(
        target=float(target),
        estimate=max(estimates),
        of=names,
        values=dict(zip(names, values.tolist(), strict=True)),
        estimates=dict(zip(names, estimates, strict=True)),
        model=candidate.model,
        method=candidate.way[0],
        rtol=candidate.way[1],
        companion=candidate.companion,
        part=(verdict.begin, verdict.end),
        tried=tuple(tried),
        reason=candidate.reason,
        time=done.seconds,
        companion_time=search.seconds - done.seconds,
    )


def estimated(difference: float, median: float | None, promised: float | None, allowed: float = 0.0) -> float:
    """Estimate of an error from the difference to a companion, and what a trade found for the way.

    Parameters
    ----------
    difference : relative, over a part of this run [1]
    median, promised : error of the way over the trade's ensemble, median and 95 % point; None where nothing was
        measured [1]
    allowed : a difference up to this does not speak against what was measured [1]
    """
    if median is None or promised is None or not median > 0.0 or not difference <= max(promised, allowed):
        # nothing measured, or a run that is not like those measured: the difference alone
        return difference
    difference = min(max(difference, LUCK * median), promised)
    return math.exp(WEIGHT * math.log(difference) + (1.0 - WEIGHT) * math.log(median))


def _refusal(target: float, names: tuple[str, ...], best: Accuracy | None, fault: SimulationError | None) -> str:
    asked = f"An error of {100 * target:g} % on {', '.join(names)} cannot be met"
    if best is None:
        why = f" The last one said: {fault}" if fault is not None else ""
        return f"{asked}: no method could integrate this run. Check initial state, damping and parameters.{why}"
    return (
        f"{asked}. The best is {100 * best.estimate:.2g} %, by {best.method} at rtol {best.rtol:g}. Where tightening "
        "does not help, the motion amplifies rounding (chaos), or the quantity is nearly zero: ask for a shorter run, "
        "a statistic (mean, rms) instead of an extreme, or a larger error."
    )
