"""Values of the inputs at a time, and the times at which they change: phases, gates, tables.

In: the manifest's inputs and a look-up of values by name.  Out: numbers for ``u``, times of breakpoints.

Angles are reduced modulo a turn here, so that the generated code sees small arguments in the thousandth turn as well.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import CAGE_EXCESS_SLIP, DRIVER_ACCELERATION, BearingInfo, InputInfo, Manifest

TURN = 2.0 * math.pi

#: What the rate of a harmonic load is called, behind its path.
HARMONIC = ".angular_frequency"

#: Angles closer than this are one angle [rad]: an edge hit by rounding belongs to the window that starts there.
ANGLE_RESOLUTION = 1e-11

#: Turns whose breakpoints are listed at once; each edge of a window takes eight bytes a turn.
MOST_TURNS = 1e7

#: Times closer than this fraction of the interval under study are one time [1].
TIME_RESOLUTION = 1e-12

Values = Mapping[str, float]


def period(manifest: Manifest, values: Values) -> float:
    """Time of one turn of driver or shaft [s]; infinite when it stands or none exists.

    Where the driver's speed changes, at the initial one.
    """
    speed = shaft_speed(manifest, values)
    return TURN / abs(speed) if speed != 0.0 else math.inf


def shaft_speed(manifest: Manifest, values: Values) -> float:
    """Speed of the driver, else of the shaft, counter-clockwise [rad/s]; 0 when the model has neither."""
    name = speed_name(manifest)
    return 0.0 if name is None else values[name]


def speed_name(manifest: Manifest) -> str | None:
    """Parameter or constant that holds this speed; None when the model has neither."""
    if manifest.mechanism is not None:
        return manifest.mechanism.speed
    return None if manifest.bearing is None else manifest.bearing.ring_speed


def table_turns(values: Values, label: str) -> int:
    """Turns of the driver after which the table of a load repeats, named as ``force.gas``."""
    kind, _, name = label.partition(".")
    for number in range(1, len(values)):
        knot, part = f"mechanism.{kind}s.{name}.table.angle.{number}", f"{label}.part_angle_{number}"
        if knot not in values or part not in values:
            break
        if values[part] != 0.0:  # an angle in parts of what the table spans
            return round(values[knot] / values[part])
    return 1


def cycle_turns(values: Values) -> int:
    """Turns of the driver after which all loads repeat: two for a four-stroke engine."""
    labels = dict.fromkeys(name.rpartition(".")[0] for name in values if ".part_angle_" in name)
    return math.lcm(1, *(table_turns(values, label) for label in labels))


def whole_cycles(values: Values, turns: int) -> int:
    """At least so many turns: as many as all loads repeat after, or several times that."""
    cycle = cycle_turns(values)
    return cycle * math.ceil(turns / cycle)


def set_moving(manifest: Manifest, values: Values) -> dict[str, float]:
    """The first speed of a table that starts at rest, replaced by its fastest: which bearings turn then shows."""
    for item in manifest.inputs:
        if item.name == DRIVER_ACCELERATION and values[item.values[0]] == 0.0:
            return {item.values[0]: max((values[name] for name in item.values), key=abs)}
    return {}


def crank_angle(manifest: Manifest, values: Values, t: float, state: np.ndarray | None = None) -> float:
    """Angle of the driver (of the shaft: from its position at t = 0) in [0, 2 pi) [rad].

    Where its speed changes it is in the `state`, shape (states,); None is the one of `driver_at`.
    """
    if manifest.mechanism is not None and manifest.mechanism.angle:
        at = [info.name for info in manifest.states].index(manifest.mechanism.angle)
        return float(driver_at(manifest, values, t)[0] if state is None else state[at]) % TURN
    return float(crank_angles(manifest, values, np.array(t)))


def crank_angles(manifest: Manifest, values: Values, times: np.ndarray) -> np.ndarray:
    """The same at many times, of a driver or shaft whose speed does not change, in the shape of `times` [rad]."""
    start = values[manifest.mechanism.start_angle] if manifest.mechanism is not None else 0.0
    return np.asarray((start + shaft_speed(manifest, values) * times) % TURN)


def driver_at(manifest: Manifest, values: Values, t: float) -> tuple[float, float]:
    """Angle [rad] and speed [rad/s] of a driver whose speed changes: by its table at a time, else the initial ones."""
    assert manifest.mechanism is not None  # it has the driver
    angle, speed = values[manifest.mechanism.start_angle], values[manifest.mechanism.speed]
    for item in manifest.inputs:
        if item.name == DRIVER_ACCELERATION:
            times, speeds = _knots(item, values)
            edges = np.concatenate([[0.0], times[(times > 0.0) & (times < t)], [t]])
            rates = np.interp(edges, times, speeds)
            return angle + float(np.trapezoid(rates, edges)), float(rates[-1])
    return angle, speed


def turns_passed(manifest: Manifest, values: Values, begin: float, end: float) -> float:
    """Turns of driver or shaft between two times, in either direction: by its table of speeds, else at one speed."""
    for item in manifest.inputs:
        if item.name == DRIVER_ACCELERATION:
            times, speeds = _knots(item, values)
            edges = np.concatenate([[begin], times[(times > begin) & (times < end)], [end]])
            rates = np.interp(edges, times, speeds)
            one, other = np.abs(rates[:-1]), np.abs(rates[1:])
            size = np.maximum(one + other, 1e-300)
            means = 0.5 * np.where(rates[:-1] * rates[1:] < 0.0, (one**2 + other**2) / size, size)
            return float(means @ np.diff(edges)) / TURN
    return (end - begin) / period(manifest, values)


def lag_angle(manifest: Manifest, values: Values, bearing: BearingInfo, t: float) -> float:
    """Angle by which a cage lags whose lag is a state; of rings that turn with the driver, without swing [rad]."""
    assert manifest.mechanism is not None  # it has the driver
    lag = manifest.initial[[info.name for info in manifest.states].index(f"{bearing.prefix}cage.lag")]
    (item,) = (item for item in manifest.inputs if item.name == bearing.prefix + CAGE_EXCESS_SLIP)
    times, heights = _knots(item, values)
    edges = np.concatenate([times[:1], times[1:][times[1:] < t], [t]])
    if manifest.mechanism.angle:
        angles = np.array([driver_at(manifest, values, edge)[0] for edge in edges.tolist()])
    else:
        angles = values[manifest.mechanism.speed] * edges
    slips = np.append(np.diff(heights) / np.diff(times), 0.0)[: len(edges) - 1]
    return values[lag] + values[f"{bearing.path}.rolling_turns"] * float(slips @ np.diff(angles))


def held_states(manifest: Manifest, values: Values, t: float) -> np.ndarray:
    """States that no equilibrium decides, all else zero, shape (states,): the driver's by its table at a time, lags."""
    names = [info.name for info in manifest.states]
    found = np.zeros(len(names))
    mechanism = manifest.mechanism
    if mechanism is not None and mechanism.angle:
        found[[names.index(mechanism.angle), names.index(mechanism.rate)]] = driver_at(manifest, values, t)
    for bearing in manifest.bearings:
        if f"{bearing.prefix}cage.lag" in names:
            found[names.index(f"{bearing.prefix}cage.lag")] = lag_angle(manifest, values, bearing, t)
    return found


