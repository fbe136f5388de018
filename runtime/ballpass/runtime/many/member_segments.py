"""Segments and inputs of many members at once.

In: members and their spans.  Out: `MemberArrays` for the driver, a stretch of the runs after the other, and the moments
that magnitudes are taken from.

Edges are those of single runs to the last bit: the same formulas, for all members in one array.  Where edges come so
close that rules about equal times decide, or a run is long, `edge_windows` finds them for one member after another.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from ballpass.runtime.contract import InputInfo
from ballpass.runtime.many.members import Members, Span, groups
from ballpass.runtime.native.ensemble_driver import MemberArrays
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.run import inputs as clock
from ballpass.runtime.run.magnitudes import MOMENTS
from ballpass.runtime.run.reduced_run import SCALED_TURNS
from ballpass.runtime.run.segments import LARGEST_PHASE, TURNS_A_SEARCH, edge_windows, segment_edges

#: Edges closer than this fraction of run or turn are left to `edge_windows`; far above its own resolutions [1].
CLOSE = 1e-8

#: Windows of `TURNS_A_SEARCH` turns that edges are sought in at a time, over all members of a chunk: about a second's
#: work.
MEMBER_WINDOWS = 128

#: Most segments of a stretch, over all its members: some ten megabytes with their inputs.  A window has more where a
#: load is fast and the shaft slow.
SEGMENTS = 65_536

#: Most passages of a gate's edge that are sought at once.
PASSAGES = 4 * TURNS_A_SEARCH


@dataclass(frozen=True, slots=True, kw_only=True)
class _Part:
    """Some members, and what their edges and inputs are made of.

    Attributes
    ----------
    which : their places in the table, shape (members,)
    columns : parameters and constants that inputs name, each of shape (members,)
    durations, turns, starts : their spans, shape (members,) [s]
    """

    which: np.ndarray
    columns: Mapping[str, np.ndarray]
    durations: np.ndarray
    turns: np.ndarray
    starts: np.ndarray


def stretches(model: LoadedModel, members: Members, span: Span, which: np.ndarray) -> Iterator[MemberArrays]:
    """Segments of some members, a stretch of their runs after the other; memory does not grow with the runs.

    A member whose run is over has no segments in later stretches.
    """
    inputs = model.manifest.inputs
    part = _part(model, members, span, which)
    numbers = {"p": np.ascontiguousarray(members.p[which]), "c": np.ascontiguousarray(members.c[which])}
    gates = np.array([k for k, info in enumerate(inputs) if info.kind != "phase"], dtype=np.int_)
    before: np.ndarray | None = None
    for edges in _cut(_edges(model, members, part, windows=max(1, MEMBER_WINDOWS // len(which)))):
        counts = np.sum(np.isfinite(edges), axis=1) - 1
        within = np.arange(edges.shape[1] - 1) < counts[:, None]
        left, right = edges[:, :-1][within], edges[:, 1:][within]
        u = inputs_of(inputs, part.columns, np.repeat(np.arange(len(which)), counts), left, 0.5 * (left + right))
        first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int_)
        restarts = np.ones(len(left), dtype=np.uint8)
        restarts[1:] = np.any(np.diff(u[:, gates], axis=0) != 0.0, axis=1)
        going = np.flatnonzero(counts)
        if before is None:
            before = np.zeros((len(which), len(gates)))
            restarts[first[going]] = 1
        else:
            restarts[first[going]] = np.any(u[np.ix_(first[going], gates)] != before[going], axis=1)
        before[going] = u[np.ix_(first[going + 1] - 1, gates)]
        yield MemberArrays(**numbers, first=first, times=edges[np.isfinite(edges)], inputs=u, restarts=restarts)


def moments(
    model: LoadedModel, members: Members, span: Span, which: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The moments that `ballpass.runtime.run.magnitudes` looks at, as for a single run with reductions.

    Returns
    -------
    first moment of each member, shape (members + 1,); inputs at the moments, shape (moments, inputs); a turn, or the
    run, of each member, shape (members,) [s]
    """
    inputs = model.manifest.inputs
    whole = _part(model, members, span, which)
    part = replace(
        whole, durations=np.minimum(whole.durations, SCALED_TURNS * whole.turns), starts=np.zeros(len(which))
    )
    (edges,) = _edges(model, members, part, windows=None)
    counts = np.sum(np.isfinite(edges), axis=1) - 1
    horizons = np.minimum(part.durations, part.turns)
    middles = 0.5 * (edges[:, :-1] + edges[:, 1:])
    times = np.full((len(edges), 2 * MOMENTS), np.inf)
    times[:, MOMENTS:] = horizons[:, None] * ((np.arange(MOMENTS) + 0.5) / MOMENTS)
    for count in np.unique(counts).tolist():
        alike = counts == count
        picked = np.unique(np.linspace(0, count - 1, MOMENTS).astype(int))
        times[alike, : len(picked)] = middles[np.ix_(alike, picked)]
    used = np.isfinite(times)
    number = np.sum(used, axis=1)
    found = times[used]
    u = inputs_of(inputs, part.columns, np.repeat(np.arange(len(edges)), number), found, found)
    return np.concatenate([[0], np.cumsum(number)]).astype(np.int_), u, horizons


