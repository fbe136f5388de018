"""Values of the inputs at a time, and the times at which they change: what turns, windows, tables.

In: a manifest and values by name.  Out: numbers for ``u``, times of breakpoints, their derivatives along directions.

Angles are reduced modulo a turn here, so that the generated code sees small arguments in the thousandth turn as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import InputInfo, Manifest, TurningInfo
from ballpass.runtime.time.turning import ANGLE_RESOLUTION, STEP, TURN, Turning, Values, knots, past

#: Times closer than this fraction of the interval under study are one time [1].
TIME_RESOLUTION = 1e-12

#: Rows at later times are not met: the end of a load that has none [s].
NEVER = 1e8


def speed_name(manifest: Manifest) -> str | None:
    """Parameter or constant that holds the speed of driver or shaft; None when the model has neither."""
    if manifest.mechanism is not None:
        return manifest.mechanism.speed
    return None if manifest.bearing is None else manifest.bearing.ring_speed


def shaft_speed(manifest: Manifest, values: Values) -> float:
    """Speed of the driver, else of the shaft, counter-clockwise [rad/s]; 0 when the model has neither.

    Where it changes, the first one.
    """
    name = speed_name(manifest)
    return 0.0 if name is None else float(values[name])


def period(manifest: Manifest, values: Values) -> float:
    """Time of one turn of driver or shaft [s], behind the last row of a table of its speed; infinite when it stands or
    none exists."""
    return driver(manifest, values).turn


def stretch(manifest: Manifest, values: Values) -> float:
    """Time after which a run is cut, so that angles stay small: a turn at the first speed, infinite without one [s]."""
    speed = shaft_speed(manifest, values)
    return TURN / abs(speed) if speed != 0.0 else math.inf


def driver_info(manifest: Manifest) -> TurningInfo | None:
    """The turning of driver or shaft, of its first speed where a torque drives; None without either."""
    known = next((info for info in manifest.turnings if info.kind == "driver"), None)
    rate = speed_name(manifest)
    if known is not None or rate is None:
        return known
    start = "" if manifest.mechanism is None else manifest.mechanism.start_angle
    return TurningInfo(name="driver", kind="driver", words="", offset=start, rate=rate, speeds=(rate,))


def driver(manifest: Manifest, values: Values) -> Turning:
    """The angle of driver or shaft over time; where a torque drives, of its first speed."""
    info = driver_info(manifest)
    return Turning.even(0.0, 0.0) if info is None else Turning.of(info, values)


def fastest(info: TurningInfo, values: Values) -> float:
    """Largest rate of a turning, in either sense [rad/s]."""
    even = not info.turns and not info.times
    return abs(values[info.rate]) if even else Turning.of(info, values).fastest


def mean_rates(manifest: Manifest, values: Values, begin: float, end: float) -> dict[str, float]:
    """Mean speeds over a span, by the parameters and constants that hold the first ones [rad/s]."""
    return _rates(manifest, values, lambda turning: turning.mean_rate(begin, end))


def settled_rates(manifest: Manifest, values: Values) -> dict[str, float]:
    """Speeds behind the last row, in the same way."""
    return _rates(manifest, values, lambda turning: float(turning.rate[-1]))


def highest_rates(manifest: Manifest, values: Values) -> dict[str, float]:
    """Speeds at the moment at which the driver is fastest, in the same way."""
    info = driver_info(manifest)
    if info is None or not info.times:
        return {}
    fastest = float(values[max(zip(info.times, info.speeds, strict=True), key=lambda row: abs(values[row[1]]))[0]])
    return _rates(manifest, values, lambda turning: float(turning.at(fastest)[1]))


def _rates(manifest: Manifest, values: Values, rate: Callable[[Turning], float]) -> dict[str, float]:
    found = {}
    for info in manifest.turnings:
        uneven = info.times != () or info.turns != ""
        if info.kind != "load" and uneven:
            found[info.rate] = rate(Turning.of(info, values))
    for bearing in manifest.bearings:  # of one ring against the other
        passes = [f"{bearing.path}.{name}_speed" for name in ("outer_pass", "cage", "inner_pass")]
        if passes[-1] in found and bearing.ring_speed not in found:
            outer, inner = found.get(passes[0], found.get(passes[1], 0.0)), found[passes[-1]]
            found[bearing.ring_speed] = outer - inner
    return found


def is_free(manifest: Manifest) -> bool:
    """Whether a torque drives, so that the driver's angle is a state."""
    return manifest.mechanism is not None and manifest.mechanism.angle != ""


