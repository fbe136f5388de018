"""Times at which inputs switch or bend: edges of windows, rows of tables; and their derivatives.

In: a manifest and numbers.  Out: times, increasing, and which parameters move them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ballpass.runtime.contract.manifest import InputInfo, Manifest
from ballpass.runtime.time import timeline
from ballpass.runtime.time.turning import ANGLE_RESOLUTION, TURN, Turning, Values, knots


def rows_over_time(manifest: Manifest, values: Values, begin: float, end: float) -> np.ndarray:
    """Times in (begin, end) of rows of tables over time: load or its window, driver's speed, cage's slip [s]."""
    return _apart([np.zeros(0), *_rows(manifest, values)], begin, end)


def _rows(manifest: Manifest, values: Values) -> Iterator[np.ndarray]:
    for info in manifest.turnings:
        yield from (knots(names, values) for names in (info.times, info.lag_times) if names)
    for item in manifest.inputs:
        if item.kind in ("table", "table_rate") and not item.turning:
            yield knots(item.times, values)


def breakpoints(manifest: Manifest, values: Values, t0: float, t1: float) -> np.ndarray:
    """Times in the open interval (t0, t1) at which a gate switches or a table has a knot.

    A window of zero width and one of a turn or more never switch.

    Returns
    -------
    array, shape (breakpoints,), increasing [s]

    Raises
    ------
    RequestError
        More than `turning.MOST_TURNS` turns.
    """
    found = [np.zeros(0), *_rows(manifest, values)]
    for item in manifest.inputs:
        if item.kind == "gate" or (item.kind in ("table", "table_rate") and item.turning):
            found += [times for _, times in edge_times(manifest, item, values, t0, t1)]
    return _apart(found, t0, t1)


def _apart(found: Sequence[np.ndarray], t0: float, t1: float) -> np.ndarray:
    """Sorted times between two, those that are one time once."""
    near = timeline.TIME_RESOLUTION * max(abs(t0), abs(t1))
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
    manifest: Manifest, item: InputInfo, values: Values, t0: float, t1: float
) -> Iterator[tuple[str, np.ndarray]]:
    """Edges of windows or knots of a table over an angle, by name, and when they are passed in [t0, t1] [s]."""
    turning = Turning.of(timeline.info_of(manifest, item), values).times(item.parts)
    for name, edge in _edges(item, values):
        yield name, turning.passes(edge, t0, t1, item.turns)


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
            angle, rate = Turning.of(timeline.info_of(manifest, item), values).times(item.parts).at(t)
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
            turned = np.array([timeline.angle_slope(infos[turning], values, direction, t) for direction in moved])
            slopes[row] = (slopes[row] / parts - turned) / Turning.of(infos[turning], values).at(t)[1]
    return [name for name, _, _ in keys], slopes


def _rows_near(names: Sequence[str], values: Values, t: float) -> list[str]:
    times = np.array([values[name] for name in names])
    return [
        name
        for name, time in zip(names, times, strict=True)
        if abs(time - t) <= timeline.TIME_RESOLUTION * max(abs(t), 1e-300, float(np.max(np.abs(times))))
    ]


def _edges(item: InputInfo, values: Values) -> Iterator[tuple[str, float]]:
    """Angles at which an input changes, by name: edges of windows that switch, knots of a table."""
    if item.kind != "gate":
        yield from zip(item.times, timeline.table_knots(item, values)[0].tolist(), strict=True)
    else:
        for names, (start, width) in zip(item.windows, timeline.windows_of(item, values), strict=True):
            if 0.0 < width < TURN:
                yield from zip(names, (start, start + width), strict=True)


def _passes(angle: float, edge: float, turns: int = 1) -> bool:
    """Whether an angle is that of an edge, but for the rounding of the time at which it is passed."""
    return abs(math.remainder(angle - edge, turns * TURN)) < 1e3 * ANGLE_RESOLUTION * max(1.0, abs(angle))
