"""After how long a machine repeats: whole turns of its driver, rows of tables over time, and beats of what else turns.

In: a manifest and numbers.  Out: a `Repetition`.  All rates are those behind the last row of a table over time.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from ballpass.runtime.contract.manifest import InputInfo, Manifest, TurningInfo
from ballpass.runtime.time import timeline
from ballpass.runtime.time.turning import TURN, Turning, Values, knots

#: Orders of beats: q times the one rate is nearly a multiple of the other.  A load and the shaft, others; and the most
#: multiples of what is not the shaft [1].
MOST_OF_SHAFT, MOST_OF_OTHERS, MOST_MULTIPLES = 6, 2, 6

#: Rates this near to a multiple of each other are locked [1].
LOCKED = 1e-9

#: Two rates are commensurable where a fraction with at most this denominator meets their ratio so closely [1].
LARGEST_DENOMINATOR, EXACT = 2000, 1e-11

#: The most turns that a question runs to find what repeats: no later row of a table over time matters to it.
MOST_RUN = 4096

#: Rows at later times are not met: the end of a load that has none [s].
NEVER = 1e8


@dataclass(frozen=True, slots=True, kw_only=True)
class Rate:
    """What turns at one rate.

    Attributes
    ----------
    words : what turns, "load push"
    speed : in either sense [rad/s]
    parts : into which a turn of it falls that look alike: the balls of a cage; a part of one where loads repeat after
        several turns
    phases : parameters of its phase, and what half a part is of them
    """

    words: str
    speed: float
    parts: Fraction = Fraction(1)
    phases: Mapping[str, float] = field(default_factory=dict)

    @property
    def frequency(self) -> float:
        """Parts that pass in a second [Hz]."""
        return float(self.speed * self.parts) / TURN


@dataclass(frozen=True, slots=True, kw_only=True)
class Beat:
    """Two rates that are nearly multiples of each other.

    Attributes
    ----------
    words : what beats, "load push with the shaft"
    period : after which their phases are alike again [s]
    half : what a run that is half a beat further on has more of parameters, by name
    """

    words: str
    period: float
    half: Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Repetition:
    """When a machine repeats.

    Attributes
    ----------
    driver : the angle of driver or shaft; where a torque drives, of its first speed
    turns : of it, after which all bodies and all loads over its angle repeat: two for a four-stroke engine
    changes : spans of time in which tables over time change a value; one that jumps does so at once [s]
    rates : of turnings, by these; what stands is left out
    shaft, balls : driver or shaft, and balls that pass the outer rings of bearings

    Examples
    --------
    >>> from ballpass.runtime.time.repetition import Repetition
    >>> repetition = Repetition.of(model.manifest, model.numbers().values)
    >>> repetition.turns, repetition.settled_after
    (1, -inf)
    """

    driver: Turning
    turns: int
    changes: tuple[tuple[float, float], ...]
    rates: Mapping[TurningInfo, Rate]
    shaft: Rate
    balls: tuple[Rate, ...]

    @classmethod
    def of(cls, manifest: Manifest, values: Values) -> Repetition:
        """Of a model with these parameters and constants.

        Raises
        ------
        RequestError
            Times or angles of a table do not increase.
        """
        driver, settled = timeline.driver(manifest, values), {**values, **timeline.settled_rates(manifest, values)}
        speed, tables = abs(float(driver.rate[-1])), _tables(manifest, values)
        return cls(
            driver=driver,
            turns=math.lcm(1, *(turns for _, turns in tables)),
            changes=tuple(_changes(manifest, values)),
            rates=dict(_rates(manifest, values, tables)),
            shaft=Rate(words="the shaft" if manifest.mechanism is None else "the driver", speed=speed),
            balls=tuple(_balls(manifest, settled, speed)),
        )

    @property
    def turn(self) -> float:
        """Time of a turn of driver or shaft [s]; infinite when it stands or none exists."""
        return self.driver.turn

    def whole(self, turns: float) -> int:
        """At least so many turns: as many as all loads repeat after, or several times that."""
        return self.turns * math.ceil(turns / self.turns)

    def changing(self, begin: float, end: float) -> bool:
        """Whether a table over time changes a value in (begin, end) [s]: turns there are unlike each other."""
        near = timeline.TIME_RESOLUTION * max(abs(begin), abs(end))
        return any(first < end - near and last > begin + near for first, last in self.changes)

    def holds(self, begin: float) -> bool:
        """Whether turns from a time on [s] are alike: something turns, and no table over time changes a value then."""
        if not math.isfinite(self.turn) or not math.isfinite(begin):
            return False
        return not self.changing(begin, begin + MOST_RUN * self.turn)

    @property
    def settled_after(self) -> float:
        """Time of the last row that changes a value; rows of equal value are no rows [s].  -inf without one."""
        return max((last for _, last in self.changes), default=-math.inf)

    @property
    def alike_from(self) -> float:
        """Time from which on turns are alike, driver or shaft at its first angle [s]; 0 where no row changes a
        value."""
        settled = self.settled_after
        if not settled > 0.0:
            return 0.0
        found = self.driver.first_pass(float(self.driver.at(0.0)[0]), self.turns, settled)
        return settled if found is None else found

    @property
    def loads(self) -> tuple[Rate, ...]:
        """Harmonic loads; components of one are one."""
        return tuple({info.rate: rate for info, rate in self.rates.items() if info.kind == "load"}.values())

    @property
    def slowest_load(self) -> float:
        """Period of the slowest harmonic load [s]; zero without one."""
        return max((TURN / load.speed for load in self.loads), default=0.0)

    def beats(self) -> Iterator[Beat]:
        """Beats of harmonic loads and passing balls with the shaft, and with each other; none where nothing turns."""
        others = (*self.balls, *self.loads) if self.shaft.speed else ()
        for number, one in enumerate(others):
            for other in (self.shaft, *others[:number]):
                with_shaft = other is self.shaft
                for q in range(1, (MOST_OF_SHAFT if with_shaft and one in self.loads else MOST_OF_OTHERS) + 1):
                    multiple = round(q * one.frequency / other.frequency)
                    apart = abs(q * one.frequency - multiple * other.frequency)
                    if math.gcd(q, multiple) > 1 or (not with_shaft and multiple > MOST_MULTIPLES):
                        continue
                    if multiple and apart > LOCKED * q * one.frequency:
                        half = {name: step / q for name, step in one.phases.items()}
                        yield Beat(words=f"{one.words} with {other.words}", period=1.0 / apart, half=half)

    def period(self, among: Sequence[TurningInfo]) -> dict[TurningInfo, Fraction | None]:
        """Turns of some turnings in the shortest time after which each is there again, or shows a part that looks
        alike; None for those that have no such time with the first one."""
        base, found = self.rates[among[0]].frequency, {}
        for info in among:
            found[info] = near_fraction(self.rates[info].frequency / base, LARGEST_DENOMINATOR, EXACT)
        whole = math.lcm(*(near.denominator for near in found.values() if near is not None))
        return {info: None if near is None else whole * near / self.rates[info].parts for info, near in found.items()}

    def slowest_beat(self, most: float) -> float:
        """Period of the slowest beat of at most some time [s]; zero without one."""
        return max((beat.period for beat in self.beats() if beat.period <= most), default=0.0)


def near_fraction(ratio: float, most: int, within: float) -> Fraction | None:
    """The fraction with a denominator up to `most` that a ratio is; None where none is so near, relative to it."""
    near = Fraction(ratio).limit_denominator(most)
    return near if abs(near - ratio) <= within * ratio else None


def alike_from_slope(manifest: Manifest, values: Values, moved: Mapping[str, float]) -> float:
    """Derivative of `Repetition.alike_from` along a direction of the values [s/unit]."""
    info, begin = timeline.driver_info(manifest), Repetition.of(manifest, values).alike_from
    if info is None or begin == 0.0:
        return 0.0
    start = moved.get(info.offset, 0.0) if info.offset else 0.0
    return (start - timeline.angle_slope(info, values, moved, begin)) / float(Turning.of(info, values).at(begin)[1])


def _tables(manifest: Manifest, values: Values) -> list[tuple[str, int]]:
    """Of each table over an angle: its turning, and the turns after which it repeats."""
    mechanism = manifest.mechanism
    geared = [] if mechanism is None else [("driver", mechanism.repeats)]
    if mechanism is not None and timeline.is_free(manifest):  # its tables are no inputs
        return [*geared, *mechanism.turns]
    return [*geared, *((item.turning, _turns_of(item, values)) for item in manifest.inputs if item.kind == "table")]


def _turns_of(item: InputInfo, values: Values) -> int:
    """Turns after which a table over an angle repeats: fewer than it has where its parts are alike."""
    if item.turns == 1:
        return 1
    angles, heights = timeline.table_knots(item, values)
    least, whole = 1e-12 * float(np.max(np.abs(heights))), item.turns * TURN
    for turns in range(1, item.turns):
        moved = np.concatenate([angles, angles + turns * TURN])
        apart = np.subtract(*(np.interp(moved + by * TURN, angles, heights, period=whole) for by in (0, turns)))
        if item.turns % turns == 0 and np.max(np.abs(apart)) <= least:
            return turns
    return item.turns


def _rates(manifest: Manifest, values: Values, tables: Sequence[tuple[str, int]]) -> Iterator[tuple[TurningInfo, Rate]]:
    for info in manifest.turnings:
        speed = abs(float(Turning.of(info, values).rate[-1]))
        turns = math.lcm(1, *(several for name, several in tables if name == info.name))
        alike = [one.offset for one in manifest.turnings if one.kind == "load" and one.rate == info.rate]
        if speed:
            parts = Fraction(1, turns) if turns > 1 else Fraction(info.parts)
            yield info, Rate(words=info.words, speed=speed, parts=parts, phases=dict.fromkeys(alike, 0.5 * TURN))


def _balls(manifest: Manifest, values: Values, speed: float) -> Iterator[Rate]:
    """Of bearings whose rings turn against each other, by what passes the outer one."""
    for bearing in manifest.bearings:
        if timeline.turns_steadily(bearing, values, speed):
            whose = f" of {bearing.name}" if bearing.name else ""
            yield Rate(
                words=f"balls passing the outer ring{whose}",
                speed=abs(values.get(f"{bearing.path}.outer_pass_speed", values[f"{bearing.path}.cage_speed"])),
                parts=Fraction(bearing.balls),
                phases={f"{bearing.path}.ball_angle": 0.5 * TURN / bearing.balls},
            )


def _changes(manifest: Manifest, values: Values) -> Iterator[tuple[float, float]]:
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
            behind = np.flatnonzero(np.diff(at) != 0.0)
            yield from zip(times[behind].tolist(), times[behind + 1].tolist(), strict=True)
