"""Motions at many points of parameters, each from the scene's start, in lanes.

In: a model, a table of points, a period of the equations.  Out: `PointMotions`.

All points go from reading to reading together: the state after a period of the equations is a start of the next one.
A derivative of a period is a difference of starts that are neighbours, so that points and neighbours fill the lanes.
Where readings come to a state that repeats, Newton's iteration finds it, and multipliers give the exponent; elsewhere
growth from reading to reading does.  Where differences sink into rounding, the stepper's tangents take their place.
"""

from __future__ import annotations

import ctypes
import time as clocks
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce

import numpy as np

from ballpass.runtime.contract.defaults import EXPONENT_RTOL, SECTION_RTOL
from ballpass.runtime.contract.errors import SimulationError
from ballpass.runtime.many.chunks import CHUNK, Chunk, Work, in_lanes, magnitudes
from ballpass.runtime.many.members import Members, Spans, make_members
from ballpass.runtime.motion.forcing_period import ForcingPeriod
from ballpass.runtime.motion.lyapunov import (
    ALIGN,
    NARROW,
    REPEATED,
    Exponent,
    kind_of_motion,
    largest_exponent,
    period_of,
    strobe_with_tangents,
)
from ballpass.runtime.motion.strobe import LONGEST_SOUGHT, come_to, may_repeat
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.reduction_rows import reduction_rows
from ballpass.runtime.request.choose_method import choose_method
from ballpass.runtime.request.locating import STEPPED_OVER
from ballpass.runtime.request.start import state_at
from ballpass.runtime.time import timeline

#: Distance of neighbouring starts, in shares of the magnitudes, and its factors: central differences near and far. What
#: these differ by is what the distance and integration errors leave [1].
ASIDE, FACTORS = 1e-5, (1.0, -1.0, 2.0, -2.0)

#: Differences give an exponent where it is so many times above what differs between near and far; else tangents do [1].
ABOVE_NOISE = 10.0

#: Points that do not repeat are read again so many times as long after: each begins at the scene's start, and what is
#: left of it comes and goes slowly.
LATER = 10

#: Newton's iterations; they are done where a step is below this share of the magnitudes, and end where one is above
#: `FAR` of them: the state is elsewhere [1].
ITERATIONS, CLOSE, FAR = 12, 1e-6, 1.0

#: Kind of a point whose run fails.
NONE = "no motion"


@dataclass(frozen=True, slots=True, kw_only=True)
class MapRequest:
    """What is asked of all points.

    Attributes
    ----------
    period : of the equations
    readings, settling : that are kept, and that do not count
    rtol : None: as for readings of one parameter
    exponent : whether exponents are computed
    """

    period: ForcingPeriod
    readings: int
    settling: int
    rtol: float | None
    exponent: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PointMotions:
    """Motions at points, each array of shape (points,).

    Attributes
    ----------
    kind : ``periodic n``, ``quasi-periodic``, ``chaotic``, ``undecided`` or `NONE`
    open : what would decide an undecided one, or why there is no motion; "" for others
    exponent, half : largest exponent per reading, and half its interval; NaN where there is none [1]
    returns : periods of the equations that were integrated, and processor time that they took [s], shape (2,)
    """

    kind: np.ndarray
    open: np.ndarray
    exponent: np.ndarray
    half: np.ndarray
    returns: np.ndarray


