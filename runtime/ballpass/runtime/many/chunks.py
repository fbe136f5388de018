"""Run an ensemble: chunks of members in threads, one stretch of their runs after the other.

In: `Work`.  Out: its rows of reductions and states at the end, filled; members without results, and why.

A stretch is some turns of all members of a chunk, so that memory does not grow with the runs.  What members carry from
one stretch to the next is in the driver's `Carried`: steps and bits are those of runs in one go.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field, replace

import numpy as np

from ballpass.runtime.contract.method_registry import STEPPERS
from ballpass.runtime.contract.status import Status
from ballpass.runtime.many.member_segments import moments, stretches
from ballpass.runtime.many.members import Members, Spans
from ballpass.runtime.native.ensemble_driver import STOPPED, EnsembleDriver, MemberNumbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.reduction_rows import void_moment
from ballpass.runtime.native.stepper import End
from ballpass.runtime.request.locating import Kinks
from ballpass.runtime.request.resolve import Run
from ballpass.runtime.run.limits import brief_limit
from ballpass.runtime.run.loop import STATUS_OF_END, ReductionRow, RunFailed, RunUnderWay
from ballpass.runtime.time.span import Span
from ballpass.runtime.time.timeline import driver

#: Most members of a chunk: so many that lanes that are empty at its end cost little.
CHUNK = 128

#: Fewest chunks of an ensemble, as far as its members fill lanes: threads share them.
CHUNKS = 16

#: Longest delay of an interrupt, and between two calls of progress [s].
PATIENCE = 0.2

#: Counts over all members.
COUNTS = ("steps", "rejected", "evaluations", "switches", "pivoted")


@dataclass(frozen=True, slots=True, kw_only=True)
class MemberFailure:
    """A member without results.

    Attributes
    ----------
    member : its place in the table
    status : a name of `ballpass.runtime.contract.status.Status`, ``REFUSED`` where its numbers cannot be simulated, or
        ``INTERRUPTED``
    time : reached; of void results, when a ball is flattened most [s]
    message : cause and remedy

    Examples
    --------
    >>> table = {"mechanism.bodies.slider.mass": [16.0, -1.0]}  # [kg]
    >>> many = model.simulate_many(table, "rms:inner.y", cycles=3)
    >>> many.failures[0].member, many.failures[0].message
    (1, 'mechanism.bodies.slider.mass: allowed is a number above 0 [kg], not -1.')
    """

    member: int
    status: str
    time: float
    message: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    """Input of the chunks, and the rows that they fill.

    Attributes
    ----------
    driver : None for a model without states
    method, rtol, kinks : how to integrate
    lanes : whether members advance in lanes, or one by one
    end : states of all members, at the start and then at the end, shape (members, states)
    rows : reductions of all members, shape (members, .)
    reducing : whether any channel is reduced
    magnitude : of the states, shape (members, states); None: as their own runs have them
    results : members without results
    counts : of `COUNTS`, over all members
    stop : asks the threads to end soon when it becomes nonzero
    """

    model: LoadedModel
    driver: EnsembleDriver | None
    members: Members
    span: Spans
    method: str
    rtol: float
    kinks: Kinks
    lanes: bool
    reducing: bool
    end: np.ndarray
    rows: np.ndarray
    stop: ctypes.c_int
    magnitude: np.ndarray | None = None
    results: dict[int, MemberFailure] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=lambda: dict.fromkeys(COUNTS, 0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Chunk:
    """Some members, their places in the table, and the times they have reached [s]; each of shape (members,)."""

    members: np.ndarray
    reached: np.ndarray


def chunk_size(members: int, lanes: int) -> int:
    """Members of a chunk: a multiple of the lanes, from the number of members alone."""
    wanted = -(-members // CHUNKS)
    return min(CHUNK, max(1, -(-wanted // lanes)) * lanes)


def run_chunks(work: Work, able: np.ndarray, size: int, threads: int, progress: Callable[[float], None]) -> bool:
    """Let threads work through the chunks.

    Parameters
    ----------
    able : members to run, in order
    size : members of a chunk
    progress : called with the finished part of all runs, whenever a chunk ends and at least every `PATIENCE`

    Returns
    -------
    whether the user interrupted
    """
    durations, reached = work.span.durations[able], np.zeros(len(able))
    chunks = [Chunk(members=able[k : k + size], reached=reached[k : k + size]) for k in range(0, len(able), size)]
    interrupted = False
    pending: dict[Future[dict[str, int]], Chunk] = {}
    with ThreadPoolExecutor(max_workers=threads, thread_name_prefix="ballpass") as pool:
        try:
            for chunk in chunks:
                pending[pool.submit(in_lanes if work.lanes else _one_by_one, work, chunk)] = chunk
            while pending:
                # with a limit: without one, an interrupt does not end the wait of the main thread on every system
                finished, _ = wait(pending, timeout=PATIENCE, return_when=FIRST_COMPLETED)
                for future in finished:
                    _add(work.counts, future.result())
                    chunk = pending.pop(future)
                    chunk.reached[:] = work.span.durations[chunk.members]
                progress(float(np.sum(np.minimum(reached / durations, 1.0))) / len(able))
        except BaseException as fault:
            work.stop.value = 1
            for future, chunk in pending.items():
                if future.cancel():
                    for member in chunk.members.tolist():
                        note_failure(work, member, "INTERRUPTED", "Interrupted before it began.")
            if not isinstance(fault, KeyboardInterrupt):
                raise
            interrupted = True
            for future in pending:
                if not future.cancelled():
                    _add(work.counts, future.result())
    return interrupted


def _add(counts: dict[str, int], more: Mapping[str, int]) -> None:
    for name, count in more.items():
        counts[name] += count


def note_failure(work: Work, member: int, status: str, message: str, time: float = 0.0) -> None:
    """Note that a member has no results, and the time that it reached [s]."""
    work.results[member] = MemberFailure(member=member, status=status, time=time, message=message)


def magnitudes(work: Work, which: np.ndarray) -> np.ndarray:
    """Magnitudes of the states of some members, shape (members, states)."""
    if work.magnitude is not None:
        return np.asarray(work.magnitude[which])
    if work.driver is None:
        return np.zeros((len(which), 0))
    numbers = MemberNumbers(p=work.members.p[which], c=work.members.c[which])
    first, inputs, horizons = moments(work.model, work.members, work.span, which)
    return work.driver.magnitudes(numbers, work.members.initial[which], first, inputs, horizons)


def member_run(work: Work, member: int, magnitude: np.ndarray | None = None) -> Run:
    """The run of one member.

    Parameters
    ----------
    magnitude : of the states, where it is known, shape (states,)
    """
    duration, start = float(work.span.durations[member]), float(work.span.starts[member])
    numbers = work.members.numbers(work.model, member)
    turning = driver(work.model.manifest, numbers.values)
    return Run(
        model=work.model,
        numbers=numbers,
        span=Span(turning=turning, begin=0.0, start=start, end=duration, transient=turning.turns(0.0, start)),
        initial=work.members.initial[member],
        method=work.method,
        rtol=work.rtol,
        kinks=work.kinks,
        magnitude=magnitudes(work, np.array([member]))[0] if magnitude is None else magnitude,
    )


def in_lanes(work: Work, chunk: Chunk) -> dict[str, int]:
    """Integrate a chunk's members, several together; one that takes too many steps continues alone."""
    which, driver = chunk.members, work.driver
    assert driver is not None  # there are states
    magnitude = magnitudes(work, which)
    x = work.members.initial[which]
    rows = work.rows[which] if work.reducing else None
    durations = work.span.durations[which]
    limits = np.array(list(map(brief_limit, durations.tolist(), work.span.turns[which].tolist())))
    carried = driver.carry(len(which))
    results = carried.results
    for arrays in stretches(work.model, work.members, work.span, which):
        if work.stop.value:
            break
        driver.run(
            STEPPERS[work.method],
            arrays,
            x,
            work.rtol * magnitude,
            rows,
            work.stop,
            max_steps=limits,
            carried=carried,
            reached=chunk.reached,
        )
        going = (results["status"] == End.DONE) & (results["time"] < durations)
        if not np.any(going):
            break
    work.end[which] = x
    if rows is not None:
        work.rows[which] = rows
    counts = {name: int(results[name].sum()) for name in COUNTS}
    for place in np.flatnonzero(results["status"] == End.TOO_MANY_STEPS).tolist():
        _alone(work, chunk, place, magnitude[place], counts, results[place])
    others = results["status"] != End.TOO_MANY_STEPS
    failed = others & ((results["status"] != End.DONE) | (results["time"] < durations))
    for place in np.flatnonzero(failed).tolist():
        member, result = int(which[place]), results[place]
        if result["status"] in (STOPPED, End.DONE):
            status, message = "INTERRUPTED", "Interrupted on its way."
        else:
            ending = STATUS_OF_END[End(int(result["status"]))]
            state = f", worst state {work.model.states[result['state']]}" if result["state"] >= 0 else ""
            status, message = ending.name, f"{ending.value} Step size {result['step']:.3g} s{state}."
        note_failure(work, member, status, message, float(result["time"]))
    if rows is not None:
        for place in np.flatnonzero(results["status"] == End.DONE).tolist():
            member = int(which[place])
            values = {name: float(all_[member]) for name, all_ in work.members.columns.items()}
            if found := void_moment(work.model.manifest, values, rows[place]):
                note_failure(work, member, Status.VOID.name, *found)
    return counts