def _part(model: LoadedModel, members: Members, span: Span, which: np.ndarray) -> _Part:
    return _Part(
        which=which,
        columns={name: members.columns[name][which] for name in _named(model.manifest.inputs)},
        durations=span.durations[which],
        turns=span.turns[which],
        starts=span.starts[which],
    )


def _edges(model: LoadedModel, members: Members, part: _Part, windows: int | None) -> Iterator[np.ndarray]:
    """Begin, breakpoints, whole turns, where reductions start, and end of each member's run, a stretch after the other.

    Parameters
    ----------
    windows : of `edge_windows` in a stretch; None: a run, which then is short, is all one

    Yields
    ------
    array, shape (members, edges), increasing along a row and filled up with infinity; of a run that is over, its end
    alone [s]
    """
    found, clear = _clear_edges(model.manifest.inputs, part)
    others = np.flatnonzero(~clear)
    names = _timing(model.manifest.inputs)
    timing = [*(part.columns[name] for name in names), part.durations, part.turns, part.starts]
    apart: list[tuple[np.ndarray, Iterator[np.ndarray]]] = []
    for group in groups(np.column_stack([column[others] for column in timing])) if len(others) else []:
        one = int(others[group[0]])
        numbers = members.timing(model, names, int(part.which[one]))
        duration, turn, start = float(part.durations[one]), float(part.turns[one]), float(part.starts[one])
        if windows is None:
            run = iter([segment_edges(model, numbers, 0.0, duration, turn)])
        else:
            run = edge_windows(model, numbers, duration, turn, start)
        apart.append((others[group], run))
    ends = np.where(np.arange(found.shape[1]) == 0, part.durations[:, None], np.inf)
    found = np.where(clear[:, None], found, ends)
    while True:
        next_ones = [(places, list(islice(run, windows or 1))) for places, run in apart]
        rows = [(places, _joined(parts)) for places, parts in next_ones if parts]
        if not rows and not np.any(np.isfinite(found[:, 1:])):
            return
        width = max(found.shape[1], *(len(edges) for _, edges in rows), 2)
        found = np.pad(found, ((0, 0), (0, width - found.shape[1])), constant_values=np.inf)
        for places, edges in rows:
            found[places, : len(edges)] = edges
        yield found
        found = ends