def one_speed(manifest: Manifest, values: Values) -> bool:
    """Whether no table gives the driver other speeds than the first."""
    info = driver_info(manifest)
    return info is None or len({values[name] for name in info.speeds}) <= 1


def turns_evenly(manifest: Manifest, values: Values, begin: float) -> bool:
    """Whether no table changes the driver's speed behind a time [s]."""
    info = driver_info(manifest)
    rows = [] if info is None else _changing(info.times, info.speeds, values)
    return all(last <= begin * (1.0 + TIME_RESOLUTION) for _, last in rows)


def is_even(manifest: Manifest, values: Values) -> bool:
    """Whether the driver's speed is constant: no torque drives, and no table has rows of unlike speeds."""
    return not is_free(manifest) and one_speed(manifest, values)


def cycle_turns(manifest: Manifest, values: Values) -> int:
    """Turns of driver or shaft after which all loads over its angle repeat: two for a four-stroke engine."""
    if is_free(manifest):  # its tables are no inputs
        return math.lcm(1, *(turns for _, turns in manifest.mechanism.turns)) if manifest.mechanism else 1
    tables = (item for item in manifest.inputs if item.kind == "table" and item.turns > 1)
    return math.lcm(1, *(repeats_after(item, values) for item in tables))


def repeats_after(item: InputInfo, values: Values) -> int:
    """Turns after which a table over an angle repeats: fewer than it has where its parts are alike."""
    angles, heights = _knots(item, values)
    least, whole = 1e-12 * float(np.max(np.abs(heights))), item.turns * TURN
    for turns in range(1, item.turns):
        moved = np.concatenate([angles, angles + turns * TURN])
        apart = np.subtract(*(np.interp(moved + by * TURN, angles, heights, period=whole) for by in (0, turns)))
        if item.turns % turns == 0 and np.max(np.abs(apart)) <= least:
            return turns
    return item.turns


def whole_cycles(manifest: Manifest, values: Values, turns: int) -> int:
    """At least so many turns: as many as all loads repeat after, or several times that."""
    cycle = cycle_turns(manifest, values)
    return cycle * math.ceil(turns / cycle)


def set_moving(manifest: Manifest, values: Values) -> dict[str, float]:
    """The first speed of a table that starts at rest, replaced by its fastest: which bearings turn then shows."""
    info = driver_info(manifest)
    if info is not None and info.times and values[info.rate] == 0.0:
        return {info.rate: max((values[name] for name in info.speeds), key=abs)}
    return {}


def crank_angle(manifest: Manifest, values: Values, t: float, state: np.ndarray | None = None) -> float:
    """Angle of the driver (of the shaft: from its position at t = 0) in [0, 2 pi) [rad].

    Where a torque drives, it is in the `state`, shape (states,).
    """
    if state is not None and manifest.mechanism is not None and manifest.mechanism.angle:
        at = [info.name for info in manifest.states].index(manifest.mechanism.angle)
        return float(state[at]) % TURN
    return float(driver(manifest, values).at(t)[0]) % TURN


def crank_angles(manifest: Manifest, values: Values, times: np.ndarray) -> np.ndarray:
    """The same at many times, of a driver whose angle is known, in the shape of `times` [rad]."""
    return np.asarray(driver(manifest, values).at(times)[0] % TURN)


