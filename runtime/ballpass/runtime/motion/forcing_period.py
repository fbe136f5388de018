"""After which time the equations of a model are the same again, found from what turns in them.

In: a model, its numbers, states of a motion.  Out: a `ForcingPeriod`.

Each phase that the equations depend on turns at its own rate.  Balls are alike, so that a cage need turn by whole ball
pitches only: a ball then stands where another stood.  Whether that holds, for one ball may differ from the others, is
seen from the accelerations at one state, now and a period later.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import product

import numpy as np

from ballpass.runtime.ask.parameter_range import ParameterRange
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import InputInfo, Manifest, TurningInfo
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.point.evaluate import point
from ballpass.runtime.ratings.of_bearing import bearing_words
from ballpass.runtime.report.numbers import rounded
from ballpass.runtime.request.request import Request
from ballpass.runtime.solution.simulate import simulate
from ballpass.runtime.solution.solution import Solution
from ballpass.runtime.time import timeline
from ballpass.runtime.time.repetition import EXACT, LARGEST_DENOMINATOR, Repetition, near_fraction
from ballpass.runtime.time.turning import STEP, TURN, Turning

#: Accelerations at one state a period apart, relative to the largest, that are the same [1].
SAME = 1e-6

#: Where in a range a period is compared beside its ends: the golden section, at which no ratio of speeds is one of
#: small numbers because it is so at both ends [1].
WITHIN_RANGE = 0.5 * (3.0 - math.sqrt(5.0))

#: Moments of a motion at which the equations are compared.
MOMENTS = 40

#: Change of a phase that shows whether the equations depend on it [rad].
NUDGE = 0.7


@dataclass(frozen=True, slots=True, kw_only=True)
class ForcingPeriod:
    """A period of the equations.

    Attributes
    ----------
    turning : what fixes the period
    count : turns of it in a period; a fraction where balls take each other's places
    words : what happens in a period
    difference : of the accelerations at one state a period apart, relative to the largest [1]
    """

    turning: TurningInfo
    count: Fraction | float
    words: str
    difference: float = 0.0

    def time(self, values: Mapping[str, float]) -> float:
        """The period for these numbers of the model [s]."""
        return float(self.count) * TURN / abs(_rate(self.turning, values))

    def slope(self, values: Mapping[str, float], moved: Mapping[str, float]) -> float:
        """Derivative of the period along a direction of the numbers [s/unit]."""
        rate = Turning.of(self.turning, timeline.along(values, moved)).rate[-1]
        return float(-self.time(values) * np.imag(rate) / STEP / np.real(rate))


def _rate(info: TurningInfo, values: Mapping[str, float]) -> float:
    """Rate of a turning behind its last row [rad/s]."""
    return float(Turning.of(info, values).rate[-1])


def refuse_free_driver(manifest: Manifest, question: str) -> None:
    """Refuse a scene where the driver's motion or a cage's lag is a state: no period."""
    if timeline.is_free(manifest):
        raise RequestError(
            f"{question}: a torque drives in this scene, and the driver's motion is a state. Allowed: a driver or "
            "shaft whose speed is given."
        )
    if any(coordinate.kind == "lag" for coordinate in manifest.coordinates):
        raise RequestError(
            f"{question}: the slip of a cage changes over time in this scene, and its lag is a state that no turn "
            "brings back. Allowed: a constant slip."
        )


def sampled_turns(model: LoadedModel, parameters: Mapping[str, float], turns: float = 1.0) -> Solution:
    """A run from the scene's start over so many turns that are alike, or a second where nothing turns, sampled at
    `MOMENTS` of them."""
    numbers = model.numbers(parameters)
    repetition = Repetition.of(model.manifest, numbers.values)
    begin = repetition.alike_from
    end = begin + (turns * repetition.turn if math.isfinite(repetition.turn) else 1.0)
    times = np.linspace(begin, end, MOMENTS)
    return simulate(model, numbers, Request(duration=end, times=times, outputs=[], transient_cycles=0.0))


def forcing_period(
    model: LoadedModel, numbers: Numbers, times: np.ndarray, states: np.ndarray, turns: float | None
) -> ForcingPeriod:
    """Find the shortest period of the equations, or check the one that is asked for.

    Parameters
    ----------
    times, states : moments of a motion, at which the equations are compared, shapes (moments,), (moments, states) [s]
    turns : the period that is asked for, of driver or shaft; None: find it

    Raises
    ------
    RequestError
        What turns has no common period, or nothing changes with time.
    """
    if turns is not None:
        driver = timeline.driver_info(model.manifest)
        if driver is None or _rate(driver, numbers.values) == 0.0:
            raise RequestError("turns: nothing turns in this scene. Leave it away.")
        asked = ForcingPeriod(turning=driver, count=turns, words=f"{turns:g} turns, as asked for")
        return _checked(model, numbers, times, states, asked)
    repetition = Repetition.of(model.manifest, numbers.values)
    among = _that_matter(model, numbers, times, states, repetition)
    if not among:
        raise RequestError(
            "steady: the equations do not change with time, so that they have no period. Look for a rest: "
            "ballpass linearize."
        )
    base, period = among[0], dict[TurningInfo, Fraction]()
    for info, turns_of_it in repetition.period(among).items():
        if turns_of_it is None:
            ratio = repetition.rates[info].speed / repetition.rates[base].speed
            raise RequestError(_two_periods(base.rate, info.rate, ratio))
        period[info] = turns_of_it
    parts = [repetition.rates[info].parts for info in among]
    # one ball that differs, or rings whose shapes turn with the balls, need more than a ball pitch
    for several in range(1, int(max(parts)) + 1):
        count = several * period[base]
        words = "; ".join(
            _turned(info, several * period[info], alike) for info, alike in zip(among, parts, strict=True)
        )
        words = bearing_words(words, model.manifest.bearings)
        found = _checked(model, numbers, times, states, ForcingPeriod(turning=base, count=count, words=words))
        if found.difference <= SAME:
            return found
    raise RequestError(
        f"steady: no period was found: after {float(count):g} turns of {base.rate} the accelerations at one state "
        f"differ by {rounded(100.0 * found.difference, 2)} %. Give the period yourself: turns."
    )


def common_period(
    model: LoadedModel,
    parameters: Mapping[str, float],
    over: Sequence[ParameterRange],
    sampled: Callable[[Mapping[str, float]], Solution],
) -> ForcingPeriod:
    """The shortest period of the equations that holds over ranges of parameters, by their corners and a point within.

    Parameters
    ----------
    parameters : overrides of others, SI
    sampled : gives the motion with these overrides, as `sampled_turns`: at states of another one no ball may touch

    Raises
    ------
    RequestError
        As for `forcing_period` at all corners, or no period holds between them.
    """
    shares = [*product((0.0, 1.0), repeat=len(over)), (WITHIN_RANGE,) * len(over)]
    given = [{**parameters, **{one.name: one.at(at) for one, at in zip(over, each, strict=True)}} for each in shares]
    judged = [(model.numbers(one), run.t, run.x) for one in given for run in (sampled(one),)]
    ends = [forcing_period(model, *one, None) for one in judged[:-1]]
    for found in ends:
        if all(_checked(model, *one, found).difference <= SAME for one in judged):
            return found
    raise RequestError(
        f"{' and '.join(one.name for one in over)}: at the first end {ends[0].words}, at the second {ends[-1].words}: "
        "no period holds between. Allowed: parameters that leave the ratio of the speeds as it is."
    )


def phase_drifts(
    model: LoadedModel, numbers: Numbers, times: np.ndarray, states: np.ndarray, every: float
) -> dict[str, float]:
    """What stands elsewhere after each time `every` [s], by its rate: the part of a turn, of a cage the part of a ball
    pitch, beyond whole ones.

    Parameters
    ----------
    times, states : as for `forcing_period`
    """
    repetition = Repetition.of(model.manifest, numbers.values)
    among = _that_matter(model, numbers, times, states, repetition)
    rounds = {info.rate: repetition.rates[info].frequency * every for info in among}
    return {rate: passed % 1.0 for rate, passed in rounds.items() if near_fraction(passed, 1, EXACT) is None}


def own_phases(model: LoadedModel, numbers: Numbers, times: np.ndarray, states: np.ndarray, every: float) -> list[str]:
    """What else turns than a bearing's cage and stands elsewhere after each time, as for `phase_drifts`."""
    alike = {info.rate for info in model.manifest.turnings if info.parts > 1}
    return [rate for rate in phase_drifts(model, numbers, times, states, every) if rate not in alike]