@dataclass(slots=True, kw_only=True)
class _Returns:
    """Periods of the equations from states of points.

    Attributes
    ----------
    times, turns : periods and turns of driver or shaft, shape (points,) [s]
    magnitude : of the states, shape (points, states)
    failed : why points have no motion
    count : of periods that were integrated
    """

    model: LoadedModel
    members: Members
    times: np.ndarray
    turns: np.ndarray
    magnitude: np.ndarray
    stop: ctypes.c_int
    failed: dict[int, str] = field(default_factory=dict)
    count: int = 0

    def after(
        self, points: np.ndarray, states: np.ndarray, periods: int, rtol: float, *, own: bool = True, void: bool = False
    ) -> np.ndarray:
        """States so many periods later, shape (members, states); NaN where a run fails.

        Parameters
        ----------
        points : of each member
        own : whether these are the points' own motions, and not neighbours or guesses: a failure is the point's
        void : find results that no bearing has as well

        Raises
        ------
        KeyboardInterrupt
            The caller asked to stop.
        """
        ends = np.full_like(states, np.nan)
        going = np.flatnonzero(np.all(np.isfinite(states), axis=1))
        for first in range(0, len(going), CHUNK):
            which = going[first : first + CHUNK]
            work = self.work(points[which], states[which], periods, rtol, void=void)
            in_lanes(work, Chunk(members=np.arange(len(which)), reached=np.zeros(len(which))))
            self.refuse_stopped()
            work.end[list(work.results)] = np.nan
            ends[which] = work.end
            self.count += periods * len(which)
            if own:
                self.failed |= {int(points[which[k]]): failure.message for k, failure in work.results.items()}
        return ends

    def refuse_stopped(self) -> None:
        """KeyboardInterrupt where the caller asked to stop."""
        if self.stop.value:
            raise KeyboardInterrupt

    def work(self, points: np.ndarray, states: np.ndarray, periods: int, rtol: float, *, void: bool) -> Work:
        """Runs from states of points, as `after` takes them."""
        members = Members(
            varied={},
            columns={name: column[points] for name, column in self.members.columns.items()},
            p=self.members.p[points],
            c=self.members.c[points],
            initial=np.ascontiguousarray(states),
            refused={},
        )
        starts = np.zeros(len(points))
        return Work(
            model=self.model,
            driver=self.model.ensemble_driver,
            members=members,
            span=Spans(durations=periods * self.times[points], turns=self.turns[points], starts=starts),
            method=choose_method(self.model, self.model.manifest.run.method, stepper=True)[0],
            rtol=rtol,
            kinks=STEPPED_OVER,
            lanes=True,
            reducing=void,
            end=members.initial.copy(),
            rows=reduction_rows(self.model.manifest).empty(len(points), starts, (), rtol),
            stop=self.stop,
            magnitude=self.magnitude[points],
        )

    def flows(
        self, points: np.ndarray, states: np.ndarray, rtol: float, factors: Sequence[float] = (1.0,), periods: int = 1
    ) -> tuple[np.ndarray, np.ndarray]:
        """States so many periods later, and their derivatives by those before in shares of the magnitudes.

        Parameters
        ----------
        factors : of `ASIDE`

        Returns
        -------
        shapes (members, states), (factors, members, states, states)
        """
        count, size = states.shape
        scale, aside = self.magnitude[points], ASIDE * np.array(factors)
        # of each member the state itself, then its neighbours by factor and state
        moved = np.concatenate([np.zeros((1, size)), *(step * np.eye(size) for step in aside)])
        starts = states[:, None] + moved * scale[:, None]
        ends = self.after(np.repeat(points, len(moved)), starts.reshape(-1, size), periods, rtol, own=False)
        ends = ends.reshape(count, len(moved), size)
        slopes = ((ends[:, 1:] - ends[:, :1]) / scale[:, None]).reshape(count, len(aside), size, size)
        return ends[:, 0], slopes.transpose(1, 0, 3, 2) / aside[:, None, None, None]