def held_states(manifest: Manifest, values: Values, t: float) -> np.ndarray:
    """States that no equilibrium decides, all else zero, shape (states,): those of a free driver at its start, lags."""
    names = [info.name for info in manifest.states]
    found = np.zeros(len(names))
    mechanism = manifest.mechanism
    if mechanism is not None and mechanism.angle:
        found[names.index(mechanism.angle)] = values[mechanism.start_angle]
        found[names.index(mechanism.rate)] = values[mechanism.speed]
    for bearing in manifest.bearings:
        if f"{bearing.prefix}cage.lag" in names:
            row = names.index(f"{bearing.prefix}cage.lag")
            found[row] = values[manifest.initial[row]] + _swinging_lag(
                manifest, values, bearing.prefix, bearing.path, t
            )
    return found


def _swinging_lag(manifest: Manifest, values: Values, prefix: str, path: str, t: float) -> float:
    """What a cage lags more than at the start, of rings that turn with the driver, without swing [rad]."""
    (item,) = (item for item in manifest.inputs if item.name == f"{prefix}cage.excess_slip")
    times = knots(item.times, values)
    edges = np.concatenate([times[:1], times[1:][times[1:] < t], [max(t, float(times[0]))]])
    slips = _table(item, values, edges[:-1], 0.5 * (edges[:-1] + edges[1:]))
    turned = np.diff(driver(manifest, values).at(edges)[0])
    return float(values[f"{path}.rolling_turns"] * (slips @ turned))


def turned(manifest: Manifest, values: Values, angles: np.ndarray) -> dict[str, np.ndarray]:
    """States or inputs with the driver at angles past its start [rad], all else as at t = 0, by their argument."""
    assert manifest.mechanism is not None  # it has the driver
    inputs = np.repeat(inputs_at(manifest, values, 0.0)[None], len(angles), axis=0)
    found = {"u": inputs}
    if is_free(manifest):
        found["x"] = np.zeros((len(angles), len(manifest.states)))
        at = [info.name for info in manifest.states].index(manifest.mechanism.angle)
        found["x"][:, at] = values[manifest.mechanism.start_angle] + angles
    for k, item in enumerate(manifest.inputs):
        if item.kind == "phase" and info_of(manifest, item).kind == "driver":
            inputs[:, k] = (values[manifest.mechanism.start_angle] + angles) % TURN
    return found


def start_angle(manifest: Manifest, values: Values) -> float:
    """Angle of the driver, else of the shaft, at t = 0 [rad]."""
    return 0.0 if manifest.mechanism is None else float(values[manifest.mechanism.start_angle])


def inputs_at(manifest: Manifest, values: Values, t: float, inside: float | None = None) -> np.ndarray:
    """Inputs ``u`` with reference time `t`, shape (inputs,).

    Parameters
    ----------
    values : parameters and derived constants by name
    t : reference time of phases and table values [s]
    inside : a time within the open interval for which gates and slopes hold [s].  Default: `t`, where an edge belongs
        to the interval that follows in angle (gates) and in time (tables)
    """
    (found,) = inputs_over(manifest, values, np.array([t]), np.array([t if inside is None else inside]))
    return np.asarray(found)


def inputs_over(
    manifest: Manifest,
    values: Values,
    t: np.ndarray,
    inside: np.ndarray,
    among: Sequence[InputInfo] | None = None,
) -> np.ndarray:
    """`inputs_at` for many reference times and times within the intervals they start, each of shape (n,) [s].

    Parameters
    ----------
    among : inputs of the manifest.  Default: all

    Returns
    -------
    array, shape (n, inputs); complex where values are
    """
    inputs = manifest.inputs if among is None else among
    named = {item.turning for item in inputs}
    turning = {info.name: Turning.of(info, values) for info in manifest.turnings if info.name in named}
    columns = [_input(item, values, turning, t, inside) for item in inputs]
    return np.stack(columns, axis=1) if columns else np.zeros((len(t), 0))


