"""A goal and limits over ranges of parameters, each the worst of all deviations within tolerances.

In: a model, quantities, ranges, tolerances.  Out: values in lanes, tangent planes for `bundle`, a check of the slopes.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from scipy.stats.qmc import Halton

from ballpass.runtime.ask.kept_parts import KeptParts
from ballpass.runtime.ask.limits import Limit
from ballpass.runtime.ask.parameter_range import ParameterRange
from ballpass.runtime.certify.quantity_function import QuantityFunction
from ballpass.runtime.contract.defaults import OPTIMUM_RTOL
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.search.bundle import BundleMinimum, Plane

#: Points within the tolerances, beside their corners, of which the worst is taken; further ones that check it.
WITHIN, FURTHER = 15, 256

#: Distance from a kink at which its slopes are verified, in shares of the range [1].
BESIDE = 5e-3

#: Slopes of the search and of the check agree within this share [1].
AGREES = 1e-3


class WorstValues:
    """Goal and limits as functions of shares of the ranges, 0 to 1.

    In planes they are scaled to the order of one, and limits are kept where they are not above 0.

    Parameters
    ----------
    goal : quantity to make least, or largest
    limits : of other quantities
    vary, box : ranges of what is varied, and of the deviations

    Attributes
    ----------
    runs : of a point, one for each deviation
    decides : what decides the values beside the model, for parts that are kept
    sizes : of goal and limits, SI, known after `candidates`; below zero of a goal to make largest
    """

    def __init__(
        self,
        model: LoadedModel,
        goal: str,
        limits: Sequence[Limit],
        vary: Sequence[ParameterRange],
        box: Sequence[ParameterRange],
        *,
        largest: bool,
        cycles: float | None,
        transient: float | None,
        parameters: Mapping[str, float] | None,
    ) -> None:
        self._goal, self._limits, self._vary, self._box = goal, limits, vary, box
        names = list(dict.fromkeys([goal, *(one.quantity for one in limits)]))
        self._names = list(dict.fromkeys(one.name for one in (*vary, *box)))
        function = partial(
            QuantityFunction,
            model,
            names,
            self._names,
            cycles,
            transient=transient,
            parameters=parameters,
            rtol=OPTIMUM_RTOL,
        )
        self._lanes, self._tried, self._exact = function(), function(failed="nan"), function(kinks="located")
        self._columns = [0, *(names.index(one.quantity) for one in limits)]
        self._signs = np.array([1.0, *(one.sign for one in limits)])
        self._offsets = np.array([0.0, *(one.limit for one in limits)])
        self._deviations = self._all_deviations()
        self.runs = len(self._deviations)
        self._ways = np.array([-1.0 if largest else 1.0, *(1.0 for _ in limits)])
        self.decides = (largest, names, self._names, cycles, transient, parameters, OPTIMUM_RTOL, self._deviations)
        self.sizes = np.ones(len(self._columns))

    def candidates(self, shares: np.ndarray, parts: KeptParts) -> np.ndarray:
        """Merits of points, which also give the sizes, shape (points,); infinite where a run fails.

        Raises
        ------
        SimulationError
            All runs failed.
        """
        (found,) = parts.once(shares, lambda: (self._tried(np.array([self._rows(share) for share in shares])),))
        known = np.isfinite(found).all(axis=(1, 2))
        if not known.any():
            self._lanes(self._rows(shares[0]))  # fails, and says why
        scaled = self._signs * (found[..., self._columns] - self._offsets)
        seen = np.median(np.abs(found[known][..., self._columns]), axis=(0, 1))
        # a limit of zero has no size of its own
        limits = (abs(one.limit) or size for one, size in zip(self._limits, seen[1:].tolist(), strict=True))
        self.sizes = self._ways * np.maximum([seen[0], *limits], 1e-300)
        worst = (scaled / self.sizes).max(axis=1)
        merits = [Plane(x=s, values=v, slopes=v).merit for s, v in zip(shares, worst, strict=True)]
        return np.where(known, merits, np.inf)

    def plane(self, share: np.ndarray, parts: KeptParts) -> Plane:
        """Values and exact slopes at a point."""
        values, slopes = parts.once(share, lambda: self._exactly(share))
        size = (self._signs / self.sizes)[:, None]
        return Plane(
            x=share,
            values=self._signs * (values - self._offsets) / self.sizes,
            slopes=size * slopes * self.by_share(share),
        )

    def by_share(self, share: np.ndarray) -> np.ndarray:
        """Derivatives of the varied parameters by their shares."""
        return np.array([one.slope(float(s)) for one, s in zip(self._vary, share, strict=True)])

    def at(self, share: np.ndarray) -> np.ndarray:
        """Values of the varied parameters, SI."""
        return np.array([one.at(float(s)) for one, s in zip(self._vary, share, strict=True)])

    def worst_deviations(self, share: np.ndarray) -> tuple[float, ...]:
        """Deviations at which the goal is worst, SI, one for each tolerance."""
        worst = self._deviations[self._worst(share)[0]]
        return tuple(float(worst[self._names.index(one.name)]) for one in self._box)

    def without_deviations(self, share: np.ndarray) -> float:
        """The goal at no deviation [its unit]."""
        return float(self._exact(self._rows(share)[0])[0])

    def worst_of_further(self, share: np.ndarray) -> float:
        """The worst goal at points of the box that the search does not see [its unit]."""
        spread = Halton(len(self._box), scramble=False).random(FURTHER + WITHIN + 1)[WITHIN + 1 :]
        found = self._lanes(self._rows(share)[0] + self._placed(spread))[:, 0]
        return float(self._ways[0] * np.max(self._ways[0] * found))

    def verdicts(self, least: BundleMinimum) -> dict[str, str]:
        """Check of the goal's slopes by a second route, by parameter; beside a kink on each of its sides."""
        found: dict[str, str] = {}
        for side in least.sides:
            there = least.best.x
            if len(least.sides) > 1:
                away = side.x - there
                there = np.clip(there + BESIDE * away / max(float(np.max(np.abs(away))), 1e-300), 0.0, 1.0)
            row = self._rows(there)[self._worst(there)[0]]
            taken = self._exact.jacobian(row)[0]
            for pair in self._exact.certify(row, progress=False).pairs:
                if pair.quantity != self._goal or pair.parameter not in self._names[: len(self._vary)]:
                    continue
                slope = float(taken[self._names.index(pair.parameter)])
                agrees = abs(slope - pair.by_steps) <= AGREES * abs(slope)
                if found.get(pair.parameter) != "disagrees":
                    found[pair.parameter] = pair.check.verdict.value if agrees else "disagrees"
        return found

    def _rows(self, share: np.ndarray) -> np.ndarray:
        """Values of all parameters with each deviation, the first with none."""
        x = self._exact.start.copy()
        x[: len(self._vary)] = self.at(share)
        found: np.ndarray = x + self._deviations
        return found

    def _worst(self, share: np.ndarray) -> np.ndarray:
        """The deviation with the worst value of goal and each limit."""
        if len(self._deviations) == 1:
            return np.zeros(len(self._columns), dtype=int)
        found: np.ndarray = np.argmax(
            self._ways * self._signs * self._lanes(self._rows(share))[:, self._columns], axis=0
        )
        return found

    def _exactly(self, share: np.ndarray) -> tuple[np.ndarray, ...]:
        which = self._worst(share)
        rows, place = np.unique(which, return_inverse=True)
        x = self._rows(share)[rows]
        slopes = self._exact.jacobian(x)[place, self._columns, : len(self._vary)]
        return self._exact(x)[place, self._columns], slopes

    def _all_deviations(self) -> np.ndarray:
        """Of all parameters: none, the corners of the box, and points within, shape (points, parameters)."""
        none = np.zeros((1, len(self._names)))
        if not self._box:
            return none
        corners = np.array(list(itertools.product((0.0, 1.0), repeat=len(self._box))))
        within = Halton(len(self._box), scramble=False).random(WITHIN + 1)[1:]
        return np.concatenate([none, self._placed(np.concatenate([corners, within]))])

    def _placed(self, shares: np.ndarray) -> np.ndarray:
        """Deviations of all parameters from shares of the box."""
        found = np.zeros((len(shares), len(self._names)))
        for one, column in zip(self._box, shares.T, strict=True):
            found[:, self._names.index(one.name)] = one.low + column * (one.high - one.low)
        return found