def turned_states(manifest: Manifest, values: Values, angles: np.ndarray) -> np.ndarray:
    """States with the driver at these angles past its start [rad], all else zero, shape (angles, states)."""
    assert manifest.mechanism is not None  # it has the driver
    found = np.zeros((len(angles), len(manifest.states)))
    at = [info.name for info in manifest.states].index(manifest.mechanism.angle)
    found[:, at] = values[manifest.mechanism.start_angle] + angles
    return found


def inputs_at(inputs: Sequence[InputInfo], values: Values, t: float, inside: float | None = None) -> np.ndarray:
    """Inputs ``u`` with reference time `t`.

    Parameters
    ----------
    inputs : the manifest's inputs
    values : parameters and derived constants by name
    t : reference time of phases and table values [s]
    inside : a time within the open interval for which gates and slopes hold [s].  Default: `t`, where an edge belongs
        to the interval that follows in angle (gates) and in time (tables).

    Returns
    -------
    array, shape (inputs,)
    """
    (found,) = inputs_over(inputs, values, np.array([t]), np.array([t if inside is None else inside]))
    return np.asarray(found)


def inputs_over(inputs: Sequence[InputInfo], values: Values, t: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """`inputs_at` for many reference times and times within the intervals they start, each of shape (n,) [s].

    Returns
    -------
    array, shape (n, inputs)
    """
    found = np.empty((len(t), len(inputs)))
    for k, item in enumerate(inputs):
        if item.kind == "phase":
            found[:, k] = (values[item.offset] + values[item.rate] * t) % TURN
        elif item.kind == "gate":
            angle = values[item.offset] + values[item.rate] * inside
            if item.times:
                angle = angle + _table(_lag_of(item), values, inside, inside)
            covered = np.zeros(len(t), dtype=bool)
            for start, width in _windows(item, values):
                covered |= _covers(angle, start, width)
            found[:, k] = covered
        elif item.kind == "border":
            found[:, k] = 0.0
        else:
            found[:, k] = _table(item, values, t, inside)
    return found


def harmonic_rates(manifest: Manifest) -> tuple[str, ...]:
    """Constants that hold the angular frequencies of harmonic loads [rad/s], behind the paths of these."""
    return tuple(dict.fromkeys(item.rate for item in manifest.inputs if item.rate.endswith(HARMONIC)))


def longest_harmonic(manifest: Manifest, values: Values) -> float:
    """Period of the slowest harmonic load [s]; zero without one."""
    return max((TURN / values[rate] for rate in harmonic_rates(manifest)), default=0.0)


def rows_over_time(manifest: Manifest, values: Values, begin: float, end: float) -> np.ndarray:
    """Times in (begin, end) of rows of tables over time: load or its window, driver's speed, cage's slip [s]."""
    tables = [item for item in manifest.inputs if item.kind in ("table", "table_rate") and not item.rate]
    return breakpoints(tables, values, begin, end)


def changes_over_time(manifest: Manifest, values: Values, begin: float, end: float) -> bool:
    """Whether a table over time has a row in (begin, end) [s]: turns there are unlike each other."""
    return len(rows_over_time(manifest, values, begin, end)) > 0


def breakpoints(inputs: Sequence[InputInfo], values: Values, t0: float, t1: float) -> np.ndarray:
    """Times in the open interval (t0, t1) at which a gate switches or a table has a knot.

    A window of zero width and one of a turn or more never switch.

    Returns
    -------
    array, shape (breakpoints,), increasing [s]

    Raises
    ------
    RequestError
        More than `MOST_TURNS` turns.
    """
    found: list[np.ndarray] = [np.zeros(0)]
    for item in inputs:
        if item.kind == "gate":
            found += [times for _, times in edge_times(item, values, t0, t1)]
        elif item.kind in ("table", "table_rate"):
            knots = _knots(item, values)[0]
            if not item.rate:
                found.append(knots)
            elif values[item.rate] != 0.0:
                found += [_passages(float(a), values[item.offset], values[item.rate], t0, t1) for a in knots]
    near = TIME_RESOLUTION * max(abs(t0), abs(t1))
    times = np.sort(np.concatenate(found))
    times = times[(t0 + near < times) & (times < t1 - near)]
    if np.all(np.diff(times) > near):
        return times
    apart: list[float] = []
    for time in times.tolist():
        if not apart or time - apart[-1] > near:
            apart.append(time)
    return np.array(apart)


def edge_times(gate: InputInfo, values: Values, t0: float, t1: float) -> Iterator[tuple[str, np.ndarray]]:
    """Parameters or constants that are edges of a gate's windows, and times in [t0, t1] at which it passes them [s]."""
    for offset, rate, begin, end in _turning(gate, values, t0, t1):
        for names, (start, width) in zip(gate.windows, _windows(gate, values), strict=True):
            if rate != 0.0 and 0.0 < width < TURN:
                for name, edge in zip(names, (start, start + width), strict=True):
                    yield name, _passages(edge, offset, rate, begin, end)


def _lag_of(gate: InputInfo) -> InputInfo:
    """The table over time that is added to the angle of a gate."""
    return replace(gate, kind="table", offset="", rate="", windows=())


def _turning(gate: InputInfo, values: Values, t0: float, t1: float) -> Iterator[tuple[float, float, float, float]]:
    """Of each piece of time in which a gate's angle grows evenly: its value at t = 0, its rate, begin and end."""
    offset, rate = values[gate.offset], values[gate.rate]
    if not gate.times:
        yield offset, rate, t0, t1
        return
    knots, heights = _knots(_lag_of(gate), values)
    slopes = np.concatenate([[0.0], np.diff(heights) / np.diff(knots), [0.0]])
    edges = np.concatenate([[-math.inf], knots, [math.inf]])
    for k, slope in enumerate(slopes.tolist()):
        begin, end = max(t0, float(edges[k])), min(t1, float(edges[k + 1]))
        if begin < end:
            left = max(k - 1, 0)
            yield offset + float(heights[left] - slope * knots[left]), rate + slope, begin, end


def input_derivatives(
    inputs: Sequence[InputInfo], values: Values, t: float, inside: float | None = None
) -> list[tuple[int, str, float]]:
    """Nonzero partial derivatives of `inputs_at`: (row of u, name of parameter or constant, derivative).

    A gate is flat between its edges; at an edge the derivative does not exist, and the flat one is given.
    """
    entries: list[tuple[int, str, float]] = []
    for row, item in enumerate(inputs):
        if item.kind == "phase":
            entries += [(row, item.offset, 1.0), (row, item.rate, t)]
        elif item.kind in ("table", "table_rate"):
            piece = table_piece(item, values, t, inside)
            left, right = piece.rows
            if left == right:
                if item.kind == "table":
                    entries.append((row, item.values[left], 1.0))
                continue
            span = piece.knots[1] - piece.knots[0]
            slope = (values[item.values[right]] - values[item.values[left]]) / span
            share = (piece.argument - piece.knots[0]) / span
            weights = (1.0 - share, share) if item.kind == "table" else (-1.0 / span, 1.0 / span)
            for weight, knot in zip(weights, piece.rows, strict=True):
                entries += [(row, item.values[knot], weight), (row, item.times[knot], -slope * weight)]
            if item.rate and item.kind == "table":
                entries += [(row, item.offset, slope), (row, item.rate, slope * t)]
    return entries


def breakpoint_derivatives(inputs: Sequence[InputInfo], values: Values, t: float) -> list[list[tuple[str, float]]]:
    """Derivatives of the time of the breakpoint at `t`: (name of parameter or constant, derivative [s/unit]).

    One list for each edge that lies there: of loads that switch, or else of tables that bend.
    """
    jumps: dict[tuple[tuple[str, float], ...], None] = {}
    bends: dict[tuple[tuple[str, float], ...], None] = {}
    for item in inputs:
        if item.kind == "gate" and values[item.rate] != 0.0:
            rate = values[item.rate]
            angle = values[item.offset] + rate * t
            moved: list[tuple[str, float]] = []
            if item.times:
                lag = _lag_of(item)
                angle += float(_table(lag, values, np.array([t]), np.array([t]))[0])
                rate += float(_table(replace(lag, kind="table_rate"), values, np.array([t]), np.array([t]))[0])
                moved = [(name, -slope / rate) for _, name, slope in input_derivatives([lag], values, t)]
            for names, (start, width) in zip(item.windows, _windows(item, values), strict=True):
                if not 0.0 < width < TURN:
                    continue
                for name, edge in zip(names, (start, start + width), strict=True):
                    if _passes(angle, edge):
                        jumps[((name, 1.0 / rate), (item.offset, -1.0 / rate), (item.rate, -t / rate), *moved)] = None
        elif item.kind == "table" and item.rate:
            rate = values[item.rate]
            for name, edge in zip(item.times, _knots(item, values)[0].tolist(), strict=True):
                if rate != 0.0 and _passes(values[item.offset] + rate * t, edge):
                    bends[((name, 1.0 / rate), (item.offset, -1.0 / rate), (item.rate, -t / rate))] = None
        elif item.kind in ("table", "table_rate") and not item.rate:
            times = _knots(item, values)[0]
            near = np.flatnonzero(np.abs(times - t) <= TIME_RESOLUTION * max(abs(t), float(np.max(np.abs(times)))))
            found = bends if item.kind == "table" else jumps
            for k in near:
                found[((item.times[int(k)], 1.0),)] = None
    return [list(edge) for edge in jumps or bends]


@dataclass(frozen=True, slots=True, kw_only=True)
class TablePiece:
    """Piece of a table: its two rows (twice one where the table is flat), their knots, and the argument between them.

    Knots and argument are times [s], or angles [rad] counted on beyond a turn, so that they increase.
    """

    rows: tuple[int, int]
    knots: tuple[float, float]
    argument: float


def table_piece(item: InputInfo, values: Values, t: float, inside: float | None = None) -> TablePiece:
    """Piece of a table that holds at a time, and the argument at `t`.

    Parameters
    ----------
    inside : a time at which the piece holds [s].  Default: `t`; the rounding of a time that lies on a knot decides then
        on which side it is
    """
    knots = _knots(item, values)[0]
    within = t if inside is None else inside
    argument, place = t, within
    if item.rate:
        (place,) = _within_turn(values[item.offset] + values[item.rate] * np.array([within]), knots[0])
        argument = place + values[item.rate] * (t - within)
        knots = np.append(knots, knots[0] + TURN)
    k = int(np.searchsorted(knots, place, side="right"))
    last = len(item.times) - 1
    if not item.rate and k in (0, len(knots)):
        row = 0 if k == 0 else last
        return TablePiece(rows=(row, row), knots=(float(knots[row]),) * 2, argument=float(argument))
    rows = (k - 1, k % len(item.times) if item.rate else k)
    return TablePiece(rows=rows, knots=(float(knots[k - 1]), float(knots[k])), argument=float(argument))


def _table(item: InputInfo, values: Values, t: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Value at `t`, or slope, of the piece of a table that holds at `inside`."""
    knots, heights = _knots(item, values)
    begin, at = inside, t
    if item.rate:
        begin = _within_turn(values[item.offset] + values[item.rate] * inside, knots[0])
        at = begin + values[item.rate] * (t - inside)
        knots, heights = np.append(knots, knots[0] + TURN), np.append(heights, heights[0])
    k = np.searchsorted(knots, begin, side="right")
    within = (k > 0) & (k < len(knots))
    # pieces before the first knot and after the last are flat; a table over the angle has none
    slopes = np.concatenate([[0.0], np.diff(heights) / np.diff(knots), [0.0]])[k]
    if item.kind == "table_rate":
        return np.asarray(slopes)
    left = np.clip(k - 1, 0, len(knots) - 1)
    return np.where(within, heights[left] + slopes * (at - knots[left]), heights[left])


def _within_turn(angle: np.ndarray, first: float) -> np.ndarray:
    """Angles brought into the turn from `first` on, edges hit by rounding counted as exact."""
    past = (angle - first) % TURN
    past[TURN - past < ANGLE_RESOLUTION] = 0.0
    return np.asarray(first + past)


def _passes(angle: float, edge: float) -> bool:
    """Whether an angle is that of an edge, but for the rounding of the time at which it is passed."""
    past = (angle - edge + math.pi) % TURN - math.pi
    return abs(past) < 1e3 * ANGLE_RESOLUTION * max(1.0, abs(angle))


def _windows(item: InputInfo, values: Values) -> list[tuple[float, float]]:
    """(start in [0, 2 pi), width) of each window [rad]; an end before the start lies in the next turn."""
    windows = []
    for first, last in item.windows:
        start, end = values[first], values[last]
        width = end - start
        if width < 0.0:
            width %= TURN
            if TURN - width < ANGLE_RESOLUTION:
                width = 0.0
        elif width > TURN - ANGLE_RESOLUTION:
            width = TURN
        windows.append((start % TURN, width))
    return windows


def _covers(angle: np.ndarray, start: float, width: float) -> np.ndarray:
    """Whether each angle lies in [start, start + width), with edges hit by rounding counted as exact."""
    if width <= 0.0 or width >= TURN:
        return np.full(len(angle), width >= TURN)
    past = (angle - start) % TURN
    past[TURN - past < ANGLE_RESOLUTION] = 0.0
    return np.asarray(past < width - ANGLE_RESOLUTION)


def _passages(edge: float, offset: float, rate: float, t0: float, t1: float) -> np.ndarray:
    """Times in [t0, t1] at which ``offset + rate t`` passes `edge` modulo a turn [s]."""
    turns = sorted(((offset + rate * t0 - edge) / TURN, (offset + rate * t1 - edge) / TURN))
    if not turns[1] - turns[0] <= MOST_TURNS:
        raise RequestError(
            f"Between {t0:g} s and {t1:g} s lie {turns[1] - turns[0]:.3g} turns, too many to list what switches in "
            f"them. Allowed: up to {MOST_TURNS:g}. Ask for a shorter time."
        )
    first, last = math.ceil(turns[0] - 1e-9), math.floor(turns[1] + 1e-9)
    return np.asarray((edge - offset + TURN * np.arange(first, last + 1)) / rate)


def _knots(item: InputInfo, values: Values) -> tuple[np.ndarray, np.ndarray]:
    knots = np.array([values[name] for name in item.times])
    heights = np.array([values[name] for name in item.values])
    steps = np.diff(knots)
    word, unit = ("angles", "rad") if item.rate else ("times", "s")
    if np.any(steps <= 0.0):
        k = int(np.argmax(steps <= 0.0))
        raise RequestError(
            f"The {word} of a table must increase: {item.times[k + 1]} = {knots[k + 1]:g} {unit} was given after "
            f"{item.times[k]} = {knots[k]:g} {unit}. Change one of the two."
        )
    if item.rate and not knots[-1] - knots[0] < TURN - ANGLE_RESOLUTION:
        raise RequestError(
            f"The angles of a table must lie within a turn: {item.times[-1]} = {knots[-1]:g} rad was given with "
            f"{item.times[0]} = {knots[0]:g} rad. Change one of the two."
        )
    return knots, heights