def _input(
    item: InputInfo, values: Values, turning: Mapping[str, Turning], t: np.ndarray, inside: np.ndarray
) -> np.ndarray:
    if item.kind == "border":
        return np.zeros(len(t))
    if item.kind == "gate":
        angle = turning[item.turning].times(item.parts).at(inside)[0].real
        within = [_covers(angle, start, width) for start, width in _windows(item, values)]
        return np.asarray(np.any(within, axis=0), dtype=float)
    if item.kind in ("table", "table_rate"):
        return _table(item, values, t, inside, turning.get(item.turning))
    angle, rate, slope = turning[item.turning].held(t, inside)
    if item.kind == "phase":
        reduced = np.mod(angle.real, TURN)
        return np.asarray(reduced + 1j * angle.imag if np.iscomplexobj(angle) else reduced)
    return np.asarray({"angle": angle, "rate": rate, "slope": slope}[item.kind])


def input_slopes(
    manifest: Manifest, values: Values, moved: Mapping[str, float], t: np.ndarray, inside: np.ndarray
) -> np.ndarray:
    """Derivative of the inputs at fixed times along a direction of the values, shape (n, inputs); gates are flat.

    Parameters
    ----------
    moved : the direction, by name; names that are missing stand still
    t, inside : as for `inputs_over`
    """
    return np.asarray(np.imag(inputs_over(manifest, along(values, moved), t, inside)) / STEP)


def angle_slope(info: TurningInfo, values: Values, moved: Mapping[str, float], t: float) -> float:
    """Derivative of a turning's angle at a fixed time along a direction of the values [rad/unit]."""
    own = {name: complex(values[name], STEP * moved.get(name, 0.0)) for name in names_of(info)}
    return float(np.imag(Turning.of(info, own).at(t)[0]) / STEP)


def names_of(info: TurningInfo) -> tuple[str, ...]:
    """Parameters and constants that a turning depends on."""
    one = (info.offset, info.rate, info.turns, info.rolling, info.lag)
    named = (*one, *info.times, *info.speeds, *info.lag_times, *info.lags)
    return tuple(dict.fromkeys(name for name in named if name))


def along(values: Values, moved: Mapping[str, float]) -> dict[str, Any]:
    """Values moved along a direction, as `Turning` differentiates by."""
    return {**values, **{name: complex(values[name], STEP * slope) for name, slope in moved.items() if slope != 0.0}}


def names_of_inputs(manifest: Manifest) -> tuple[str, ...]:
    """Parameters and constants that inputs depend on."""
    found = [name for info in manifest.turnings for name in names_of(info)]
    return tuple(dict.fromkeys([*found, *(n for item in manifest.inputs for n in names_of_input(manifest, item))]))


def names_of_input(manifest: Manifest, item: InputInfo) -> tuple[str, ...]:
    """Parameters and constants that an input depends on."""
    turning = names_of(info_of(manifest, item)) if item.turning else ()
    edges = (edge for window in item.windows for edge in window)
    return tuple(dict.fromkeys([*turning, *edges, *item.times, *item.values]))


def loads(manifest: Manifest) -> dict[str, list[TurningInfo]]:
    """Turnings of loads with a rate of their own, by that rate."""
    found: dict[str, list[TurningInfo]] = {}
    for info in manifest.turnings:
        if info.kind == "load":
            found.setdefault(info.rate, []).append(info)
    return found


def longest_harmonic(manifest: Manifest, values: Values) -> float:
    """Period of the slowest harmonic load [s]; zero without one."""
    return max((TURN / float(values[rate]) for rate in loads(manifest)), default=0.0)


def rows_over_time(manifest: Manifest, values: Values, begin: float, end: float) -> np.ndarray:
    """Times in (begin, end) of rows of tables over time: load or its window, driver's speed, cage's slip [s]."""
    return _apart([np.zeros(0), *_rows(manifest, values)], begin, end)


