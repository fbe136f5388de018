"""Segments of many members at once, by C of `driver/schedule.c`, which exported programs have as well.

In: parameters and constants of members, their spans.  Out: ends of segments, the inputs that hold in them, and those at
the moments that magnitudes are taken from.  `ballpass.runtime.request.segments` finds the same for one run, to the last
bit, and needs no compiler.
"""

from __future__ import annotations

import ctypes

import numpy as np

from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.native.c_calls import DOUBLES, LONGS, address, declare

#: Kinds of inputs in the order of schedule.h.
KINDS = ("phase", "angle", "rate", "slope", "gate", "table", "table_rate", "border")

#: Moments between edges, and as many evenly spread; as in schedule.h.
MOMENTS = 32


class _ScheduleTurning(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_int) for name in ("offset", "rate", "turns", "rolling", "lag", "live", "rows")),
        ("times", ctypes.c_void_p),
        ("speeds", ctypes.c_void_p),
        ("lag_rows", ctypes.c_int),
        ("lag_times", ctypes.c_void_p),
        ("lags", ctypes.c_void_p),
    )


class _ScheduleInput(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_int) for name in ("kind", "turning", "turns", "parts", "windows")),
        ("edges", ctypes.c_void_p),
        ("knots", ctypes.c_int),
        ("times", ctypes.c_void_p),
        ("heights", ctypes.c_void_p),
    )


class _Scene(ctypes.Structure):
    _fields_ = (
        ("inputs", ctypes.c_void_p),
        ("count", ctypes.c_int),
        ("turnings", ctypes.c_void_p),
        ("turning_count", ctypes.c_int),
    )


class _Schedule(ctypes.Structure):
    _fields_ = (
        ("scene", _Scene),
        ("columns", ctypes.c_int),
        ("members", ctypes.c_long),
        ("values", ctypes.c_void_p),
    )


#: Records as the library declares them, in the order in which it returns their sizes.
SCHEDULE_RECORDS = (_Schedule, _ScheduleInput, _ScheduleTurning)


class MemberSchedule:
    """When loads of a model switch, and which inputs hold in between.

    Parameters
    ----------
    code : library of the ensembles' driver
    manifest : of the model
    """

    def __init__(self, code: ctypes.CDLL, manifest: Manifest) -> None:
        self._code = code
        names = [*(info.name for info in manifest.parameters), *(info.name for info in manifest.constants)]
        place = {name: k for k, name in enumerate(names)} | {"": -1}
        self._kept: list[np.ndarray] = []

        def places(named: tuple[str, ...]) -> int | None:
            if not named:
                return None
            self._kept.append(np.array([place[name] for name in named], dtype=ctypes.c_int))
            return int(self._kept[-1].ctypes.data)

        turnings = {info.name: k for k, info in enumerate(manifest.turnings)}
        self._turnings = (_ScheduleTurning * max(len(turnings), 1))(
            *(
                _ScheduleTurning(
                    *(place[name] for name in (info.offset, info.rate, info.turns, info.rolling, info.lag)),
                    -1,
                    len(info.times),
                    places(info.times),
                    places(info.speeds),
                    len(info.lag_times),
                    places(info.lag_times),
                    places(info.lags),
                )
                for info in manifest.turnings
            )
        )
        self._turning_count = len(turnings)
        self._count = len(manifest.inputs)
        self._inputs = (_ScheduleInput * max(self._count, 1))(
            *(
                _ScheduleInput(
                    KINDS.index(item.kind),
                    turnings.get(item.turning, -1),
                    item.turns,
                    item.parts,
                    len(item.windows),
                    places(tuple(name for window in item.windows for name in window)),
                    len(item.times),
                    places(item.times),
                    places(item.values),
                )
                for item in manifest.inputs
            )
        )
        schedule, long, double = ctypes.POINTER(_Schedule), ctypes.c_long, ctypes.c_double
        spans, windows = (DOUBLES, DOUBLES, DOUBLES), (double, long, long)
        declare(code, "ballpass_schedule_edges", double, schedule, *spans, *windows, double, LONGS, DOUBLES)
        declare(code, "ballpass_schedule_inputs", None, schedule, long, LONGS, DOUBLES, DOUBLES, DOUBLES)
        declare(code, "ballpass_schedule_moments", long, schedule, LONGS, DOUBLES, DOUBLES, LONGS, DOUBLES)

    def _of(self, values: np.ndarray) -> ctypes.Structure:
        members, columns = values.shape
        inputs, turnings = ctypes.addressof(self._inputs), ctypes.addressof(self._turnings)
        scene = _Scene(inputs, self._count, turnings, self._turning_count)
        return _Schedule(scene, columns, members, address(values))

    def most(self, values: np.ndarray, spans: tuple[np.ndarray, np.ndarray, np.ndarray], *windows: int) -> float:
        """The most segments that `edges` may give."""
        return float(self._code.ballpass_schedule_edges(self._of(values), *spans, *windows, 0.0, None, None))

    def edges(
        self,
        values: np.ndarray,
        spans: tuple[np.ndarray, np.ndarray, np.ndarray],
        *windows: int,
        most: float,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Ends of the segments of some windows of the members' runs.

        Parameters
        ----------
        values : parameters and then constants, shape (members, .)
        spans : durations, turns, and where reductions start, each of shape (members,) [s]
        windows : turns of a window, the first window, and how many
        most : segments that there may be

        Returns
        -------
        first segment of each member, shape (members + 1,); ends, one more than segments for each, increasing [s]
        """
        members = len(values)
        first, times = np.zeros(members + 1, dtype=ctypes.c_long), np.empty(int(most) + 2 * members)
        count = self._code.ballpass_schedule_edges(self._of(values), *spans, *windows, most, first, times)
        if count < 0.0:
            raise MemoryError(f"Segments of {members} members")
        return first, times[: int(count) + members].copy()

    def inputs(self, values: np.ndarray, owner: np.ndarray, t: np.ndarray, inside: np.ndarray) -> np.ndarray:
        """Inputs of segments that start at `t`, shape (n, inputs).

        Parameters
        ----------
        values : as for `edges`
        owner : member of each, shape (n,)
        t, inside : reference times, and times for which gates and slopes hold, shape (n,) [s]
        """
        found = np.empty((len(t), self._count))
        owners = np.ascontiguousarray(owner, dtype=ctypes.c_long)
        self._code.ballpass_schedule_inputs(self._of(values), len(t), owners, t, inside, found)
        return found

    def moments(
        self, values: np.ndarray, first: np.ndarray, times: np.ndarray, horizons: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """First moment of each member, shape (members + 1,), and inputs at the moments, shape (moments, inputs).

        Parameters
        ----------
        values : as for `edges`
        first, times : from `edges`
        horizons : a turn, or the run, of each member [s]
        """
        rows = np.zeros(len(values) + 1, dtype=ctypes.c_long)
        found = np.empty((2 * MOMENTS * len(values), max(self._count, 1)))
        count = self._code.ballpass_schedule_moments(self._of(values), first, times, horizons, rows, found)
        return rows, np.ascontiguousarray(found[:count, : self._count])
