"""Fits by class: deviations of shafts, housings and rings, and the spread of interference and clearance.

In: classes ("k6", "H7"), diameters, roughness.  Out: least, probable and largest interferences and clearances [m].
Sources: ISO 286-1 and -2 (tolerances, deviations), ISO 492 (rings of class Normal), DIN 7190-1:2017 (roughness).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Literal

#: Classes of the table below; it has neither j7 nor J8.
_LETTERS = ("g", "h", "j", "js", "k", "m", "n", "p")
SHAFTS = tuple(f"{letter}{grade}" for letter in _LETTERS for grade in "567" if letter + grade != "j7")
HOUSINGS = tuple(f"{letter.upper()}{grade}" for letter in _LETTERS for grade in "678" if letter + grade != "j8")

#: Part of the sum of both surfaces' Rz by which pressing smooths a fit (DIN 7190-1:2017; earlier editions: 0.8) [1].
SMOOTHING = 0.4

#: Diameters [mm] of the table, above the first and up to the last.
RANGE = (3.0, 180.0)

#: Steps of the diameter up to `to` [mm], and in µm: IT5 to IT8 of ISO 286-1; fundamental deviations of ISO 286-2, of
#: shafts the upper one of g and the lower ones of j, k, m, n and p, of housings the upper ones of J6 and J7; the
#: tolerances of `bore` and `outside` diameter, below the nominal one, of ISO 492, class Normal.  None: not known here.
_HEADS = ("to", "5", "6", "7", "8", "g", "j", "k", "m", "n", "p", "J6", "J7", "bore", "outside")
_STEPS: tuple[tuple[int | None, ...], ...] = (
    (6, 5, 8, 12, 18, -4, -2, 1, 4, 8, 12, None, None, 8, 8),
    (10, 6, 9, 15, 22, -5, -2, 1, 6, 10, 15, 5, 8, 8, 8),
    (18, 8, 11, 18, 27, -6, -3, 1, 7, 12, 18, 6, 10, 8, 8),
    (30, 9, 13, 21, 33, -7, -4, 2, 8, 15, 22, 8, 12, 10, 9),
    (50, 11, 16, 25, 39, -9, -5, 2, 9, 17, 26, 10, 14, 12, 11),
    (80, 13, 19, 30, 46, -10, -7, 2, 11, 20, 32, 13, 18, 15, 13),
    (120, 15, 22, 35, 54, -12, -9, 3, 13, 23, 37, 16, 22, 20, 15),
    (150, 18, 25, 40, 63, -14, None, 3, 15, 27, 43, 18, 26, 25, 18),
    (180, 18, 25, 40, 63, -14, None, 3, 15, 27, 43, 18, 26, 25, 25),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """A length within limits, with mean and standard deviation [m]."""

    least: float
    largest: float
    mean: float
    deviation: float

    @classmethod
    def within(cls, least: float, largest: float, *others: tuple[float, float]) -> Spread:
        """Sum of parts within limits, each with its tolerance as six standard deviations."""
        parts = [(least, largest), *others]
        low, high = (sum(part[k] for part in parts) for k in (0, 1))
        deviation = math.hypot(*(part[1] - part[0] for part in parts)) / 6.0
        return cls(least=low, largest=high, mean=(low + high) / 2.0, deviation=deviation)

    @property
    def five(self) -> tuple[float, ...]:
        """Least, lowest probable, mean, highest probable, largest; probable is within three standard deviations."""
        low, high = self.mean - 3.0 * self.deviation, self.mean + 3.0 * self.deviation
        return self.least, max(self.least, low), self.mean, min(self.largest, high), self.largest

    @property
    def pressed(self) -> Spread:
        """The same of what is above zero: play presses nothing.  Moments of a normal distribution cut at zero."""
        mean, deviation = self.mean, self.deviation
        if self.least < 0.0 and deviation > 0.0:
            normal = NormalDist(mean, deviation)
            above, density = 1.0 - normal.cdf(0.0), deviation**2 * normal.pdf(0.0)
            square = (mean**2 + deviation**2) * above + mean * density
            mean = mean * above + density
            deviation = math.sqrt(max(square - mean**2, 0.0))
        return Spread(least=max(self.least, 0.0), largest=max(self.largest, 0.0), mean=mean, deviation=deviation)


def shaft_deviations(name: str, diameter: float) -> tuple[float, float]:
    """Lower and upper deviation of a shaft of a class, as "k6" [m].

    Raises
    ------
    ValueError
        The table has no such class for this diameter [m].
    """
    letter, width = name[:-1], _number(name[-1], diameter)
    if letter == "js":
        return -width / 2.0, width / 2.0
    if letter in ("g", "h"):
        upper = _number("g", diameter) if letter == "g" else 0.0
        return upper - width, upper
    lower = _number(letter, diameter)
    return lower, lower + width


def housing_deviations(name: str, diameter: float) -> tuple[float, float]:
    """Lower and upper deviation of the bore of a housing of a class, as "H7" [m].

    K, M, N (to IT8) and P (to IT7) follow from the shafts by the rule ES = -ei + IT_n - IT_(n-1) of ISO 286-1.

    Raises
    ------
    ValueError
        The table has no such class for this diameter [m].
    """
    letter, grade = name[:-1], name[-1]
    width = _number(grade, diameter)
    if letter == "JS":
        return -width / 2.0, width / 2.0
    if letter in ("G", "H"):
        lower = -_number("g", diameter) if letter == "G" else 0.0
        return lower, lower + width
    if letter == "J":
        upper = _number(name, diameter)
    else:
        finer = 0.0 if name == "P8" else width - _number(str(int(grade) - 1), diameter)
        upper = finer - _number(letter.lower(), diameter)
    return upper - width, upper


def ring_deviations(diameter: float, kind: Literal["bore", "outside"]) -> tuple[float, float]:
    """Lower and upper deviation of a bearing's bore or outside diameter, ISO 492, class Normal [m]."""
    return -_number(kind, diameter), 0.0