def changes_over_time(manifest: Manifest, values: Values, begin: float, end: float) -> bool:
    """Whether a table over time changes a value in (begin, end) [s]: turns there are unlike each other."""
    near = TIME_RESOLUTION * max(abs(begin), abs(end))
    return any(first < end - near and last > begin + near for first, last in _changes(manifest, values))


def settled_after(manifest: Manifest, values: Values) -> float:
    """Time of the last row that changes a value; rows of equal value are no rows [s].  Minus infinity without one."""
    return max((last for _, last in _changes(manifest, values)), default=-math.inf)


def alike_from(manifest: Manifest, values: Values) -> float:
    """Time from which on turns are alike, driver or shaft at its first angle [s]; 0 where no row changes a value."""
    settled = settled_after(manifest, values)
    if not settled > 0.0:
        return 0.0
    turning = driver(manifest, values)
    found = turning.first_pass(float(turning.at(0.0)[0]), cycle_turns(manifest, values), settled)
    return settled if found is None else found


def alike_from_slope(manifest: Manifest, values: Values, moved: Mapping[str, float]) -> float:
    """Its derivative along a direction of the values [s/unit]."""
    info, begin = driver_info(manifest), alike_from(manifest, values)
    if info is None or begin == 0.0:
        return 0.0
    start = moved.get(info.offset, 0.0) if info.offset else 0.0
    return (start - angle_slope(info, values, moved, begin)) / float(Turning.of(info, values).at(begin)[1])


def _changes(manifest: Manifest, values: Values) -> Iterator[tuple[float, float]]:
    """Spans of time in which tables over time change a value; one that jumps does so at once [s]."""
    valued = {item.times for item in manifest.inputs if item.kind == "table"}
    tables = [(info.times, info.speeds, False) for info in manifest.turnings if info.times]
    tables += [
        (item.times, item.values, item.kind == "table_rate")
        for item in manifest.inputs
        if item.kind in ("table", "table_rate")
        and not item.turning
        and (item.kind == "table" or item.times not in valued)
    ]
    for names, heights, steps in tables:
        times, at = knots(names, values), np.array([values[name] for name in heights])
        if steps:  # what acts is the slope
            slopes = np.concatenate([np.zeros(1), np.diff(at) / np.diff(times), np.zeros(1)])
            jumps = times[(np.diff(slopes) != 0.0) & (times < NEVER)]
            yield from zip(jumps.tolist(), jumps.tolist(), strict=True)
        else:
            yield from _changing(names, heights, values)


def _changing(names: tuple[str, ...], heights: tuple[str, ...], values: Values) -> list[tuple[float, float]]:
    """Spans of time between rows of unlike values [s]."""
    times, at = knots(names, values), np.array([values[name] for name in heights])
    behind = np.flatnonzero(np.diff(at) != 0.0) if len(times) else np.zeros(0, dtype=int)
    return list(zip(times[behind].tolist(), times[behind + 1].tolist(), strict=True))


def _rows(manifest: Manifest, values: Values) -> Iterator[np.ndarray]:
    for info in manifest.turnings:
        yield from (knots(names, values) for names in (info.times, info.lag_times) if names)
    for item in manifest.inputs:
        if item.kind in ("table", "table_rate") and not item.turning:
            yield knots(item.times, values)


def breakpoints(
    manifest: Manifest, values: Values, t0: float, t1: float, among: Iterable[InputInfo] | None = None
) -> np.ndarray:
    """Times in the open interval (t0, t1) at which a gate switches or a table has a knot.

    A window of zero width and one of a turn or more never switch.

    Parameters
    ----------
    among : inputs of the manifest.  Default: all

    Returns
    -------
    array, shape (breakpoints,), increasing [s]

    Raises
    ------
    RequestError
        More than `turning.MOST_TURNS` turns.
    """
    found = [np.zeros(0), *_rows(manifest, values)]
    for item in manifest.inputs if among is None else among:
        if item.kind == "gate":
            found += [times for _, times in edge_times(manifest, item, values, t0, t1)]
        elif item.kind in ("table", "table_rate") and item.turning:
            turning = Turning.of(info_of(manifest, item), values)
            found += [turning.passes(float(a), t0, t1, item.turns) for a in _knots(item, values)[0]]
    return _apart(found, t0, t1)


