"""Angles that are known before a run: each a piecewise quadratic function of time, with its whole turns kept.

In: names of the manifest, values.  Out: a `Turning`: where it stands, when it passes an angle, how many turns a span
has.

Values may be complex: a number moved by `STEP` along a direction gives that derivative as the imaginary part of a
result over `STEP`, exact to rounding (doi:10.1145/838250.838251).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import TurningInfo

TURN = 2.0 * math.pi

#: Angles closer than this are one angle [rad]: an edge hit by rounding belongs to the window that starts there.
ANGLE_RESOLUTION = 1e-11

#: Turns whose passages are listed at once; each takes eight bytes.
MOST_TURNS = 1e7

#: Imaginary step of derivatives [1].
STEP = 1e-60

Values = Mapping[str, Any]

#: Begin, and no acceleration, of what turns at one rate.
_START = np.zeros(1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Turning:
    """An angle over time: in piece k, ``angle + rate s + half s^2`` with ``s = t - begin``.

    Attributes
    ----------
    begin, angle, rate, half : of each piece, shape (pieces,); the first one holds before its begin as well [s], [rad]

    Examples
    --------
    >>> from ballpass.runtime.time.turning import Turning
    >>> at_rest_then_fast = Turning.by_speeds(0.0, [0.0, 2.0], [0.0, 10.0])
    >>> [float(x) for x in at_rest_then_fast.at(3.0)]  # angle [rad] and rate [rad/s]
    [20.0, 10.0]
    """

    begin: np.ndarray
    angle: np.ndarray
    rate: np.ndarray
    half: np.ndarray

    @classmethod
    def even(cls, offset: Any, rate: Any) -> Turning:
        """At one rate, from t = 0 on."""
        return cls(begin=_START, angle=np.array([offset]), rate=np.array([rate]), half=_START)

    @classmethod
    def by_speeds(cls, offset: Any, times: Any, speeds: Any) -> Turning:
        """By rows of its speed, linear between them and constant outside; `offset` at t = 0."""
        return cls._integrated(offset, np.asarray(times), np.asarray(speeds), (np.zeros(0), np.zeros(0)), (1.0, 0.0))

    @classmethod
    def of(cls, info: TurningInfo, values: Values) -> Turning:
        """A turning of the manifest.

        Raises
        ------
        RequestError
            Times of a table do not increase.
        """
        offset = values[info.offset] if info.offset else 0.0
        if not info.turns and not info.times:
            return cls.even(offset, values[info.rate])
        rows, slips = knots(info.times, values), knots(info.lag_times, values)
        speeds = np.array([values[name] for name in info.speeds] or [0.0])
        lags = np.array([values[name] for name in info.lags])
        shares = (values[info.turns] if info.turns else 1.0, values[info.rolling] if info.rolling else 0.0)
        return cls._integrated(offset - (values[info.lag] if info.lag else 0.0), rows, speeds, (slips, lags), shares)

    @classmethod
    def _integrated(
        cls,
        offset: Any,
        times: np.ndarray,
        speeds: np.ndarray,
        lag: tuple[np.ndarray, np.ndarray],
        shares: tuple[Any, Any],
    ) -> Turning:
        """Shares of a speed, the second times the slope of a lag, integrated over time."""
        all_knots = np.concatenate([np.zeros(1), times[times.real > 0.0], lag[0][lag[0].real > 0.0]])
        begin = all_knots[np.unique(all_knots.real, return_index=True)[1]]
        row, slope = _pieces(times, speeds, begin)
        speed = speeds[row] + slope * (begin - times[row]) if len(times) else np.full(len(begin), speeds[0])
        turned = shares[0] - shares[1] * _pieces(*lag, begin)[1]
        rate, half, length = turned * speed, 0.5 * turned * slope, np.diff(begin)
        passed = np.cumsum(length * (rate[:-1] + length * half[:-1]))
        angle = offset + np.concatenate([np.zeros(1), passed])
        return cls(begin=begin, angle=angle, rate=rate, half=half)

    @property
    def is_even(self) -> bool:
        """Whether it turns at one rate."""
        return self.begin.size == 1 and not self.half[0]

    @property
    def even_from(self) -> float:
        """Time from which on it turns at one rate [s]."""
        bent = np.flatnonzero(self.half)
        return float(self.begin[bent[-1] + 1].real) if bent.size else 0.0

    def times(self, multiple: int) -> Turning:
        """So many times the angle."""
        if multiple == 1:
            return self
        return Turning(
            begin=self.begin,
            angle=multiple * self.angle,
            rate=multiple * self.rate,
            half=multiple * self.half,
        )

    def _piece(self, t: Any) -> Any:
        if self.begin.size == 1:
            return 0
        return np.maximum(np.searchsorted(self.begin.real, t, side="right") - 1, 0)

    def at(self, t: Any) -> tuple[Any, Any]:
        """Angle with its whole turns [rad], and rate [rad/s]."""
        k = self._piece(t)
        s = t - self.begin[k]
        return self.angle[k] + s * (self.rate[k] + s * self.half[k]), self.rate[k] + 2.0 * s * self.half[k]

    def held(self, t: Any, inside: Any) -> tuple[Any, Any, Any]:
        """Angle [rad], rate [rad/s] and slope of the rate [rad/s^2] at `t`, of the piece that holds at `inside` [s]."""
        k = self._piece(inside)
        s = t - self.begin[k]
        angle = self.angle[k] + s * (self.rate[k] + s * self.half[k])
        return angle, self.rate[k] + 2.0 * s * self.half[k], 2.0 * self.half[k]

    @property
    def turn(self) -> float:
        """Time of a turn at the rate behind the last piece [s]; infinite where it stands then."""
        rate = float(self.rate[-1].real)
        return TURN / abs(rate) if rate else math.inf

    def turns(self, begin: float, end: float) -> float:
        """Turns in a span, in either sense [1]."""
        return (end - begin) / self.turn if self.is_even else self.turned(begin, end).real

    def turned(self, begin: float, end: float) -> complex:
        """The same, with its derivative as `STEP` has it."""
        if self.is_even:
            rate = complex(self.rate[0])
            return (rate if rate.real > 0.0 else -rate) * (end - begin) / TURN
        passed = np.diff(self.at(self._edges(begin, end))[0])
        return complex(np.sum(np.where(passed.real < 0.0, -passed, passed))) / TURN

    def after(self, turns: float, begin: float = 0.0) -> float:
        """Time at which it has made so many turns since another time, in either sense [s]; infinite where it never has.

        Examples
        --------
        >>> from ballpass.runtime.time.turning import TURN, Turning
        >>> run_up = Turning.by_speeds(0.0, [0.0, 2.0], [0.0, TURN])  # to a turn a second in two
        >>> run_up.after(0.25), run_up.after(3.0)
        (1.0, 4.0)
        """
        if turns == 0.0:
            return begin
        if self.is_even:
            return begin + turns * self.turn
        last = max(begin, float(self.begin[-1]))
        edges = self._edges(begin, last + (turns * self.turn if math.isfinite(self.turn) else 1.0))
        places = self.at(edges)[0]
        passed = np.concatenate([np.zeros(1), np.cumsum(np.abs(np.diff(places)))]) / TURN
        k = int(np.searchsorted(passed, turns * (1.0 - 1e-15)))
        if k == len(edges):
            return math.inf
        ahead = math.copysign(TURN * (turns - passed[k - 1]), places[k] - places[k - 1])
        return float(self._when(float(places[k - 1]), np.array([ahead]), float(edges[k - 1]), float(edges[k]))[0])

    def after_slope(self, time: float, begin: float) -> float:
        """Derivative of the time at which as many turns have been made since another as at `time`, as `STEP` has it.

        Raises
        ------
        RequestError
            It stands then.
        """
        rate = abs(complex(self.at(time)[1]).real)
        if rate == 0.0:
            raise RequestError(
                f"cycles: the driver stands at {time:.6g} s, where so many turns are made: parameters move that time "
                "by leaps. Give a duration in seconds, or turns that end while it turns."
            )
        return -self.turned(begin, time).imag / STEP * TURN / rate

    def mean_rate(self, begin: float, end: float) -> float:
        """Over a span [rad/s]."""
        first, last = self.at(np.array([begin, end]))[0]
        return float(last - first) / (end - begin)

    def fastest_within(self, begin: float, end: float) -> float:
        """Largest rate in a span, in either sense [rad/s]."""
        inner = self.begin[(begin < self.begin) & (self.begin < end)]
        return float(np.max(np.abs(self.at(np.concatenate([[begin], inner, [end]]))[1])))

    def swept(self, begin: float, end: float) -> tuple[float, float]:
        """Least and largest angle in a span [rad]."""
        places = self.at(self._edges(begin, end))[0].real
        return float(places.min()), float(places.max())

    @property
    def fastest(self) -> float:
        """Largest rate, in either sense [rad/s]."""
        return (
            abs(float(self.rate[0].real)) if self.begin.size == 1 else self.fastest_within(0.0, float(self.begin[-1]))
        )

    def passes(self, angle: float, begin: float, end: float, turns: int = 1) -> np.ndarray:
        """Times in a span at which it passes an angle, modulo so many turns, increasing [s].

        Raises
        ------
        RequestError
            More than `MOST_TURNS` turns.
        """
        edges = [begin, end]
        if self.is_even:  # of Python's numbers, which overflow without a word
            angle_0, rate_0 = float(self.angle[0]), float(self.rate[0])
            places = [angle_0 + rate_0 * begin, angle_0 + rate_0 * end]
        else:
            edges = self._edges(begin, end).tolist()
            places = self.at(np.array(edges))[0].tolist()
        passed = sum(abs(last - first) for first, last in pairwise(places)) / TURN
        if not passed <= MOST_TURNS:
            raise RequestError(
                f"Between {begin:g} s and {end:g} s lie {passed:.3g} turns, too many to list what switches in them. "
                f"Allowed: up to {MOST_TURNS:g}. Ask for a shorter time."
            )
        period, found = turns * TURN, []
        for (left, right), ends in zip(pairwise(edges), pairwise(places), strict=True):
            low, high = ((e - angle) / period for e in sorted(ends))
            whole = np.arange(math.ceil(low - 1e-9), math.floor(high + 1e-9) + 1)
            found.append(self._when(angle, period * whole, left, right).clip(left, right))
        return np.unique(np.concatenate(found)) if len(found) > 1 else np.sort(found[0])  # clockwise they fall

    def first_pass(self, angle: float, turns: int = 1, begin: float = 0.0) -> float | None:
        """The first time from another on at which it passes an angle, modulo so many turns [s]; None without one."""
        # from the last piece's begin on it turns at one rate
        further = 1.5 * turns * self.turn if self.rate[-1] else 1.0
        return next(iter(self.passes(angle, begin, max(begin, float(self.begin[-1])) + further, turns).tolist()), None)

    def last_pass(self, angle: float, end: float, turns: int = 1) -> float | None:
        """The last time from t = 0 to `end` at which it does [s]; None without one."""
        back = 1.5 * turns * TURN / (self.fastest or 1.0)
        while not len(found := self.passes(angle, max(end - back, 0.0), end, turns)):
            if back >= end:
                return None
            back *= 2.0
        return float(found[-1])

    def _when(self, angle: float, whole: np.ndarray, left: float, right: float) -> np.ndarray:
        """Times at which it is at an angle plus whole turns, in a part of a piece where it grows or falls [s]."""
        middle = 0.5 * (left + right)
        k = int(self._piece(middle))
        rate, half, ahead = self.rate[k], self.half[k], (angle - self.angle[k]) + whole
        if half == 0.0:
            return np.zeros(0) if rate == 0.0 else np.asarray(self.begin[k] + ahead / rate)
        root = np.sqrt(np.maximum(rate * rate + 4.0 * half * ahead, 0.0))
        sense = math.copysign(1.0, rate + 2.0 * half * (middle - self.begin[k]))
        with np.errstate(divide="ignore", invalid="ignore"):
            roots = self.begin[k] + 2.0 * ahead / (rate + sense * root)
        # where it turns back both roots meet
        return np.asarray(np.where(rate + sense * root == 0.0, self.begin[k] - 0.5 * rate / half, roots))

    def _edges(self, begin: float, end: float) -> np.ndarray:
        """The span, cut into parts in which the angle grows or falls."""
        if self.is_even:
            return np.array([begin, end])
        starts, half = self.begin.real, self.half.real
        with np.errstate(divide="ignore", invalid="ignore"):
            back = starts - 0.5 * self.rate.real / half
        edges = np.concatenate([starts[1:], back[(half != 0.0) & (back > starts)]])
        return np.unique(np.concatenate([[begin], edges[(begin < edges) & (edges < end)], [end]]))


def past(angle: Any, first: Any = 0.0, turns: int = 1) -> Any:
    """An angle past another, less whole turns or whole times so many; rounding before an edge counts as the edge."""
    period = turns * TURN
    ahead = np.asarray(angle - first)
    rest = np.mod(ahead.real, period)
    rest = np.where(period - rest < ANGLE_RESOLUTION, 0.0, rest)
    return rest if ahead.dtype.kind != "c" else rest + 1j * ahead.imag


def beside(angle: Any, other: Any = 0.0) -> Any:
    """How far an angle is from another, less whole turns: by half a turn at most, in either sense."""
    ahead = angle - other
    return ahead - TURN * np.rint(ahead / TURN)


def knots(names: tuple[str, ...], values: Values, word: str = "times", unit: str = "s") -> np.ndarray:
    """Values that increase, of the rows of a table.

    Raises
    ------
    RequestError
        They do not.
    """
    found = np.array([values[name] for name in names]) if names else np.zeros(0)
    steps = np.diff(found.real)
    if np.any(steps <= 0.0):
        k = int(np.argmax(steps <= 0.0))
        raise RequestError(
            f"The {word} of a table must increase: {names[k + 1]} = {found[k + 1].real:g} {unit} was given after "
            f"{names[k]} = {found[k].real:g} {unit}. Change one of the two."
        )
    return found


def _pieces(at: np.ndarray, heights: np.ndarray, begin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Row from which a table goes on behind each time, and its slope there: zero outside of the rows."""
    behind = np.searchsorted(at.real, begin.real, side="right")
    slopes = np.concatenate([np.zeros(1), np.diff(heights) / np.diff(at), np.zeros(1)]) if len(at) else np.zeros(1)
    return np.clip(behind - 1, 0, None), slopes[behind]
