"""Segments of a run: it is split where a load switches and at every whole turn.

In: a model, numbers, an interval of time.  Out: edges, and the inputs that hold between them.  Within a segment gates
and slopes are constant and the phases are taken anew at its start, so that angles stay small in the thousandth turn as
well.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain, pairwise

import numpy as np

from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.stepper import Segments
from ballpass.runtime.request.request import check_memory
from ballpass.runtime.time import timeline
from ballpass.runtime.time.breakpoints import breakpoints
from ballpass.runtime.time.turning import TURN, Turning

#: Largest angle that a phase may reach within a segment [rad]: sines of larger ones lose digits.
LARGEST_PHASE = 1e6

#: Inputs that grow within a segment: no load jumps where they go on.
TURNED = ("phase", "angle", "rate")

#: Turns whose edges are sought at a time: the search compares all with all.
TURNS_A_SEARCH = 64

#: Segments of one run of the driver (`driver/standalone/ballpass.c` has the same).
SEGMENTS_A_CALL = 600

#: Numbers that a segment takes besides its inputs while segments are made: ends, middles, jumps, samples.
WORK = 7


def time_resolution(begin: float, end: float, turn: float) -> float:
    """Times of a run closer than this are one time [s].  It does not depend on how the run is sampled."""
    return timeline.TIME_RESOLUTION * max(abs(begin), abs(end), turn if math.isfinite(turn) else 0.0)


def segment_edges(model: LoadedModel, numbers: Numbers, begin: float, end: float, turn: float) -> np.ndarray:
    """Begin, breakpoints, whole turns and end, increasing, none twice, shape (segments + 1,) [s].

    Raises
    ------
    RequestError
        They would not fit into memory, or the times of a table do not increase.
    """
    fastest = check_count(model.manifest, numbers, end - begin, turn)
    cuts = breakpoints(model.manifest, numbers.values, begin, end)
    if math.isfinite(turn):
        near = time_resolution(begin, end, turn)
        whole = turn * np.arange(math.floor(begin / turn) + 1, math.ceil(end / turn))
        whole = whole[(begin + near < whole) & (whole < end - near)]
        # a turn that meets a breakpoint is that breakpoint
        fenced = np.concatenate([[-math.inf], cuts, [math.inf]])
        right = np.searchsorted(fenced, whole)
        free = (fenced[right] - whole > near) & (whole - fenced[right - 1] > near)
        cuts = np.sort(np.concatenate([cuts, whole[free]]))
    return _short_of_rounding(fastest, np.concatenate([[begin], cuts, [end]]))


def edge_windows(
    model: LoadedModel, numbers: Numbers, end: float, turn: float, start: float, begin: float = 0.0
) -> Iterator[np.ndarray]:
    """Edges of a run, some turns at a time, increasing [s]: breakpoints, whole turns, `start`, and the ends.

    Memory does not grow with the run; each window begins with the last edge of the one before.

    Parameters
    ----------
    end, begin : of the run; the first window is the one that holds `begin`, and may begin before it [s]
    turn : time of a turn, infinite where nothing turns [s]
    start : time from which on the run counts, an edge where it lies within [s]
    """
    near = 1e-9 * min(turn, end)
    first = TURNS_A_SEARCH * math.floor((begin + near) / turn / TURNS_A_SEARCH) if math.isfinite(turn) else 0
    wholes = range(first + TURNS_A_SEARCH, math.ceil(end / turn), TURNS_A_SEARCH) if math.isfinite(turn) else ()
    stops = (k * turn for k in wholes if k * turn < end - near)
    origin = first * turn if math.isfinite(turn) else begin
    for left, right in pairwise(chain((origin,), stops, (end,))):
        if left + near < start < right - near:
            # not a window of its own: a window's first step size is estimated anew
            before, behind = (segment_edges(model, numbers, a, b, turn) for a, b in ((left, start), (start, right)))
            yield np.concatenate([before, behind[1:]])
        else:
            edges = segment_edges(model, numbers, left, right, turn)
            yield np.where(np.abs(edges - start) <= near, start, edges)


def run_windows(
    model: LoadedModel, numbers: Numbers, interval: tuple[float, float], turn: float, start: float
) -> Iterator[Segments]:
    """Segments of a run, so many at a time; else as `edge_windows`.  The exported program cuts runs alike.

    Parameters
    ----------
    interval : begin and end of the run [s]
    """
    begin, end = interval
    manifest = model.manifest
    before: Segments | None = None
    held: Segments | None = None
    for edges in edge_windows(model, numbers, end, turn, start, begin):
        before = segments = make_segments(manifest, numbers, edges, before)
        rest = segments if edges[0] >= begin else rest_of(segments, begin, manifest, numbers)
        if rest is None:
            continue
        held = rest if held is None else _joined([held, rest])
        while len(held.inputs) >= SEGMENTS_A_CALL:
            yield part_of(held, 0, SEGMENTS_A_CALL)
            held = part_of(held, SEGMENTS_A_CALL, len(held.inputs))
    if held is not None and len(held.inputs):
        yield held


def joined_segments(windows: Iterable[Segments], *, all_: bool = False) -> Iterator[Segments]:
    """Windows, joined with the next ones as long as a load jumps where these begin; or all of them."""
    held: list[Segments] = []
    for window in windows:
        if held and not (all_ or window.restarts[0]):
            yield _joined(held)
            held = []
        held.append(window)
    if held:
        yield _joined(held)


def _joined(parts: Sequence[Segments]) -> Segments:
    if len(parts) == 1:
        return parts[0]
    return Segments(
        times=np.concatenate([parts[0].times, *(part.times[1:] for part in parts[1:])]),
        inputs=np.concatenate([part.inputs for part in parts]),
        restarts=np.concatenate([part.restarts for part in parts]),
    )


def check_count(manifest: Manifest, numbers: Numbers, length: float, turn: float) -> float:
    """Refuse a time with more segments than fit into memory: by their largest possible number, before any is made.

    Returns the rate of the fastest phase [rad/s].

    Parameters
    ----------
    length, turn : of the time, and of a turn, infinite where nothing turns [s]

    Raises
    ------
    RequestError
        They would not fit.
    """
    rates = {info.name: Turning.of(info, numbers.values).fastest for info in manifest.turnings}
    fastest = float(max(rates.values(), default=0.0))
    count = 1.0 + length / turn + length * fastest / LARGEST_PHASE
    for item in manifest.inputs:
        passed = item.parts * (1.0 + length * rates.get(item.turning, 0.0) / TURN) / item.turns
        count += (2.0 * len(item.windows) + len(item.times)) * passed
    count += sum(len(info.times) + len(info.lag_times) for info in manifest.turnings)
    check_memory(
        f"Up to {count:.10g} segments, cut where a load switches and at every whole turn, of",
        count,
        len(manifest.inputs) + WORK,
        "Take a shorter run, or slower loads; `Model.reduce` makes the segments of a few turns at a time.",
    )
    return fastest


def _short_of_rounding(fastest: float, edges: np.ndarray) -> np.ndarray:
    """The edges, and more where a phase would get beyond `LARGEST_PHASE` between two: a fast load on a slow shaft."""
    parts = np.ceil(np.diff(edges) * fastest / LARGEST_PHASE)
    if not np.any(parts > 1.0) or not np.all(np.isfinite(parts)):
        return edges
    pieces = [
        np.linspace(a, b, int(n) + 1)[:-1]
        for a, b, n in zip(edges[:-1], edges[1:], np.maximum(parts, 1.0), strict=True)
    ]
    return np.concatenate([*pieces, edges[-1:]])


def make_segments(manifest: Manifest, numbers: Numbers, edges: np.ndarray, before: Segments | None = None) -> Segments:
    """Segments between edges, with the inputs that hold in them and where a load jumps.

    Parameters
    ----------
    edges : shape (segments + 1,), increasing [s]
    before : segments that end where these begin; None: the run begins there
    """
    u = timeline.inputs_over(manifest, numbers.values, edges[:-1], 0.5 * (edges[:-1] + edges[1:]))
    switching = [k for k, info in enumerate(manifest.inputs) if info.kind not in TURNED]
    jumps = np.ones(len(u), dtype=bool)
    jumps[1:] = np.any(np.diff(u[:, switching], axis=0) != 0.0, axis=1)
    if before is not None:
        jumps[0] = not np.array_equal(before.inputs[-1, switching], u[0, switching])
    return Segments(times=edges, inputs=u, restarts=jumps)


def part_of(segments: Segments, first: int, last: int) -> Segments:
    """Segments `first` ... `last`, the last one excluded."""
    return Segments(
        times=segments.times[first : last + 1],
        inputs=segments.inputs[first:last],
        restarts=segments.restarts[first:last],
    )


def rest_of(segments: Segments, time: float, manifest: Manifest, numbers: Numbers) -> Segments | None:
    """The rest of segments from a time within them, at which no load jumps.  None where nothing is left."""
    k = int(np.searchsorted(segments.times, time, side="right")) - 1
    if k >= len(segments.inputs):
        return None
    middle = 0.5 * (segments.times[k] + segments.times[k + 1])
    left = part_of(segments, k, len(segments.inputs))
    times, u, restarts = left.times.copy(), left.inputs.copy(), left.restarts.copy()
    times[0], restarts[0] = time, False
    u[0] = timeline.inputs_at(manifest, numbers.values, time, float(middle))
    return Segments(times=times, inputs=u, restarts=restarts)
