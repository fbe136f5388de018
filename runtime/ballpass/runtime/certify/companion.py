"""The error of one very run, from a companion: a more accurate run over a part of it, from the run's own state.

In: a run integrated in parts, observables, a more accurate way.  Out: a `Check`: relative differences.

The part is the one in which the peak lies, and as many before it as the budget allows.  There the companion starts
from the state that the run itself had, so that both meet the same contacts; what they differ in is the error that the
run makes in that part.  The error that it brought along is not seen by it.  How much of it is left, or what became of
it where the motion is chaotic, a third run tells where nothing was measured before: a loose one, displaced at the start
of the part.  A companion that is less accurate than the run, over all of it, would cost as much and say little: contact
makes errors of two runs as good as independent draws.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ballpass.runtime.certify.parts import InParts, integrate_parts, values_of
from ballpass.runtime.certify.quasi_static import NAME as QUASI_STATIC
from ballpass.runtime.native.reduction_rows import HEAD

if TYPE_CHECKING:
    from ballpass.runtime.certify.prepared import Observable, Prepared

#: What a companion may take, as a part of the time of the run [1].
BUDGET = 0.4

#: A companion that starts where the peak is has no time to differ: it starts before, by this much of a part [1].
LEAD = 0.1

#: How the memory of the motion is measured first: by this way, where the run's own is not a looser one, and with a
#: displacement of this part of the states' magnitudes [1].
PROBE, FARTHEST = ("stepper-rodas4", 1e-2), 0.05

#: Where more than this is left of it at the end of the part, the run's own way tells what becomes of a small
#: displacement, of so many tolerances: what is large cannot grow, also where the motion is chaotic.
SETTLED, SMALL = 0.5, 300.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """A companion's verdict.

    Attributes
    ----------
    differences : between run and companion over the part, relative to the values of the whole run, and with the error
        that earlier parts left [1]
    begin, end : the part [s]
    growth : of a displacement over the part; None where it was not measured [1]
    seconds : of all that was integrated [s]
    """

    differences: tuple[float, ...]
    begin: float
    end: float
    growth: float | None
    seconds: float


def check(
    run: Prepared,
    done: InParts,
    observables: Sequence[Observable],
    judge: Prepared,
    way: tuple[str, float],
    rate: float,
    max_steps: int,
    own: tuple[str, float] | None,
) -> Check:
    """Integrate a part of a run once more.

    Parameters
    ----------
    run, done : the run, integrated in all its parts
    judge : the run that the companion integrates: the same one, or that of the full model where `run` is of a simpler
        one; its parts are those of `run`
    way : of the companion, method and tolerance
    rate : time of the companion over that of the run, for the same turn, as expected
    max_steps : of the companion
    own : the run's own way, by which its memory is measured; None: it is known to be short

    Raises
    ------
    SimulationError
        The companion could not reach the end of the part.
    """
    first, behind = chosen_part(run, done, observables, rate)
    start = as_start(run, judge, done.states[first])
    again = integrate_parts(judge, observables, *way, first=first, behind=behind, state=start, max_steps=max_steps)
    here, there = (values_of(one, observables, of.of(first, behind)) for one, of in ((run, done), (judge, again)))
    begin, end = (float(run.segments.times[run.parts[k]]) for k in (first, behind))
    differences = np.array(relative(here - there, values_of(run, observables, done.rows)))
    seconds, growth = again.seconds, None
    if own is not None and first > 0 and own[0] != QUASI_STATIC:
        # a run that is looser than the probe is no measure of it: its companion is
        probe, base = (way, again) if own[1] > PROBE[1] else (PROBE, done)
        growth, more = _growth(judge, base, observables, (*probe, FARTHEST), (first, behind), max_steps)
        seconds += more
        if growth > SETTLED and own[1] < PROBE[1]:
            size = min(SMALL * own[1], FARTHEST)
            growth, more = _growth(run, done, observables, (*own, size), (first, behind), max_steps)
            seconds += more
        # as many parts as this one came before, and each left its error behind
        with np.errstate(over="ignore"):
            differences *= np.sum(np.power(growth, np.arange(1 + int(begin / (end - begin) + 0.5))))
    return Check(differences=tuple(differences.tolist()), begin=begin, end=end, growth=growth, seconds=seconds)


def _growth(
    run: Prepared,
    base: InParts,
    observables: Sequence[Observable],
    how: tuple[str, float, float],
    parts: tuple[int, int],
    max_steps: int,
) -> tuple[float, float]:
    """What becomes of a displacement over some parts, as a factor, and the time it took to find out [s].

    Parameters
    ----------
    base : the parts without the displacement
    how : method, tolerance, and displacement relative to the magnitudes of the states [1]
    parts : the first, and that behind the last
    """
    first, behind = parts
    method, rtol, size = how
    signs = np.where(np.arange(len(run.initial)) % 2 == 0, 1.0, -1.0)
    moved = integrate_parts(
        run,
        observables,
        *(method, rtol),
        first=first,
        behind=behind,
        state=base.states[first - base.first] + size * signs * run.magnitude,
        max_steps=max_steps,
    )
    left = np.abs(moved.states[-1] - base.states[behind - base.first]) / run.magnitude
    return float(left.max()) / size, moved.seconds


def chosen_part(run: Prepared, done: InParts, observables: Sequence[Observable], rate: float) -> tuple[int, int]:
    """First part and the one behind the last that a companion integrates."""
    counted = np.flatnonzero(done.rows[:, HEAD.index("duration")] > 0.0).tolist()
    begins = run.segments.times[list(run.parts)]
    extreme = next((k for k, (kind, _) in enumerate(observables) if kind in ("max", "min", "range")), None)
    first = last = counted[-1]
    length = BUDGET * run.duration / max(rate, 1e-3)
    if extreme is not None:
        kind, channel = observables[extreme]
        which = "min" if kind == "min" else "max"
        driver = run.model.ensemble_driver
        values = done.rows[counted, driver.rows.column(which, channel)]
        first = last = counted[int(np.argmin(values) if which == "min" else np.argmax(values))]
        peak = done.rows[last, driver.rows.column(f"{which}_time", channel)]
        lead = LEAD * (begins[last + 1] - begins[last])
        if peak - begins[first] < lead and first > 0 and _integrated(run, done, first - 1):
            first -= 1
    while first > 0 and begins[last + 1] - begins[first - 1] <= length and _integrated(run, done, first - 1):
        first -= 1
    return first, last + 1


def _integrated(run: Prepared, done: InParts, part: int) -> bool:
    """Whether the run has a state of its own at the start of a part: the quasi-static model skips the transient."""
    return part == 0 or bool(np.any(done.states[part] != run.initial))


def as_start(run: Prepared, judge: Prepared, state: np.ndarray) -> np.ndarray:
    """A state of the run as one of the companion's: what a simpler model has no state for is at rest in the middle."""
    if run.model.states == judge.model.states:
        return state
    own = dict(zip(run.model.states, state.tolist(), strict=True))
    return np.array([own.get(name, 0.0) for name in judge.model.states])


def relative(differences: np.ndarray, values: np.ndarray) -> tuple[float, ...]:
    """Relative to values; infinite for a quantity that is zero or no number, unless both runs say zero."""
    with np.errstate(divide="ignore", invalid="ignore"):
        found = np.abs(differences) / np.abs(values)
    # two runs that agree to the last bit still round
    known = np.where(np.isfinite(found), np.maximum(found, np.finfo(float).eps), np.inf)
    return tuple(np.where((differences == 0.0) & (values == 0.0), np.finfo(float).eps, known).tolist())