def _cut(stretched: Iterable[np.ndarray]) -> Iterator[np.ndarray]:
    """Edges as from `_edges`, in stretches of `SEGMENTS` at most."""
    for edges in stretched:
        columns = max(1, SEGMENTS // len(edges))
        ends = np.max(edges, axis=1, where=np.isfinite(edges), initial=0.0)
        for begin in range(0, edges.shape[1] - 1, columns):
            piece = edges[:, begin : begin + columns + 1].copy()
            piece[:, 0] = np.minimum(piece[:, 0], ends)
            yield piece


def _joined(windows: Sequence[np.ndarray]) -> np.ndarray:
    """Windows that begin where the ones before end, as one."""
    return np.concatenate([windows[0], *(window[1:] for window in windows[1:])])


def _clear_edges(inputs: Sequence[InputInfo], part: _Part) -> tuple[np.ndarray, np.ndarray]:
    """Edges as from `edge_windows`, and for which members they are right: no two come close."""
    durations, turns, starts = part.durations, part.turns, part.starts
    close = CLOSE * np.maximum(durations, np.where(np.isfinite(turns), turns, 0.0))
    clear = durations <= TURNS_A_SEARCH * turns
    split = starts > 0.0
    stops = np.column_stack([np.zeros(len(durations)), np.where(split, starts, np.inf), durations])
    # what `edge_windows` surely drops for being at a stop: half of its least resolution
    at_a_stop = 0.5 * clock.TIME_RESOLUTION * np.where(split, starts, durations)
    cuts = []
    whole = turns[:, None] * np.arange(1, 1 + int(np.max(np.where(clear, durations / turns, 0.0), initial=0.0)))
    cuts.append(np.where(np.isfinite(whole), whole, np.inf))
    for times, fine in _breakpoints(inputs, part):
        cuts.append(times)
        clear &= fine
    times = np.column_stack(cuts)
    with np.errstate(invalid="ignore"):
        away = np.min(np.abs(times[:, :, None] - stops[:, None, :]), axis=2, initial=np.inf)
        inside = (times > 0.0) & (times < durations[:, None])
        clear &= ~np.any(inside & (away > at_a_stop[:, None]) & (away < close[:, None]), axis=1)
        kept = np.where(inside & (away > at_a_stop[:, None]), times, np.inf)
        edges = np.sort(np.column_stack([stops, kept]), axis=1)
        steps = np.diff(edges, axis=1)
        clear &= ~np.any(steps < close[:, None], axis=1)
        # a phase that turns far in a segment: it is cut there
        lengths = np.where(np.isfinite(steps), steps, 0.0)
        fastest = np.max(
            [np.abs(part.columns[item.rate]) for item in inputs if item.kind == "phase"], axis=0, initial=0.0
        )
        clear &= ~np.any(~(lengths * np.reshape(fastest, (-1, 1)) / LARGEST_PHASE <= 1.0), axis=1)
    width = int(np.max(np.sum(np.isfinite(edges), axis=1)))
    return edges[:, :width], clear


def _breakpoints(inputs: Sequence[InputInfo], part: _Part) -> Iterable[tuple[np.ndarray, np.ndarray]]:
    """Times at which a gate's edge is passed or a table has a knot, (members, .) [s]; and for whom they are all."""
    everybody = np.ones(len(part.which), dtype=bool)
    for item in inputs:
        if item.kind == "gate":
            offset, rate = part.columns[item.offset], part.columns[item.rate]
            for start, width in _windows(item, part.columns):
                switching = (width > 0.0) & (width < clock.TURN) & (rate != 0.0)
                for edge in (start, start + width):
                    turns = np.array([offset - edge, offset + rate * part.durations - edge]) / clock.TURN
                    first = np.ceil(np.min(turns, axis=0) - 1e-9)
                    count = np.where(switching, np.floor(np.max(turns, axis=0) + 1e-9) - first + 1.0, 0.0)
                    few = count <= PASSAGES
                    numbers = np.arange(int(np.max(count, where=few, initial=0.0)))
                    whole = clock.TURN * (first[:, None] + numbers)
                    with np.errstate(divide="ignore", invalid="ignore"):
                        times = ((edge - offset)[:, None] + whole) / rate[:, None]
                    yield np.where(numbers < count[:, None], times, np.inf), few
        elif item.kind in ("table", "table_rate"):
            yield np.column_stack([part.columns[name] for name in item.times]), everybody


def _windows(item: InputInfo, columns: Mapping[str, np.ndarray]) -> list[tuple[np.ndarray, np.ndarray]]:
    """(start in [0, 2 pi), width) of each window [rad], each of shape (members,); the rules of `clock`."""
    near = clock.ANGLE_RESOLUTION
    found = []
    for begin, finish in item.windows:
        start, end = columns[begin], columns[finish]
        width = end - start
        wrapped = width % clock.TURN
        wrapped = np.where(clock.TURN - wrapped < near, 0.0, wrapped)
        width = np.where(width < 0.0, wrapped, np.where(width > clock.TURN - near, clock.TURN, width))
        found.append((start % clock.TURN, width))
    return found


def _named(inputs: Sequence[InputInfo]) -> list[str]:
    """Parameters and constants that inputs are made of."""
    names: list[str] = []
    for item in inputs:
        if item.kind in ("table", "table_rate"):
            names += (*item.times, *item.values)
        else:
            names += [item.offset, item.rate, *(name for window in item.windows for name in window)]
    return list(dict.fromkeys(names))


def _timing(inputs: Sequence[InputInfo]) -> list[str]:
    """Those that decide when loads switch, and the rates of phases: segments end before one gets large."""
    return list(
        dict.fromkeys(name for item in inputs for name in ([item.rate] if item.kind == "phase" else _named([item])))
    )


def inputs_of(
    inputs: Sequence[InputInfo],
    columns: Mapping[str, np.ndarray],
    owner: np.ndarray,
    t: np.ndarray,
    inside: np.ndarray,
) -> np.ndarray:
    """`clock.inputs_at` for many times of many members.

    Parameters
    ----------
    columns : parameters and constants by name, shape (members,)
    owner : member of each time, shape (n,)
    t, inside : reference times, and times for which gates and slopes hold, shape (n,) [s]

    Returns
    -------
    array, shape (n, inputs)
    """
    found = np.empty((len(t), len(inputs)))
    for k, item in enumerate(inputs):
        if item.kind == "phase":
            found[:, k] = (columns[item.offset][owner] + columns[item.rate][owner] * t) % clock.TURN
        elif item.kind == "gate":
            found[:, k] = _covered(
                columns[item.offset][owner] + columns[item.rate][owner] * inside, item, columns, owner
            )
        else:
            found[:, k] = _from_table(item, columns, owner, t, inside)
    return found


def _covered(angle: np.ndarray, item: InputInfo, columns: Mapping[str, np.ndarray], owner: np.ndarray) -> np.ndarray:
    """1 where an angle lies in one of the windows, edges hit by rounding counted as exact; the rules of `clock`."""
    near = clock.ANGLE_RESOLUTION
    covered = np.zeros(len(angle), dtype=bool)
    for start, width in _windows(item, columns):
        past = (angle - start[owner]) % clock.TURN
        past = np.where(clock.TURN - past < near, 0.0, past)
        wide = width[owner]
        partly = (wide > 0.0) & (wide < clock.TURN)
        covered |= np.where(partly, past < wide - near, wide >= clock.TURN)
    return covered.astype(float)


def _from_table(
    item: InputInfo, columns: Mapping[str, np.ndarray], owner: np.ndarray, t: np.ndarray, inside: np.ndarray
) -> np.ndarray:
    """Value at `t`, or slope, of the piece of a table that holds at `inside`; the rules of `clock`."""
    times, heights = (np.column_stack([columns[name] for name in names]) for names in (item.times, item.values))
    k = np.sum(times[owner] <= inside[:, None], axis=1)
    flat = np.zeros((len(times), 1))
    # pieces before the first knot and behind the last are flat
    slope = np.hstack([flat, np.diff(heights, axis=1) / np.diff(times, axis=1), flat])[owner, k]
    if item.kind == "table_rate":
        return np.asarray(slope)
    left = np.clip(k - 1, 0, times.shape[1] - 1)
    within = (k > 0) & (k < times.shape[1])
    return np.asarray(np.where(within, heights[owner, left] + slope * (t - times[owner, left]), heights[owner, left]))