def _that_matter(
    model: LoadedModel, numbers: Numbers, times: np.ndarray, states: np.ndarray, repetition: Repetition
) -> list[TurningInfo]:
    """What turns that the equations depend on, driver or shaft first."""
    found: dict[TurningInfo, None] = {}
    for k, item in enumerate(model.manifest.inputs):
        if item.turning and item.kind not in ("angle", "rate", "slope"):
            info = timeline.info_of(model.manifest, item)
            if info in repetition.rates and _matters(model, numbers, times, states, k, item):
                found[info] = None
    return sorted(found, key=lambda info: info.kind != "driver")


def _matters(
    model: LoadedModel, numbers: Numbers, times: np.ndarray, states: np.ndarray, row: int, item: InputInfo
) -> bool:
    """Whether the equations depend on an input at any of the moments."""
    if item.kind != "phase":
        return True
    rhs = model.kernel("rhs")
    for t, x in zip(times.tolist(), states, strict=True):
        there = point(model, numbers, t, x)
        before = np.array(rhs(there))
        moved = np.array(there["u"])
        moved[row] += NUDGE
        if not np.array_equal(before, np.array(rhs({**there, "u": moved}))):
            return True
    return False


def _checked(
    model: LoadedModel, numbers: Numbers, times: np.ndarray, states: np.ndarray, period: ForcingPeriod
) -> ForcingPeriod:
    """The period with the difference that it leaves between accelerations at one state."""
    rhs, length = model.kernel("rhs"), period.time(numbers.values)
    first, later = (
        np.array(
            [np.array(rhs(point(model, numbers, t + after, x))) for t, x in zip(times.tolist(), states, strict=True)]
        )
        for after in (0.0, length)
    )
    largest = max(float(np.max(np.abs(first))), 1e-300)
    difference = float(np.max(np.abs(later - first))) / largest
    return replace(period, difference=difference)


