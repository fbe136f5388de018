"""Times at which panels of a quantity end beside those of the steps: found along a run, with their derivatives.

In: signals along a run (contacts, corners, changes of the most loaded ball), and `Angles` along it (edges of windows
that the motion passes, jumps by a turn).  Out: times, and `moving_cuts` with their derivatives; for users,
`passing_times` of all edges of a run.

Where a ball comes into contact, its force starts like a power of time, under the tangent law with infinite slope.
Where a law damps one way only, or another ball becomes the most loaded one, the force has a corner.  At such a
moment the derivative of the force by a parameter jumps or is unbounded.  A quadrature that runs across it converges
slowly; one whose panels end there, and get finer towards it, converges fast.  The integrand does not jump there, so
that the panels need not move with the kink.  Where a load begins or ends, a ball enters a spall or leaves it, or an
angle comes back by a turn, it may: the derivative of an integral has the jump times that of the cut's time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.quantity.nodes import APART, Cause, Cuts, scheduled_cuts
from ballpass.runtime.quantity.panels import GAUSS, cut_at, nodes_of, whole_panels
from ballpass.runtime.quantity.track import WINDOWS, ChannelValues, FollowedRun, Track
from ballpass.runtime.request.request import Request, check_memory
from ballpass.runtime.request.resolve import Run, resolve
from ballpass.runtime.run.directions import Chain
from ballpass.runtime.run.loop import segments_of, steps_of
from ballpass.runtime.time import timeline
from ballpass.runtime.time.breakpoints import edge_times
from ballpass.runtime.time.turning import TURN

Array = NDArray[np.float64]

#: Halvings that locate a kink on the cubic through four nodes.
HALVINGS = 45

#: Cuts at edges of windows lie this part of a turn before them: well above rounding, so that states and rates are of
#: one side.
BEFORE = 1e-8

#: Angle of ball 1 as the rings see it, outer and inner, behind the bearing's prefix.
PLACES = ("cage.in_outer", "cage.in_inner")

#: Sines of angles that are zero but for rounding, and Newton's steps to where an angle passes.
ROUNDING, NEWTON = 1e-12, 3


def crossings(t: Array, segment: NDArray[np.int_], *signals: Array, counts: NDArray[np.bool_] | None = None) -> Array:
    """Times at which signals change sign within a segment, those of the first signal first, each increasing.

    Parameters
    ----------
    t : times that increase within each segment, four of each at least, shape (n,) [s]
    segment : shape (n,)
    signals : shape (n,) each
    counts : at which places each signal counts, shape (signals, n); None: at all
    """
    same = (np.diff(segment) == 0) & (np.diff(t) > 0.0)
    places = [np.flatnonzero(same & (signal[:-1] * signal[1:] < 0.0)) for signal in signals]
    if counts is not None:
        places = [place[here[place] | here[place + 1]] for place, here in zip(places, counts, strict=True)]
    found = np.concatenate([np.zeros(0, dtype=np.int_), *places])
    if not len(found):
        return np.zeros(0)
    # four nodes of the same segment around
    first, last = np.searchsorted(segment, segment[found]), np.searchsorted(segment, segment[found], side="right")
    begin = np.clip(np.minimum(np.maximum(found - 1, first), last - 4), 0, max(len(t) - 4, 0))
    rows = begin[:, None] + np.arange(4)
    low, high, nodes = t[found].copy(), t[found + 1].copy(), t[rows]
    of = np.repeat(np.arange(len(signals)), [len(place) for place in places])
    table = np.stack(signals)
    start, cubics = np.sign(table[of, found]), _cubics(nodes, table[of[:, None], rows])
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        height = cubics[:, 3]
        for k in (2, 1, 0):
            height = cubics[:, k] + (middle - nodes[:, k]) * height
        left = np.sign(height) == start
        low, high = np.where(left, middle, low), np.where(left, high, middle)
    return np.asarray(0.5 * (low + high))


def _cubics(nodes: Array, values: Array) -> Array:
    """Cubics through four nodes each (Newton's divided differences)."""
    found = values.copy()
    for k in range(1, 4):
        found[:, k:] = (found[:, k:] - found[:, k - 1 : -1]) / (nodes[:, k:] - nodes[:, :-k])
    return found


def rank_differences(segment: NDArray[np.int_], table: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Differences that pass zero where another ball becomes the most loaded one, and where one of both is that ball.

    Parameters
    ----------
    table : forces of the balls, shape (n, balls)

    Returns
    -------
    shape (n, pairs) each
    """
    best = np.argmax(table, axis=1)
    changes = np.flatnonzero((np.diff(best) != 0) & (np.diff(segment) == 0))
    pairs = sorted(
        {(min(pair), max(pair)) for pair in zip(best[changes].tolist(), best[changes + 1].tolist(), strict=True)}
    )
    one, other = np.array(pairs, dtype=np.int_).reshape(-1, 2).T
    return table[:, one] - table[:, other], (best[:, None] == one) | (best[:, None] == other)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Angles:
    """Angles that the motion decides, at whose zeros it is cut, along tracks.

    Attributes
    ----------
    channel : their values
    zero : what counts as zero [rad]
    which : columns of the channel, each angle once
    before : how far before zero they are cut, as a part of a turn [1]
    """

    channel: ChannelValues
    zero: float
    which: Sequence[int]
    before: float

    def past(self, track: Track, numbers: Numbers) -> tuple[Array, Array]:
        """Angles [rad] and their rates [rad/s], shape (nodes, angles) each; a rate does not jump at a window's edge."""
        value, rate = self.channel.with_rates(track, numbers)
        return value - self.zero, rate

    def slopes(self, track: Track, numbers: Numbers, chain: Chain) -> Array:
        """Derivatives of the angles, shape (nodes, angles, directions)."""
        (signal,) = self.channel.along(track, numbers, chain).values()
        return signal.slope


def window_angles(model: LoadedModel) -> Angles:
    """Angles beyond the edges of all windows."""
    edges = model.manifest.edges
    which = [edges.index(edge) for edge in dict.fromkeys(edges)]
    return Angles(channel=ChannelValues(model, [WINDOWS]), zero=0.0, which=which, before=BEFORE)


def jumps_at(channel: str) -> float | None:
    """Angle at which a channel jumps by a turn, where a body makes whole turns [rad]; None of all but angles."""
    if channel == "drive_angle":
        return 0.0
    in_half_turns = channel.endswith(PLACES)
    return np.pi if in_half_turns or (channel.startswith("body.") and channel.endswith(".angle")) else None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Passages:
    """Moments at which angles pass zero, in order.

    Attributes
    ----------
    times : shape (passages,) [s]
    forward : whether the angle grows then, shape (passages,)
    angle : which, shape (passages,)
    before : how long before these the run is cut [s]
    """

    times: Array
    forward: NDArray[np.bool_]
    angle: NDArray[np.int_]
    before: float


def find_passages(motion: FollowedRun, cuts: Cuts, track: Track, angles: Angles) -> Passages:
    """Passages of angles along a track, apart from cuts."""
    run = motion.run
    beyond, _ = angles.past(track, run.numbers)
    # what stands at half a turn is on either side of it by rounding
    across = np.where((np.cos(beyond) > 0.0) & (np.abs(np.sin(beyond)) > ROUNDING), np.sin(beyond), 0.0)
    each = [crossings(track.nodes.t, track.nodes.segment, across[:, k]) for k in angles.which]
    times, columns = np.concatenate([np.zeros(0), *each]), np.repeat(angles.which, [len(one) for one in each])
    rates = np.zeros(len(times))
    for _ in range(NEWTON if len(times) else 0):
        order = np.argsort(times, kind="stable")
        times, columns, rows = times[order], columns[order], np.arange(len(times))
        past, every = angles.past(motion.along(motion.nodes_at(times)), run.numbers)
        rates = every[rows, columns]
        times = times - np.angle(np.exp(1j * past[rows, columns])) / rates
    # of the fastest turn: one at the first speed of a run-up from rest has no end
    fastest = float(np.max(np.abs(rates), initial=0.0)) / TURN
    before = angles.before / max(1.0 / min(run.stretch, run.duration), fastest)
    distance = np.min(np.abs(cuts.times[:, None] - times), axis=0)
    apart = distance > max(APART * run.duration, 10.0 * before)
    return Passages(times=times[apart], forward=rates[apart] > 0.0, angle=columns[apart], before=before)


def moving_cuts(
    motion: FollowedRun, cuts: Cuts, angles: Mapping[Cause, Angles], chain: Chain, sensitivity_rtol: float
) -> tuple[Cuts, NDArray[np.bool_]]:
    """Cuts with their derivatives along directions, and directions in which the jump of an angle leaves its cut.

    At a cut that is known before the run an angle may jump as well, and moves in another way.  An angle that follows
    from time alone knows nothing of such cuts but the run's ends, and the cut moves with the jump.

    Parameters
    ----------
    angles : those that pass at the cuts of each cause

    Returns
    -------
    cuts, and whether a jump leaves one, shape (directions,)

    Raises
    ------
    RequestError
        Several loads switch at one time, and a parameter moves one of them away from another.
    """
    run, slopes = motion.run, scheduled_slopes(motion.run, cuts, chain)
    leaves, last = np.zeros(len(chain.names), dtype=bool), len(cuts.times) - 1
    for cause, angle in angles.items():
        at = np.flatnonzero((cuts.cause == cause) | ((cuts.cause == Cause.SCHEDULE) & (cause == Cause.JUMP)))
        if not len(at):
            continue
        seen = motion.along(motion.nodes_at(cuts.times[at], len(chain.names)), chain, sensitivity_rtol)
        rows, column = np.arange(len(at)), cuts.angle[at]
        past, rate = (table[rows, column] for table in angle.past(seen, run.numbers))
        jumps = np.abs(np.exp(1j * past) - 1.0) <= APART * run.duration * np.abs(rate)
        passes = (cuts.cause[at] == cause) | (jumps & (at >= cuts.first))
        at, rows, column = at[passes], rows[passes], column[passes]
        own = -angle.slopes(seen, run.numbers, chain)[rows, column] / rate[rows, None]
        free = (cuts.cause[at] == cause) | (motion.still & (cuts.first < at) & (at < last))
        leaves |= np.any(~free[:, None] & ~np.isclose(own, slopes[at], rtol=1e-6, atol=0.0), axis=0)
        slopes[at] = np.where(free[:, None], own, slopes[at])
    return replace(cuts, slopes=slopes), leaves


def scheduled_slopes(run: Run, cuts: Cuts, chain: Chain) -> Array:
    """Derivatives of the cuts that are known before the run along the directions, shape (cuts, directions) [s/unit].

    Raises
    ------
    RequestError
        Several loads switch at one time, and a parameter moves one of them away from another.
    """
    near = APART * min(run.stretch, run.duration)
    even = timeline.is_even(run.model.manifest, run.numbers.values) and math.isfinite(run.stretch)
    slopes = np.zeros((len(cuts.times), len(chain.names)))
    for k in np.flatnonzero(cuts.cause == Cause.SCHEDULE)[1:-1]:
        time = float(cuts.times[k])
        moved, counts = chain.breakpoint(time), abs(time - run.start) <= near
        if moved is not None and not counts:
            slopes[k] = moved
        elif counts or even:
            slopes[k] = chain.after(time)
    if run.span.asked is not None:
        slopes[-1] = chain.after(run.end, run.begin)
    return slopes


def passing_times(model: LoadedModel, numbers: Numbers, request: Request) -> dict[str, Array]:
    """Times at which a run passes edges of windows, by the edge, each increasing [s].

    Those of loads and spalls, whether known before the run or decided by the motion; after the transient.

    Raises
    ------
    RequestError
        A wrong request, or a run too long to keep its steps in memory.
    SimulationError
        The computation failed.
    """
    run = resolve(model, numbers, request).check_steady()
    parts: dict[str, list[Array]] = {edge: [] for edge in model.manifest.edges}
    for item in model.manifest.inputs:
        if item.kind == "gate":
            for edge, times in edge_times(model.manifest, item, numbers.values, run.start, run.end):
                parts.setdefault(edge, []).append(times[(times >= run.start) & (times < run.end)])
    if model.manifest.edges:
        passed = _passages_of(run)
        for edge in dict.fromkeys(model.manifest.edges):
            parts[edge].append(passed.times[passed.angle == model.manifest.edges.index(edge)])
    return {edge: np.unique(np.concatenate(times)) for edge, times in parts.items()}


def entering_times(run: Run) -> dict[str, Array]:
    """Times at which a ball enters a spall, by what edges of the spall begin with [s].

    Of spalls whose edges are met when the motion decides.  A ball enters by either edge, as the rings turn.
    """
    passed = _passages_of(run)
    names = [run.model.manifest.edges[k] for k in passed.angle]
    spalls = dict.fromkeys(edge.rpartition(".")[0] for edge in run.model.manifest.edges if "defects." in edge)
    ways = ((".begin", True), (".end", False))
    return {
        spall: np.array(
            [
                time
                for time, edge, forward in zip(passed.times.tolist(), names, passed.forward.tolist(), strict=True)
                if (edge.removeprefix(spall), forward) in ways
            ]
        )
        for spall in spalls
    }


def _passages_of(run: Run) -> Passages:
    """Passages of all edges that the motion decides, of a run that is made for them."""
    kept, run = steps_of(run), replace(run, progress=None)
    ends, count = kept[:, 0], 16 * len(run.model.states)
    check_memory("Edges along a run of", len(GAUSS) * len(ends), count, "Run fewer cycles.")
    motion = FollowedRun(run=run, segments=segments_of(run), kept=kept, still=False)
    cuts = scheduled_cuts(run, motion.segments)
    panels = cut_at(whole_panels(cuts), cuts, ends, np.zeros(len(ends), dtype=bool))
    return find_passages(motion, cuts, motion.along(nodes_of(panels, cuts)), window_angles(run.model))
