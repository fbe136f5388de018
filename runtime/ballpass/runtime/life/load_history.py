"""Loads of the balls along a run, added up until the lives that follow from them settle.

In: a model, numbers, a request.  Out: `LoadHistory`.  The balls are at other places at the load's peak in each turn, so
the life of two turns depends on the balls' first angle: the press of the paper repeats after 134 turns.  The turns are
doubled, and the run continues, until that changes no life by more than `LIVES` and no highest ball force by more than
`PEAKS` of settle.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.reduction_rows import HEAD, TURNED, reduction_rows
from ballpass.runtime.ratings.life import raceway_life
from ballpass.runtime.ratings.of_bearing import ratings_of, why_no_life
from ballpass.runtime.request.request import Request
from ballpass.runtime.request.resolve import Run, asked_span, resolve
from ballpass.runtime.run.reduced_run import ReducedRun
from ballpass.runtime.run.reductions import Reduction, raceway_powers, reduction_of
from ballpass.runtime.solution.settle import LEAST, PEAKS, doubled, until_alike
from ballpass.runtime.time import timeline
from ballpass.runtime.time.repetition import MOST_RUN, Repetition
from ballpass.runtime.time.turning import TURN

#: Relative change of a life that counts as zero [1].
LIVES = 1e-2


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadHistory:
    """Loads of all bearings over the steady part of a run.

    Attributes
    ----------
    run : the run, as long as it was
    turns : how long its steady part was; None where nothing turns
    fastest : highest speed of driver or shaft over its mean, 1 where it does not change [1]
    speeds : mean speed of the inner ring of each bearing against the outer one, by its prefix [rad/s]
    change : by the second half of the turns: of the life, or of the peak, that moved most, relative to itself [1]
    settled : whether that counts as none
    powers : mean powers of the loads at the places of both raceways of each bearing, see `raceway_powers`
    peaks : the highest force of any ball of each bearing, likewise
    """

    run: Run
    turns: float | None
    fastest: float
    speeds: Mapping[str, float]
    change: float
    settled: bool
    powers: Mapping[str, NDArray[np.float64]]
    peaks: Mapping[str, Reduction]


def load_history(model: LoadedModel, numbers: Numbers, request: Request) -> LoadHistory:
    """Add up the loads of the balls, over the turns asked for, else over as many as lives take to settle.

    Where nothing turns, or speed, load or slip follow a table over time, a run is as long as the scene says.

    Raises
    ------
    RequestError
        A wrong request.
    SimulationError
        The computation failed.
    """
    manifest = model.manifest
    repetition = Repetition.of(manifest, numbers.values)
    turn = repetition.turn
    span = asked_span(model, numbers, request)
    given = request.cycles is not None or request.duration is not None
    doubles = not given and repetition.holds(span.start)
    slowest, beat = repetition.slowest_load / turn, repetition.slowest_beat(MOST_RUN // 2 * turn) / turn
    turns: float = repetition.whole(max(LEAST, beat))
    if slowest > 1.0:  # whole periods of the load, as far as there are turns
        turns = slowest * math.ceil(turns / slowest)
    covered, turns = 2 * turns <= MOST_RUN, min(turns, MOST_RUN // 2)
    span = span.counting(turns) if doubles else span
    run = resolve(model, numbers, request, span=span)
    ends = doubled(span, turns, MOST_RUN) if doubles else ((run.start + run.end) / 2.0, run.end)
    found = until_alike(run, _channels(model), ends, _compared)
    return replace(found, settled=found.settled and (covered or not doubles))


def _channels(model: LoadedModel) -> list[str]:
    manifest = model.manifest
    names = [b.prefix + name for b in manifest.bearings for name in ("ball.force", TURNED)]
    if manifest.mechanism is not None and manifest.mechanism.rate:
        names.append(manifest.mechanism.rate)
    return names


def _history(going: ReducedRun) -> LoadHistory:
    """Loads so far."""
    manifest, layout = going.run.model.manifest, reduction_rows(going.run.model.manifest)
    duration = float(going.row[HEAD.index("duration")])
    values, span = going.run.numbers.values, (going.run.start, going.run.start + duration)
    speed, fastest = timeline.shaft_speed(manifest, values), 1.0
    if not timeline.one_speed(manifest, values):
        turning = timeline.driver(manifest, values)
        speed = turning.mean_rate(*span)
        fastest = turning.fastest_within(*span) / abs(speed) if speed else 1.0
    if manifest.mechanism is not None and manifest.mechanism.rate:
        rate = reduction_of(layout, going.row, manifest.mechanism.rate, duration)
        speed = rate.mean
        fastest = max(rate.maximum, -rate.minimum) / abs(speed) if speed else 1.0
    powers, peaks, speeds = {}, {}, {}
    for bearing in manifest.bearings:
        (powers[bearing.prefix],) = raceway_powers(manifest, bearing, going.row[None, :])
        peaks[bearing.prefix] = reduction_of(layout, going.row, f"{bearing.prefix}ball.force", duration)
        turned = going.row[layout.columns["integral", bearing.prefix + TURNED]]
        speeds[bearing.prefix] = float(turned) / duration
    return LoadHistory(
        run=replace(going.run, span=replace(going.run.span, end=going.run.start + duration)),
        turns=duration * abs(speed) / TURN if speed else None,
        fastest=fastest,
        speeds=speeds,
        change=math.inf,
        settled=False,
        powers=powers,
        peaks=peaks,
    )


def _compared(going: ReducedRun, before: LoadHistory | None) -> LoadHistory:
    """Loads so far, with the change since the last ones."""
    found = _history(going)
    if before is None:
        return found
    model, values = going.run.model, going.run.numbers.values
    moving = {**going.run.numbers.parameters, **timeline.set_moving(model.manifest, values)}
    turning = model.numbers(moving).values
    life, peak = 0.0, 0.0
    for bearing in going.run.model.manifest.bearings:
        prefix = bearing.prefix
        now, then = (h.peaks[prefix].maximum for h in (found, before))
        peak = max(peak, abs(1.0 - then / now) if now > 0.0 else 0.0)
        if not why_no_life(bearing, turning, timeline.shaft_speed(model.manifest, turning)):
            ratings = ratings_of(bearing, values)
            rings = ratings.inner_ball, ratings.outer_ball
            life = max(life, _moved(*(raceway_life(rings, h.powers[prefix], ratings.life) for h in (found, before))))
    return replace(found, change=max(life, peak), settled=life <= LIVES and peak <= PEAKS)


def _moved(now: float, then: float) -> float:
    """Change of a life, relative to itself; none where neither ends."""
    if math.isinf(now):
        return 0.0 if math.isinf(then) else 1.0
    return float(np.abs(1.0 - then / now))