def seat_interference(name: str, diameter: float, roughness: float = 0.0) -> Spread:
    """Interference of a ring of class Normal with a shaft or housing of a class [m]; `ValueError` as above."""
    if name in SHAFTS:
        return interference(shaft_deviations(name, diameter), ring_deviations(diameter, "bore"), roughness)
    return interference(ring_deviations(diameter, "outside"), housing_deviations(name, diameter), roughness)


def interference(inner: Sequence[float], outer: Sequence[float], roughness: float = 0.0) -> Spread:
    """Interference of an inner part in an outer one by their deviations, after smoothing [m].

    Parameters
    ----------
    roughness : sum of Rz of both surfaces [m]
    """
    smoothed = SMOOTHING * roughness
    return Spread.within(inner[0] - smoothed, inner[1] - smoothed, (-outer[1], -outer[0]))


def operating_clearance(group: Sequence[float], pressed: Sequence[tuple[Spread, float]], lost: float) -> Spread:
    """Clearance in operation by the limits of its group, interferences, and what temperatures take [m].

    Parameters
    ----------
    pressed : interferences, and the clearance that each takes for its length [1]
    """
    free = Spread.within(group[0], group[1])
    taken = [(spread.pressed, rate) for spread, rate in pressed]
    return Spread(
        least=free.least - lost - sum(rate * spread.largest for spread, rate in taken),
        largest=free.largest - lost - sum(rate * spread.least for spread, rate in taken),
        mean=free.mean - lost - sum(rate * spread.mean for spread, rate in taken),
        deviation=math.hypot(free.deviation, *(rate * spread.deviation for spread, rate in taken)),
    )


def _number(head: str, diameter: float) -> float:
    """A number of the table for a diameter [m]."""
    millimetres = round(1e3 * diameter, 9)
    steps = [step for step in _STEPS if step[0] is not None and millimetres <= step[0]]
    found = steps[0][_HEADS.index(head)] if steps and millimetres > RANGE[0] else None
    if found is None:
        raise ValueError(f"the tables of fits have no such class for a diameter of {millimetres:g} mm")
    return found / 1e6
