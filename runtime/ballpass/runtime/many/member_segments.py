"""Segments and inputs of many members at once.

In: members and their spans.  Out: `MemberArrays` for the driver, a stretch of the runs after the other, and the moments
that magnitudes are taken from.  The driver's C finds them (`ballpass.runtime.native.member_schedule`).
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count

import numpy as np

from ballpass.runtime.many.members import Members, Spans
from ballpass.runtime.native.ensemble_driver import MemberArrays
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.request.request import check_memory
from ballpass.runtime.request.resolve import SCALED_TURNS
from ballpass.runtime.request.segments import TURNED, TURNS_A_SEARCH, WORK

#: Windows of `TURNS_A_SEARCH` turns that edges are sought in at a time, over all members of a chunk: about a second's
#: work.
MEMBER_WINDOWS = 128

#: Most segments of a stretch, over all its members: some ten megabytes with their inputs.  A window has more where a
#: load is fast and the shaft slow.
SEGMENTS = 65_536


def stretches(model: LoadedModel, members: Members, span: Spans, which: np.ndarray) -> Iterator[MemberArrays]:
    """Segments of some members, a stretch of their runs after the other; memory does not grow with the runs.

    A member whose run is over has no segments in later stretches.
    """
    schedule = model.ensemble_driver.schedule
    numbers = {"p": np.ascontiguousarray(members.p[which]), "c": np.ascontiguousarray(members.c[which])}
    values = np.hstack([numbers["p"], numbers["c"]])
    switching = [k for k, info in enumerate(model.manifest.inputs) if info.kind not in TURNED]
    gates = np.array(switching, dtype=np.int_)
    places = np.arange(len(which))
    windows = max(1, MEMBER_WINDOWS // len(which))
    before: np.ndarray | None = None
    for begin in count(0, windows):
        all_first, edges = _edges(
            model, values, (span.durations[which], span.turns[which], span.starts[which]), begin, windows
        )
        if all_first[-1] == 0:
            return
        columns = max(1, SEGMENTS // len(which))
        for skipped in range(0, int(np.max(np.diff(all_first))), columns):
            low = np.minimum(all_first[:-1] + skipped, all_first[1:])
            counts = np.minimum(low + columns, all_first[1:]) - low
            first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int_)
            owner = np.repeat(places, counts)
            at = np.arange(first[-1]) + (low + places - first[:-1])[owner]
            u = schedule.inputs(values, owner, edges[at], 0.5 * (edges[at] + edges[at + 1]))
            restarts = np.ones(len(u), dtype=np.uint8)
            restarts[1:] = np.any(np.diff(u[:, gates], axis=0) != 0.0, axis=1)
            going = np.flatnonzero(counts)
            if before is None:
                before = np.zeros((len(which), len(gates)))
                restarts[first[going]] = 1
            else:
                restarts[first[going]] = np.any(u[np.ix_(first[going], gates)] != before[going], axis=1)
            before[going] = u[np.ix_(first[going + 1] - 1, gates)]
            ends = np.repeat(places, counts + 1)
            times = edges[np.arange(len(ends)) + (low - first[:-1])[ends]]
            yield MemberArrays(**numbers, first=first, times=times, inputs=u, restarts=restarts)


def moments(
    model: LoadedModel, members: Members, span: Spans, which: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The moments that `ballpass.runtime.request.magnitudes` uses, as for a single run with reductions.

    Returns
    -------
    first moment of each member, shape (members + 1,); inputs at the moments, shape (moments, inputs); a turn, or the
    run, of each member, shape (members,) [s]
    """
    values, turns = np.hstack([members.p[which], members.c[which]]), span.turns[which]
    durations = np.minimum(span.durations[which], SCALED_TURNS * turns)
    horizons = np.minimum(durations, turns)
    first, edges = _edges(model, values, (durations, turns, np.full(len(which), -np.inf)), 0, 1)
    return *model.ensemble_driver.schedule.moments(values, first, edges, horizons), horizons


def _edges(
    model: LoadedModel,
    values: np.ndarray,
    spans: tuple[np.ndarray, np.ndarray, np.ndarray],
    begin: int,
    windows: int,
) -> tuple[np.ndarray, np.ndarray]:
    """First segment of each member, and ends of the segments, of so many windows from `begin` on.

    Raises
    ------
    RequestError
        They would not fit into memory.
    """
    schedule = model.ensemble_driver.schedule
    most = schedule.most(values, spans, TURNS_A_SEARCH, begin, windows)
    check_memory(
        f"Up to {most:.10g} segments, cut where a load switches and at every whole turn, of",
        most,
        len(model.manifest.inputs) + WORK,
        "Take a shorter run, or slower loads.",
    )
    return schedule.edges(values, spans, TURNS_A_SEARCH, begin, windows, most=max(most, 1.0))
