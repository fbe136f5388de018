"""Values of quantities for many changed parameter sets at once, for difference quotients.

In: changes of parameters.  Out: values, shape (runs, quantities).  Quantities that the steps reduce come from
an ensemble.  All others (values at an angle, amplitudes, outputs that are no channels of the steps) are taken along
nodes, one run at a time in each thread.

Steps end on the kinks of the laws: stepping over them makes the noise in the values a thousand times larger.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.contract.defaults import DIFFERENCE_RTOL
from ballpass.runtime.contract.errors import RequestError, SimulationError
from ballpass.runtime.many.ensemble import simulate_many
from ballpass.runtime.point.evaluate import neighbour
from ballpass.runtime.quantity.layout import is_reduced
from ballpass.runtime.quantity.panels import ROUGH
from ballpass.runtime.quantity.quantity_run import QuantityRun
from ballpass.runtime.quantity.records import Quantity
from ballpass.runtime.quantity.registry import KINDS
from ballpass.runtime.run.locating import LOCATED
from ballpass.runtime.run.request import Request
from ballpass.runtime.run.resolve import Run, resolve

Array = NDArray[np.float64]

#: Roughness of a panel, relative to that of the derivatives' own run, whose nodes are not to be shared.
ROUGHNESS = 0.3


class MemberRuns:
    """Quantities of runs with changed parameters.

    Parameters
    ----------
    run : the run itself
    request : what was asked for
    quantities : as well
    fine : method for tight runs
    progress : called with the finished part of each call
    """

    def __init__(
        self,
        run: Run,
        request: Request,
        quantities: Sequence[Quantity],
        *,
        fine: str,
        progress: Callable[[float], None] = lambda _done: None,
    ) -> None:
        self._run, self._request, self._progress = run, request, progress
        model = run.model
        self._count = len(quantities)
        self._reduced = {
            k: item.name for k, item in enumerate(quantities) if is_reduced(model, item) and _is_near(run, item)
        }
        self._others = {k: item for k, item in enumerate(quantities) if k not in self._reduced}
        self._method = fine
        self._along = QuantityRun(model, list(self._others.values()), rough=ROUGHNESS * ROUGH, along_nodes=True)

    def __call__(self, changes: Sequence[Mapping[str, float]]) -> Array:
        """Values of all quantities for each change; NaN where it cannot be simulated."""
        found = np.full((len(changes), self._count), np.nan)
        if self._reduced:
            values = simulate_many(
                self._run.model,
                [{**self._run.numbers.parameters, **change} for change in changes],
                list(self._reduced.values()),
                cycles=self._request.cycles,
                duration=self._request.duration,
                transient=self._request.transient_cycles,
                rtol=DIFFERENCE_RTOL,
                method=self._method,
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

    def _along_nodes(self, change: Mapping[str, float]) -> Array:
        model = self._run.model
        request = replace(self._request, method=self._method, rtol=DIFFERENCE_RTOL, kinks=LOCATED, progress=None)
        try:
            run = resolve(model, neighbour(model, self._run.numbers, change), request)
            # the magnitudes of the run itself: a tolerance that changes with the parameters is noise
            return self._along.measure(replace(run, magnitude=self._run.magnitude)).values
        except (RequestError, SimulationError):
            return np.full(len(self._others), np.nan)


def _is_near(run: Run, quantity: Quantity) -> bool:
    """Whether the reductions of steps are as exact as the values along nodes.

    The force of the most loaded ball has a corner where another ball becomes the most loaded one, and the driver's
    steps do not end there.
    """
    if quantity.channel in run.model.states:
        return True
    return KINDS[quantity.kind].extremes == ("max",)