def _turned(info: TurningInfo, turns: Fraction, alike: Fraction) -> str:
    name = info.rate if info.kind in ("pass", "spin", "load") else info.words
    if alike > 1 and turns.denominator > 1:
        pitches = turns * alike
        return f"{name} turns by {_count(pitches, 'ball pitch', 'ball pitches')}, balls renumbered by {pitches % alike}"
    return f"{name} makes {_count(turns, 'turn', 'turns')}"


def _count(number: Fraction, one: str, many: str) -> str:
    return f"{number} {one if number == 1 else many}"


def _two_periods(base: str, name: str, ratio: float) -> str:
    near = ", ".join(
        f"{one} (off by {abs(float(one) - ratio):.1e})"
        for one in dict.fromkeys(Fraction(ratio).limit_denominator(most) for most in (20, 200, 2000))
    )
    return (
        f"steady: {name} turns {ratio:.12g} times as fast as {base}, which is no fraction with a denominator up to "
        f"{LARGEST_DENOMINATOR}: the motion has two periods, and no state repeats. Near: {near}. Change a diameter so "
        "that it is one, or give the period that is near enough: turns. The closed curve on which the states lie: "
        "ballpass section; statistics: ballpass run --turns settle; stroboscopic values: ballpass bifurcation."
    )
