"""Contenders of a case at equal error: times, ratios to the stepper, and how far each figure can be trusted.

In: a file of part 1.  Out: `Compared`, which page and targets ask.

Every figure is made of medians over the parameter sets.  How much hangs on which sets were drawn is found by drawing
anew from them, with replacement, the same for all contenders (bootstrap; B. Efron, The Annals of Statistics 7 (1979)
1-26, DOI 10.1214/aos/1176344552).  The 10th and 90th percentile of what comes out stand beside a ratio.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from benchmarks.curves import Curve, basis, between, curve, measured, member_times, time_at, time_of

#: Draws of parameter sets, and the seed of their choice.
DRAWS = 200
SEED = 20261121

#: Contenders of which the best at an error counts as one.
GROUPS: Mapping[str, tuple[str, ...]] = {
    "hand-best": ("hand-rodas4", "hand-rodas5p", "hand-dp54"),
    "numpy-best": ("scipy-lsoda-numpy", "scipy-dop853-numpy", "scipy-radau-numpy"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """A time at an error.

    Attributes
    ----------
    time : median [s]
    low, high : 10th and 90th percentile over the visits, each of another parameter set [s]
    members, visits : fewest that a tolerance has on which the time rests
    """

    time: float
    low: float
    high: float
    members: int
    visits: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Ratio:
    """A ratio of two times at an error, with the 10th and 90th percentile over the draws of parameter sets [1]."""

    value: float
    low: float
    high: float

    def text(self) -> str:
        """The ratio with its spread, three digits."""
        return f"{self.value:.3g}× ({self.low:.3g} … {self.high:.3g})"


class Compared:
    """A case of part 1.

    Attributes
    ----------
    case : its file of results
    contenders : by key
    curves : (error, time) of each contender, medians
    """

    def __init__(self, case: dict[str, Any]) -> None:
        self.case = case
        self.contenders: dict[str, dict[str, Any]] = {c["key"]: c for c in case["contenders"]}
        self.curves: dict[str, Curve] = {key: curve(c) for key, c in self.contenders.items()}
        self._kept: dict[tuple[str, float], tuple[float, ...]] = {}

    def members_of(self, key: str) -> tuple[str, ...]:
        """Contenders behind a key: itself, or those of a group."""
        return tuple(one for one in GROUPS.get(key, (key,)) if one in self.curves)

    def best(self, key: str, level: float) -> str | None:
        """Which contender of a group is the fastest at an error; None where none reaches it."""
        times = {one: t for one in self.members_of(key) if (t := time_at(self.curves[one], level)) is not None}
        return min(times, key=lambda one: times[one]) if times else None

    def figure(self, key: str, level: float) -> Figure | None:
        """Time at an error; None where it is not reached."""
        best = self.best(key, level)
        if best is None:
            return None
        runs, shares = measured(self.contenders[best]), basis(self.curves[best], level)
        used = [runs[k] for k, _ in shares]
        low, high = (between([float(np.percentile(run["times"], q)) for run in runs], shares) for q in (10, 90))
        return Figure(
            time=between([time_of(run) for run in runs], shares),
            low=low,
            high=high,
            members=min(len(run["errors"]) for run in used),
            visits=min(len(run["times"]) for run in used),
        )

    def ratio(self, over: str, under: str, level: float) -> Ratio | None:
        """Time of one over that of another at an error; None where one of them does not reach it."""
        first, second = self.figure(over, level), self.figure(under, level)
        if first is None or second is None:
            return None
        drawn = np.array(self._drawn(over, level)) / np.array(self._drawn(under, level))
        drawn = drawn[np.isfinite(drawn)]
        value = first.time / second.time
        low, high = np.percentile(drawn, [10, 90]) if drawn.size else (value, value)
        return Ratio(value=value, low=float(low), high=float(high))

    def _drawn(self, key: str, level: float) -> tuple[float, ...]:
        """Times at an error for each draw of parameter sets [s]; nan where it is not reached with it."""
        found = np.array([self._drawn_alone(one, level) for one in self.members_of(key)])
        return tuple(np.fmin.reduce(found, axis=0))

    def _drawn_alone(self, key: str, level: float) -> tuple[float, ...]:
        if (key, level) not in self._kept:
            taken = [time_at(points, level) for points in self._drawn_curves[key]]
            self._kept[key, level] = tuple(math.nan if t is None else t for t in taken)
        return self._kept[key, level]

    @cached_property
    def _drawn_curves(self) -> dict[str, list[list[tuple[float, float]]]]:
        """A curve of each contender for each draw."""
        members = int(self.case["members"])
        draws = np.random.default_rng(SEED).integers(0, members, (DRAWS, members))
        found = {}
        for key, contender in self.contenders.items():
            medians = [_medians(run, draws) for run in measured(contender)]
            found[key] = [[(e[k], t[k]) for e, t in medians] for k in range(DRAWS)]
        return found


def _medians(run: dict[str, Any], draws: np.ndarray) -> tuple[list[float], list[float]]:
    """Medians of errors and times over each draw, shape (draws, members); who has fewer members is drawn from these."""
    found = []
    for values in (np.array(run["errors"]), np.array(member_times(run))):
        found.append(np.median(values[draws % len(values)], axis=1).tolist())
    return found[0], found[1]