def motions(
    model: LoadedModel, table: Mapping[str, np.ndarray], asked: MapRequest, stop: ctypes.c_int | None = None
) -> PointMotions:
    """Motions at points, each from the scene's start.

    Parameters
    ----------
    table : overrides of each point, SI, each of shape (points,)
    stop : ends the call soon when it becomes nonzero

    Raises
    ------
    KeyboardInterrupt
        It did.
    """
    begun, members = clocks.thread_time(), make_members(model, table)
    count, able = len(members), np.array(sorted(set(range(len(members))) - set(members.refused)), dtype=np.int_)
    times, turns = np.ones(count), np.ones(count)
    for k in able.tolist():
        values = {name: float(column[k]) for name, column in members.columns.items()}
        times[k], turns[k] = asked.period.time(values), timeline.driver(model.manifest, values).turn
    returns = _Returns(
        model=model,
        members=members,
        times=times,
        turns=turns,
        magnitude=np.ones_like(members.initial),
        stop=ctypes.c_int(0) if stop is None else stop,
        failed=dict(members.refused),
    )
    rough, tight = SECTION_RTOL, EXPONENT_RTOL if asked.exponent else SECTION_RTOL
    if asked.rtol is not None:
        rough = tight = asked.rtol
    start = members.initial.copy()
    start[list(members.refused)] = np.nan
    if len(able):
        first = returns.work(able, start[able], max(asked.settling, 1), rough, void=False)
        returns.magnitude[able] = magnitudes(replace(first, magnitude=None), np.arange(len(able)))
    states = np.full((1 + ALIGN + asked.readings, *start.shape), np.nan)
    cycles: dict[int, np.ndarray] = {}
    for settling in (asked.settling, LATER * (asked.settling + asked.readings)):
        left = np.array([k for k in range(count) if k not in cycles and k not in returns.failed], dtype=np.int_)
        now = returns.after(left, start[left], settling, rough) if settling else start[left]
        for k in range(len(states)):
            states[k, left] = now = returns.after(left, now, 1, tight, void=k == len(states) - 1) if k else now
        start = states[-1]
        cycles |= _cycles(returns, states, [k for k in left.tolist() if k not in returns.failed], tight)
    going = [k for k in range(count) if k not in returns.failed]
    exponents = _exponents(returns, states, going, cycles, tight) if asked.exponent else {}
    going = [k for k in going if k not in returns.failed]
    kinds, opens = [NONE] * count, [returns.failed.get(k, "") for k in range(count)]
    for k in going:
        own = np.tile(cycles[k], (2, 1)) if k in cycles else states[1 + ALIGN :, k]
        kinds[k], opens[k] = kind_of_motion(own, returns.magnitude[k], exponents.get(k), (), forced=True)
    numbers = [exponents.get(k, Exponent(mean=np.nan, half=np.nan)) for k in range(count)]
    return PointMotions(
        kind=np.array(kinds),
        open=np.array(opens),
        exponent=np.array([one.mean for one in numbers]),
        half=np.array([one.half for one in numbers]),
        returns=np.array([returns.count, clocks.thread_time() - begun]),
    )


def _cycles(returns: _Returns, states: np.ndarray, going: Sequence[int], rtol: float) -> dict[int, np.ndarray]:
    """States of the motions that repeat, each of shape (period, states), by point: readings, or what they come to."""
    own = states[1 + ALIGN :]
    repeats = {k: period_of(own[:, k], returns.magnitude[k]) for k in going}
    found = {k: own[len(own) - period :, k] for k, period in repeats.items() if period}
    left = [k for k in going if repeats[k] != 1]  # as `Strobe.settled`, which says why
    for period in range(1, max([LONGEST_SOUGHT + 1, *repeats.values()])):
        todo = [
            k
            for k in left
            if period < (repeats[k] or LONGEST_SOUGHT + 1)
            and may_repeat(own[:, k], returns.magnitude[k], repeats[k], period)
        ]
        for k, state, size in _newton(returns, np.array(todo, dtype=np.int_), own[-1, todo], period, rtol):
            if come_to(own[:, k], returns.magnitude[k], period, state, size):
                left.remove(k)
                cycle = [state]
                while len(cycle) < period:
                    cycle.append(returns.after(np.array([k]), cycle[-1][None], 1, rtol)[0])
                found[k] = np.array(cycle)
    return found


