"""Values of quantities for many changed parameter sets at once: what difference quotients are made of.

In: changes of parameters.  Out: values, shape (runs, quantities).  Extremes, means and rms of the channels that the
driver reduces are observables of an ensemble.  All others, as values at an angle, amplitudes and outputs that are no
channels, are taken along nodes, one run at a time in each thread.

Steps end on the kinks of the laws: stepped over, they leave a thousand times the noise in the values.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.ask.panels import ROUGH
from ballpass.runtime.ask.quantity_records import Quantity
from ballpass.runtime.ask.study import Span, Study
from ballpass.runtime.ask.track import Stepping
from ballpass.runtime.contract.errors import RequestError, SimulationError
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.many.ensemble import simulate_many
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.stepper import METHODS, Family
from ballpass.runtime.point.evaluate import neighbour
from ballpass.runtime.run.locating import LOCATED
from ballpass.runtime.run.reductions import channel_names

Array = NDArray[np.float64]

#: Tolerance of the states.
RTOL = 1e-11

#: Kinds of quantities that are observables of an ensemble as well.
REDUCED = ("max", "min", "range", "mean", "rms")

#: Nodes in a turn, and roughness of a panel, relative to those of the derivatives' own run, which are not to be shared.
NODES, ROUGHNESS = 1.3, 0.3


def reduced_by_ensembles(model: LoadedModel, quantities: Sequence[Quantity]) -> dict[int, str]:
    """Quantities, by their place, that are observables of an ensemble as well, and are as near there: their names."""
    channels = channel_names(model.manifest) if model.states else ()
    return {
        k: f"{item.kind}:{item.channel}"
        for k, item in enumerate(quantities)
        if item.kind in REDUCED
        and item.ball is None
        and item.channel in channels
        # the most loaded ball carries least where two change rank, which the driver's steps do not end on
        and (item.channel in model.states or item.kind in ("max", "mean", "rms"))
    }


class MemberRuns:
    """Quantities of runs beside a run.

    Parameters
    ----------
    model, numbers : the model and the run's numbers
    quantities, span : what is asked for, and how long to run
    family : of the stepper
    per_turn, magnitude : nodes in a turn and magnitudes of the states in the run itself
    closer : take what the balls carry along nodes too: slower, but integrals are cut where balls change rank
    progress : told the finished part of each call
    """

    def __init__(
        self,
        model: LoadedModel,
        numbers: Numbers,
        quantities: Sequence[Quantity],
        span: Span,
        *,
        family: Family,
        per_turn: int,
        magnitude: Array,
        closer: bool = False,
        progress: Callable[[float], None] = lambda _done: None,
    ) -> None:
        self._model, self._numbers, self._span, self._progress = model, numbers, span, progress
        self._stepping = Stepping(family=family, rtol=RTOL, magnitude=magnitude, kinks=LOCATED)
        self._count = len(quantities)
        self._reduced = reduced_by_ensembles(model, quantities)
        if closer:
            self._reduced = {
                k: name
                for k, name in self._reduced.items()
                if quantities[k].channel in model.states or quantities[k].kind == "max"
            }
        # steps do not end where two balls change rank; the shorter ones of a lower order take less noise from there
        ranked = any(item.kind in ("mean", "rms") and item.channel not in model.states for item in quantities)
        self._family = Family.DP54 if ranked and family is Family.DOP853 else family
        self._others = {k: item for k, item in enumerate(quantities) if k not in self._reduced}
        self._study = Study(model, list(self._others.values()), span, int(NODES * per_turn), rough=ROUGHNESS * ROUGH)
        self._study.fix(numbers, self._stepping)

    def __call__(self, changes: Sequence[Mapping[str, float]]) -> Array:
        """Values of all quantities for each change; NaN beyond what can be simulated."""
        found = np.full((len(changes), self._count), np.nan)
        if self._reduced:
            values = simulate_many(
                self._model,
                [{**self._numbers.parameters, **change} for change in changes],
                list(dict.fromkeys(self._reduced.values())),
                cycles=self._span.cycles,
                duration=self._span.duration,
                transient=self._span.transient,
                rtol=RTOL,
                method=next(name for name, family in METHODS.items() if family is self._family),
                kinks=LOCATED,
                threads=None,
                lanes=True,
                progress=self._progress,
                bounded=False,
            )
            if values.interrupted:
                raise KeyboardInterrupt
            for k, name in self._reduced.items():
                found[:, k] = values[name]
        if self._others:
            with ThreadPoolExecutor(os.cpu_count()) as threads:
                for k, one in enumerate(threads.map(self._along_nodes, changes)):
                    found[k, list(self._others)] = one
                    self._progress((k + 1) / len(changes))
        return found

    def _along_nodes(self, change: Mapping[str, float]) -> list[float]:
        try:
            course = self._study.measure(neighbour(self._model, self._numbers, change), self._stepping)
        except (RequestError, SimulationError):
            return [np.nan] * len(self._others)
        return [item.value for item in course.estimates]
