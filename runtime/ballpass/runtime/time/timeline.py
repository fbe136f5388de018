"""What turns, and values of the inputs at a time: angles, windows, tables.

In: a manifest and values by name.  Out: numbers for ``u``, and their derivatives along directions.

Angles are reduced modulo a turn here, so that the generated code sees small arguments in the thousandth turn as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import BearingInfo, InputInfo, Manifest, TurningInfo
from ballpass.runtime.time.turning import ANGLE_RESOLUTION, STEP, TURN, Turning, Values, knots, past

#: Times closer than this fraction of the interval under study are one time [1].
TIME_RESOLUTION = 1e-12

#: Rings turn against each other above this part of the speed of the driver [1].
TURNS = 1e-9


def speed_name(manifest: Manifest) -> str | None:
    """Parameter or constant that holds the speed of driver or shaft; None when the model has neither."""
    if manifest.mechanism is not None:
        return manifest.mechanism.speed
    return None if manifest.bearing is None else "shaft.speed"


def shaft_speed(manifest: Manifest, values: Values) -> float:
    """Speed of the driver, else of the shaft, counter-clockwise [rad/s]; 0 when the model has neither.

    Where it changes, the first one.
    """
    name = speed_name(manifest)
    return 0.0 if name is None else float(values[name])


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


def is_even(manifest: Manifest, values: Values) -> bool:
    """Whether the driver's speed is constant: no torque drives, and no table has rows of unlike speeds."""
    return not is_free(manifest) and one_speed(manifest, values)


def turns_steadily(bearing: BearingInfo, values: Values, speed: float) -> bool:
    """Whether a bearing's rings turn against each other, and do not only swing, at a speed of driver or shaft
    [rad/s]."""
    return float(abs(values[bearing.ring_speed])) > TURNS * abs(speed)


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
            inputs[:, k] = (values[manifest.mechanism.start_angle] + angles) % (item.turns * TURN)
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
        within = [_covers(angle, start, width) for start, width in windows_of(item, values)]
        return np.asarray(np.any(within, axis=0), dtype=float)
    if item.kind in ("table", "table_rate"):
        return _table(item, values, t, inside, turning.get(item.turning))
    angle, rate, slope = turning[item.turning].held(t, inside)
    if item.kind == "phase":
        reduced = np.mod(angle.real, item.turns * TURN)
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


def info_of(manifest: Manifest, item: InputInfo) -> TurningInfo:
    return next(info for info in manifest.turnings if info.name == item.turning)


def table_piece(
    manifest: Manifest, item: InputInfo, values: Values, t: float
) -> tuple[tuple[int, int], tuple[float, float], float]:
    """Piece of a table that holds at a time: its rows, twice one where the table is flat, their knots, the argument.

    Knots and argument are times [s], or angles [rad] counted on beyond a turn, so that they increase.  The rounding of
    a time that lies on a knot decides on which side it is.
    """
    at, argument = table_knots(item, values)[0], t
    if item.turning:
        argument = at[0] + past(Turning.of(info_of(manifest, item), values).at(t)[0], at[0], item.turns)
        at = np.append(at, at[0] + item.turns * TURN)
    k = int(np.searchsorted(at, argument, side="right"))
    if not item.turning and k in (0, len(at)):
        row = max(k - 1, 0)
        return (row, row), (float(at[row]), float(at[row])), float(argument)
    rows = (k - 1, k % len(item.times) if item.turning else k)
    return rows, (float(at[k - 1]), float(at[k])), float(argument)


def _table(
    item: InputInfo, values: Values, t: np.ndarray, inside: np.ndarray, turning: Turning | None = None
) -> np.ndarray:
    """Value at `t`, or slope, of the piece of a table that holds at `inside`."""
    at, heights = table_knots(item, values)
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


def windows_of(item: InputInfo, values: Values) -> list[tuple[float, float]]:
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


def table_knots(item: InputInfo, values: Values) -> tuple[np.ndarray, np.ndarray]:
    """Where a table has its rows, times [s] or angles [rad], and its values there.

    Raises
    ------
    RequestError
        They do not increase, or do not lie within the turns of the table.
    """
    at = knots(item.times, values, *(("angles", "rad") if item.turning else ("times", "s")))
    heights = np.array([values[name] for name in item.values])
    if item.turning and not at[-1].real - at[0].real < item.turns * TURN - ANGLE_RESOLUTION:
        raise RequestError(
            f"The angles of a table must lie within {'a turn' if item.turns == 1 else f'{item.turns} turns'}: "
            f"{item.times[-1]} = {at[-1]:g} rad was given with {item.times[0]} = {at[0]:g} rad. Change one of the two."
        )
    return at, heights