def _newton(
    returns: _Returns, points: np.ndarray, states: np.ndarray, period: int, rtol: float
) -> list[tuple[int, np.ndarray, float]]:
    """States that repeat after so many readings, found from others: point, state, size of the largest multiplier."""
    states, going, found = states.copy(), np.arange(len(points)), []
    close = max(CLOSE, 100.0 * rtol)  # a run is no more exact than its tolerance
    for _ in range(ITERATIONS):
        if not len(going):
            break
        ends, (flows,) = returns.flows(points[going], states[going], rtol, periods=period)
        fine = np.all(np.isfinite(flows), axis=(1, 2))
        going, ends, flows = going[fine], ends[fine], flows[fine]
        scale = returns.magnitude[points[going]]
        left = (ends - states[going]) / scale
        steps = np.einsum("kij,kj->ki", np.linalg.pinv(np.eye(states.shape[1]) - flows), left)
        sizes = np.max(np.abs(steps), axis=1)
        states[going] += steps * scale
        found += [
            (int(points[k]), states[k], float(np.max(np.abs(np.linalg.eigvals(flow)))))
            for k, flow, size in zip(going, flows, sizes, strict=True)
            if size < close
        ]
        going = going[(sizes >= close) & (sizes < FAR)]
    return found


def _exponents(
    returns: _Returns, states: np.ndarray, going: Sequence[int], cycles: Mapping[int, np.ndarray], rtol: float
) -> dict[int, Exponent]:
    """Largest exponents by point; a point whose tangents fail is noted."""
    found: dict[int, Exponent] = {}
    repeating = [k for k in going if k in cycles]
    # those that repeat have few states each and fill the lanes together
    for group in filter(None, [repeating, *([k] for k in going if k not in cycles)]):
        starts = {k: cycles.get(k, states[:-1, k]) for k in group}
        points = np.repeat(group, [len(one) for one in starts.values()])
        _, slopes = returns.flows(points, np.concatenate(list(starts.values())), rtol, FACTORS)
        near, far = 0.5 * (slopes[::2] + slopes[1::2])
        for k in group:
            flows, own = (near[points == k], far[points == k]), states[1 + ALIGN :, k]
            exponent = _of_cycle(*flows) if k in cycles else _of_growth(*flows, own, returns.magnitude[k])
            if exponent is None:
                readings = 3 * len(cycles[k]) if k in cycles else len(own)
                exponent = _by_tangents(returns, k, starts[k][0], readings, rtol)
            if exponent is not None:
                found[k] = exponent
    return found


def _of_cycle(near: np.ndarray, far: np.ndarray) -> Exponent | None:
    """Exponent of a cycle from derivatives at two distances, each of shape (period, states, states); None where they
    differ too much."""
    period = len(near)
    products = [reduce(lambda done, flow: flow @ done, flows) for flows in (near, far)]
    noise = float(np.linalg.norm(products[0] - products[1]))
    if not np.isfinite(noise):
        return None
    size = float(np.max(np.abs(np.linalg.eigvals(products[0]))))
    if size < ABOVE_NOISE * noise:
        return None
    return Exponent(mean=float(np.log(size)) / period, half=(2.0 * noise / size + REPEATED) / period)


def _of_growth(near: np.ndarray, far: np.ndarray, states: np.ndarray, magnitude: np.ndarray) -> Exponent | None:
    """Exponent from the growth at each reading, by derivatives at two distances; None where they differ too much."""
    if not np.all(np.isfinite([near, far])):
        return None
    found, other = (largest_exponent(flows, states, magnitude) for flows in (near, far))
    return found if ABOVE_NOISE * abs(found.mean - other.mean) < max(found.half, NARROW) else None


def _by_tangents(returns: _Returns, point: int, start: np.ndarray, readings: int, rtol: float) -> Exponent | None:
    """Exponent by the stepper's tangents, as of one parameter, where differences sink into rounding."""
    numbers, step = returns.members.numbers(returns.model, point), float(returns.times[point])
    try:
        states, flows = strobe_with_tangents(
            returns.model,
            numbers,
            state_at(returns.model, numbers, 0.0, start),
            step,
            readings,
            returns.magnitude[point],
            rtol,
            returns.refuse_stopped,
        )
    except SimulationError as fault:
        returns.failed[point] = str(fault)
        return None
    returns.count += ALIGN + readings
    return largest_exponent(flows, states, returns.magnitude[point])