def _one_by_one(work: Work, chunk: Chunk) -> dict[str, int]:
    """Integrate a chunk's members by the driver of single runs."""
    magnitude = magnitudes(work, chunk.members)
    counts = dict.fromkeys(COUNTS, 0)
    for place in range(len(chunk.members)):
        if work.stop.value:
            note_failure(work, int(chunk.members[place]), "INTERRUPTED", "Interrupted before it began.")
        else:
            _alone(work, chunk, place, magnitude[place], counts)
    return counts


def _alone(
    work: Work, chunk: Chunk, place: int, magnitude: np.ndarray, counts: dict[str, int], begun: np.void | None = None
) -> None:
    """Integrate one member of a chunk by the driver of single runs, from where it is; adds its steps to `counts`.

    Parameters
    ----------
    begun : the part that it has run in lanes
    """
    member = int(chunk.members[place])
    duration = float(work.span.durations[member])

    def tell(fraction: float) -> None:
        chunk.reached[place] = fraction * duration

    run = replace(member_run(work, member, magnitude), progress=tell)
    going = RunUnderWay(
        run=run,
        sinks=[ReductionRow(row=work.rows[member])],
        state=work.end[member],
        time=0.0 if begun is None else float(begun["time"]),
        stop=work.stop,
        steps=0 if begun is None else int(begun["steps"]),
        rejected=0 if begun is None else int(begun["rejected"]),
    )
    before = going.steps, going.rejected
    try:
        going.go_on()
    except RunFailed as fault:
        note_failure(work, member, fault.status.name, str(fault), fault.time)
        return
    counts["steps"] += going.steps - before[0]
    counts["rejected"] += going.rejected - before[1]
    if going.time < duration:
        note_failure(work, member, "INTERRUPTED", "Interrupted on its way.", going.time)
