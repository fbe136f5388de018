"""Largest Lyapunov exponent by tangents, with an interval; what kind of motion it speaks for.

In: a model, numbers, a state, a time between readings.  Out: `Exponent`, stroboscopic states.

A tangent is carried along and made of length one again after every reading, so that nothing overflows in a motion that
repels and nothing sinks into rounding in one that attracts.  Where readings repeat, each period gives the exponent by
its multipliers instead: a tangent that turns, or that grows elsewhere than it shrinks, grows unevenly for ever.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from scipy.stats import t as student

from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.request.request import Request
from ballpass.runtime.request.start import RunEnd
from ballpass.runtime.solution.sensitivity import sensitivities

#: Readings until the tangent has turned into the direction that grows most.
ALIGN = 5

#: Batches of readings, whose means are taken for independent, and confidence of the interval.
BATCHES, CONFIDENCE = 10, 0.95

#: Longest period that is recognized, in readings: the paper's press repeats after 134 turns.
LONGEST = 200

#: Readings that repeat, in shares of the magnitudes [1].
REPEATED = 1e-4

#: Distance of a drift from a fraction that it is [1].
WHOLE = 1e-9

#: Smallest growth of which there is a logarithm [1].
TINY = float(np.finfo(float).tiny)

#: Half widths of the interval by which growth lies above zero where it is called chaos: that of 60 readings of a
#: transient that ends on a periodic motion lies above zero by one to two.
CERTAIN = 2.0

#: Half an interval about zero that is short enough to say that nothing grows, per reading [1].
NARROW = 0.02

#: What largest exponents are, for people.
EXPONENT_WORDS = (
    "Largest exponent, of Lyapunov: the logarithm of how much a small disturbance grows from one reading to the next. "
    "Below zero it dies out; above zero the motion is chaotic."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Exponent:
    """Growth of a small disturbance, per time between readings.

    Attributes
    ----------
    mean : natural logarithm of the growth [1]
    half : half of the interval that holds it with the confidence of `CONFIDENCE` [1]
    """

    mean: float
    half: float

    @property
    def low(self) -> float:
        return self.mean - self.half

    @property
    def high(self) -> float:
        return self.mean + self.half

    @property
    def chaotic(self) -> bool:
        """Whether an interval of `CERTAIN` times its width lies above zero: growth on transients is not stationary."""
        return self.mean > CERTAIN * self.half

    @property
    def words(self) -> str:
        """The number for people."""
        return f"{self.mean:.3g} ± {self.half:.2g}"


def largest_exponent(
    flows: np.ndarray, states: np.ndarray, magnitude: np.ndarray, drifts: Collection[float] = ()
) -> Exponent:
    """Exponent of a motion from what `strobe_with_tangents` gives: by multipliers where it repeats, else by growth.

    Parameters
    ----------
    drifts : as for `exponent_of`
    """
    if period := period_of(states, magnitude):
        ends = range(len(flows), ALIGN, -period)
        return _interval(
            np.array([_largest_multiplier(flows[end - period : end]) / period for end in ends if end - period >= ALIGN])
        )
    direction = np.ones(len(magnitude)) / np.sqrt(len(magnitude))
    growth = []
    for flow in flows:
        grown = flow @ direction
        size = float(np.linalg.norm(grown))
        # a disturbance below the smallest number has no direction: any one will do
        direction = grown / size if size > 0.0 else direction
        growth.append(np.log(max(size, TINY)))
    return exponent_of(np.array(growth[ALIGN:]), drifts)


def _largest_multiplier(flows: np.ndarray) -> float:
    """Logarithm of the largest eigenvalue of a product, whose factors follow each other in time."""
    product, logarithm = np.eye(flows.shape[1]), 0.0
    for flow in flows:
        product = flow @ product
        size = max(float(np.linalg.norm(product)), TINY)
        product, logarithm = product / size, logarithm + np.log(size)
    return float(logarithm + np.log(max(float(np.max(np.abs(np.linalg.eigvals(product)))), TINY)))


def exponent_of(growth: np.ndarray, drifts: Collection[float] = ()) -> Exponent:
    """Mean of the growth at each reading, and its interval by batch means: readings in a row are not independent.

    Parameters
    ----------
    growth : shape (readings,)
    drifts : parts of a round by which phases of the equations move from reading to reading: growth follows them, and is
        no scatter as far as one harmonic of each describes it
    """
    readings = np.arange(len(growth))
    # a phase that has not been everywhere is not known from the mean
    around = [drift for drift in drifts if min(drift, 1.0 - drift) * len(growth) >= 1.0]
    angles = 2.0 * np.pi * np.multiply.outer(readings, around)
    waves = np.column_stack([np.ones(len(growth)), np.cos(angles), np.sin(angles)])
    mean, *heights = np.linalg.lstsq(waves, growth)[0]
    left = growth - waves[:, 1:] @ np.array(heights)
    batches = np.array([batch.mean() for batch in np.array_split(left, BATCHES)])
    half = _interval(batches).half / np.sqrt(1.0 - len(heights) / len(growth))
    return Exponent(mean=float(mean), half=float(half))


def _interval(parts: np.ndarray) -> Exponent:
    """Mean of independent parts of one length, and its interval by Student."""
    half = student.ppf(0.5 + CONFIDENCE / 2.0, len(parts) - 1) * parts.std(ddof=1) / np.sqrt(len(parts))
    return Exponent(mean=float(parts.mean()), half=float(half))


def strobe_with_tangents(
    model: LoadedModel,
    numbers: Numbers,
    begin: RunEnd,
    step: float,
    readings: int,
    magnitude: np.ndarray,
    rtol: float,
    each: Callable[[], None],
) -> tuple[np.ndarray, np.ndarray]:
    """States after each time step, shape (readings, states), and by those before, in shares of the magnitudes, shape
    (ALIGN + readings, states, states): a tangent turns into the direction that grows most in the first of these.

    Parameters
    ----------
    each : called at each reading

    Raises
    ------
    IntegrationError
        A run failed.
    """
    names = list(model.manifest.initial)
    states, flows = np.empty((ALIGN + readings, len(names))), np.empty((ALIGN + readings, len(names), len(names)))
    for k in range(ALIGN + readings):
        each()
        request = Request(duration=step, initial=begin, samples_per_cycle=1, outputs=[], rtol=rtol)
        found = sensitivities(model, numbers, request, names)
        states[k], flows[k] = found.solution.x[-1], found.x[-1] * magnitude / magnitude[:, None]
        begin = found.solution.end
    return states[ALIGN:], flows


def changes_after(states: np.ndarray, magnitude: np.ndarray, period: int) -> np.ndarray:
    """What so many readings change, in shares of the magnitudes, shape (readings - period,)."""
    return np.asarray(np.max(np.abs((states[period:] - states[:-period]) / magnitude), axis=1))


def period_of(states: np.ndarray, magnitude: np.ndarray, longest: int = LONGEST) -> int:
    """Readings after which states are there again; 0 where they are more than `longest`."""
    for period in range(1, min(longest, len(states) // 2) + 1):
        if np.max(changes_after(states, magnitude, period)) < REPEATED:
            return period
    return 0


def common_round(drifts: Collection[float]) -> int:
    """Readings after which phases are there again that move by these parts of a round; 0 for more than `LONGEST`."""
    near = [Fraction(drift).limit_denominator(LONGEST) for drift in drifts]
    if any(abs(float(one) - drift) > WHOLE for one, drift in zip(near, drifts, strict=True)):
        return 0
    rounds = math.lcm(*(one.denominator for one in near))
    return rounds if rounds <= LONGEST else 0


def kind_of_motion(
    states: np.ndarray, magnitude: np.ndarray, exponent: Exponent | None, drifts: Collection[float], *, forced: bool
) -> tuple[str, str]:
    """Periodic, quasi-periodic, chaotic or undecided; and what would decide.

    Parameters
    ----------
    drifts : as for `exponent_of`: a motion that contracts repeats when all phases do, and not before
    forced : whether the equations are the same at each reading; if not, they have a second period of their own
    """
    period = period_of(states, magnitude)
    if exponent is None:
        return (f"periodic {period}", "") if period else ("undecided", "the exponent, left out by --no-exponent")
    if exponent.chaotic:
        return "chaotic", ""
    if exponent.high < 0.0 and not forced:
        period = period or common_round(drifts)
        return f"periodic {period}" if period else "quasi-periodic", ""
    if exponent.high < 0.0:
        settling = "more --settling, for the motion contracts and does not repeat yet"
        return (f"periodic {period}", "") if period else ("undecided", settling)
    if not period and exponent.half < NARROW:
        return "quasi-periodic", ""
    return (
        "undecided",
        "more --readings, for the interval of the exponent holds zero, or would if it were twice as wide",
    )