def _apart(found: Sequence[np.ndarray], t0: float, t1: float) -> np.ndarray:
    """Sorted times between two, those that are one time once."""
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


def edge_times(
    manifest: Manifest, gate: InputInfo, values: Values, t0: float, t1: float
) -> Iterator[tuple[str, np.ndarray]]:
    """Parameters or constants that are edges of a gate's windows, and times in [t0, t1] at which it passes them [s]."""
    turning = Turning.of(info_of(manifest, gate), values).times(gate.parts)
    for names, (start, width) in zip(gate.windows, _windows(gate, values), strict=True):
        if 0.0 < width < TURN:
            for name, edge in zip(names, (start, start + width), strict=True):
                yield name, turning.passes(edge, t0, t1)


def breakpoint_slopes(
    manifest: Manifest, values: Values, moved: Sequence[Mapping[str, float]], t: float
) -> tuple[list[str], np.ndarray]:
    """Derivatives of the time of the breakpoint at `t` along directions of the values.

    Parameters
    ----------
    moved : the directions, as for `input_slopes`

    Returns
    -------
    what lies there, of loads that switch or else of tables that bend, by name; shape (edges, directions) [s/unit]
    """
    jumps: dict[tuple[str, str, int], None] = {}
    bends: dict[tuple[str, str, int], None] = {}
    for item in manifest.inputs:
        if item.kind == "gate" or (item.kind == "table" and item.turning):
            angle, rate = Turning.of(info_of(manifest, item), values).times(item.parts).at(t)
            if rate == 0.0:
                continue
            found = jumps if item.kind == "gate" else bends
            for name, edge in _edges(item, values):
                if _passes(float(angle), edge, item.turns):
                    found[(name, item.turning, item.parts)] = None
        elif item.kind in ("table", "table_rate"):
            found = bends if item.kind == "table" else jumps
            found.update(dict.fromkeys((name, "", 1) for name in _rows_near(item.times, values, t)))
    for info in manifest.turnings:
        for names in (info.times, info.lag_times):
            jumps.update(dict.fromkeys((name, "", 1) for name in _rows_near(names, values, t)))
    keys = [*(jumps or bends)]
    slopes = np.zeros((len(keys), len(moved)))
    infos = {info.name: info for info in manifest.turnings}
    for row, (name, turning, parts) in enumerate(keys):
        slopes[row] = [direction.get(name, 0.0) for direction in moved]
        if turning:
            turned = np.array([angle_slope(infos[turning], values, direction, t) for direction in moved])
            slopes[row] = (slopes[row] / parts - turned) / Turning.of(infos[turning], values).at(t)[1]
    return [name for name, _, _ in keys], slopes


def _rows_near(names: Sequence[str], values: Values, t: float) -> list[str]:
    times = np.array([values[name] for name in names])
    return [
        name
        for name, time in zip(names, times, strict=True)
        if abs(time - t) <= TIME_RESOLUTION * max(abs(t), 1e-300, float(np.max(np.abs(times))))
    ]


def _edges(item: InputInfo, values: Values) -> Iterator[tuple[str, float]]:
    """Angles at which an input changes, by name: edges of windows that switch, knots of a table."""
    if item.kind == "table":
        yield from zip(item.times, _knots(item, values)[0].tolist(), strict=True)
    else:
        for names, (start, width) in zip(item.windows, _windows(item, values), strict=True):
            if 0.0 < width < TURN:
                yield from zip(names, (start, start + width), strict=True)


