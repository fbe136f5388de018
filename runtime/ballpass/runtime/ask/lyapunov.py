"""Largest Lyapunov exponent by tangents, with an interval from batch means; what kind of motion it speaks for.

In: a model, numbers, a state, a time between readings.  Out: `Exponent`, stroboscopic states.

A tangent is carried along and made of length one again after every reading, so that nothing overflows in a motion that
repels and nothing sinks into rounding in one that attracts.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.run.request import Request
from ballpass.runtime.run.sensitivity import sensitivities
from ballpass.runtime.run.start import RunEnd

#: Readings until the tangent has turned into the direction that grows most.
ALIGN = 5

#: Batches of readings, whose means are taken for independent, and confidence of the interval.
BATCHES, CONFIDENCE = 10, 0.95

#: Longest period that is recognized, in readings.
LONGEST = 16

#: Readings that repeat, in shares of the magnitudes [1].
REPEATED = 1e-4

#: Half an interval about zero that is short enough to say that nothing grows, per reading [1].
NARROW = 0.02


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
    spread = batches.std(ddof=1) / np.sqrt(1.0 - len(heights) / len(growth))
    half = student.ppf(0.5 + CONFIDENCE / 2.0, BATCHES - 1) * spread / np.sqrt(BATCHES)
    return Exponent(mean=float(mean), half=float(half))


def strobe_with_tangent(
    model: LoadedModel,
    numbers: Numbers,
    begin: RunEnd,
    step: float,
    readings: int,
    magnitude: np.ndarray,
    rtol: float,
    each: Callable[[], None],
) -> tuple[np.ndarray, np.ndarray]:
    """States after each time step, shape (readings, states), and growth of a disturbance in each, shape (readings,).

    Parameters
    ----------
    each : called at each reading

    Raises
    ------
    IntegrationError
        A run failed.
    """
    names = list(model.manifest.initial)
    direction = np.ones(len(names)) / np.sqrt(len(names))
    states, growth = np.empty((readings, len(names))), np.empty(readings)
    for k in range(-ALIGN, readings):
        each()
        request = Request(duration=step, initial=begin, samples_per_cycle=1, outputs=[], rtol=rtol)
        found = sensitivities(model, numbers, request, names)
        grown = (found.x[-1] @ (direction * magnitude)) / magnitude
        size = float(np.linalg.norm(grown))
        # a disturbance below the smallest number has no direction: any one will do
        direction = grown / size if size > 0.0 else direction
        begin = found.solution.end
        if k >= 0:
            states[k], growth[k] = found.solution.x[-1], np.log(max(size, np.finfo(float).tiny))
    return states, growth


def period_of(states: np.ndarray, magnitude: np.ndarray) -> int:
    """Readings after which states are there again; 0 where that is more than `LONGEST`."""
    shares = states / magnitude
    for period in range(1, min(LONGEST, len(shares) // 2) + 1):
        if np.max(np.abs(shares[period:] - shares[:-period])) < REPEATED:
            return period
    return 0


def kind_of_motion(states: np.ndarray, magnitude: np.ndarray, exponent: Exponent | None, *, forced: bool) -> str:
    """Periodic, quasi-periodic, chaotic or undecided.

    Parameters
    ----------
    forced : whether the equations are the same at each reading; if not, they have a second period of their own
    """
    period = period_of(states, magnitude)
    if exponent is not None and exponent.low > 0.0:
        return "chaotic"
    if period and (exponent is None or exponent.high < 0.0):
        return f"periodic {period}"
    if exponent is None:
        return "undecided"
    if exponent.high < 0.0:
        return "undecided" if forced else "quasi-periodic"
    return "quasi-periodic" if exponent.half < NARROW else "undecided"