def info_of(manifest: Manifest, item: InputInfo) -> TurningInfo:
    return next(info for info in manifest.turnings if info.name == item.turning)


@dataclass(frozen=True, slots=True, kw_only=True)
class TablePiece:
    """Piece of a table: its two rows (twice one where the table is flat), their knots, and the argument between them.

    Knots and argument are times [s], or angles [rad] counted on beyond a turn, so that they increase.
    """

    rows: tuple[int, int]
    knots: tuple[float, float]
    argument: float


def table_piece(manifest: Manifest, item: InputInfo, values: Values, t: float) -> TablePiece:
    """Piece of a table that holds at a time, and the argument there.

    The rounding of a time that lies on a knot decides on which side it is.
    """
    at, argument = _knots(item, values)[0], t
    if item.turning:
        argument = at[0] + past(Turning.of(info_of(manifest, item), values).at(t)[0], at[0], item.turns)
        at = np.append(at, at[0] + item.turns * TURN)
    k = int(np.searchsorted(at, argument, side="right"))
    last = len(item.times) - 1
    if not item.turning and k in (0, len(at)):
        row = 0 if k == 0 else last
        return TablePiece(rows=(row, row), knots=(float(at[row]),) * 2, argument=float(argument))
    rows = (k - 1, k % len(item.times) if item.turning else k)
    return TablePiece(rows=rows, knots=(float(at[k - 1]), float(at[k])), argument=float(argument))


def _table(
    item: InputInfo, values: Values, t: np.ndarray, inside: np.ndarray, turning: Turning | None = None
) -> np.ndarray:
    """Value at `t`, or slope, of the piece of a table that holds at `inside`."""
    at, heights = _knots(item, values)
    begin, now = inside, t
    if turning is not None:
        angle = turning.held(inside, inside)[0]
        begin = at[0] + past(angle, at[0], item.turns)
        now = begin + (turning.held(t, inside)[0] - angle)
        at, heights = np.append(at, at[0] + item.turns * TURN), np.append(heights, heights[0])
    k = np.searchsorted(at.real, begin.real, side="right")
    within = (k > 0) & (k < len(at))
    # pieces before the first knot and after the last are flat; a table over the angle has none
    slopes = np.concatenate([np.zeros(1), np.diff(heights) / np.diff(at), np.zeros(1)])[k]
    if item.kind == "table_rate":
        return np.asarray(slopes)
    left = np.clip(k - 1, 0, len(at) - 1)
    return np.where(within, heights[left] + slopes * (now - at[left]), heights[left])


def _passes(angle: float, edge: float, turns: int = 1) -> bool:
    """Whether an angle is that of an edge, but for the rounding of the time at which it is passed."""
    return abs(math.remainder(angle - edge, turns * TURN)) < 1e3 * ANGLE_RESOLUTION * max(1.0, abs(angle))


def _windows(item: InputInfo, values: Values) -> list[tuple[float, float]]:
    """(start in [0, 2 pi), width) of each window [rad]; an end before the start lies in the next turn."""
    windows = []
    for first, last in item.windows:
        start, end = values[first].real, values[last].real
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
    return np.asarray(past(angle, start) < width - ANGLE_RESOLUTION)


def _knots(item: InputInfo, values: Values) -> tuple[np.ndarray, np.ndarray]:
    at = knots(item.times, values, *(("angles", "rad") if item.turning else ("times", "s")))
    heights = np.array([values[name] for name in item.values])
    if item.turning and not at[-1].real - at[0].real < item.turns * TURN - ANGLE_RESOLUTION:
        raise RequestError(
            f"The angles of a table must lie within {'a turn' if item.turns == 1 else f'{item.turns} turns'}: "
            f"{item.times[-1]} = {at[-1]:g} rad was given with {item.times[0]} = {at[0]:g} rad. Change one of the two."
        )
    return at, heights
