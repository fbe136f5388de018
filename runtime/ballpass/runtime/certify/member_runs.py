"""Values of quantities for many changed parameter sets at once, for difference quotients.

In: changes of parameters.  Out: values, shape (runs, quantities).  One run in each thread; each gives all quantities:
those that its steps reduce, and all others (values at an angle, amplitudes, outputs that are no channels of the steps)
along nodes.

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
from ballpass.runtime.point.evaluate import neighbour
from ballpass.runtime.quantity.panels import ROUGH
from ballpass.runtime.quantity.quantity_run import QuantityRun
from ballpass.runtime.quantity.records import Quantity
from ballpass.runtime.quantity.registry import KINDS
from ballpass.runtime.request.locating import LOCATED
from ballpass.runtime.request.request import Request
from ballpass.runtime.request.resolve import Run, resolve

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
        self._count, self._method = len(quantities), fine
        afar = [item for item in quantities if not _is_near(run, item)]
        self._quantities = QuantityRun(run.model, quantities, rough=ROUGHNESS * ROUGH, along_nodes=afar)

    def __call__(self, changes: Sequence[Mapping[str, float]]) -> Array:
        """Values of all quantities for each change; NaN where it cannot be simulated."""
        found = np.empty((len(changes), self._count))
        with ThreadPoolExecutor(os.cpu_count()) as threads:
            for k, one in enumerate(threads.map(self._measured, changes)):
                found[k] = one
                self._progress((k + 1) / len(changes))
        return found

    def _measured(self, change: Mapping[str, float]) -> Array:
        model = self._run.model
        request = replace(self._request, method=self._method, rtol=DIFFERENCE_RTOL, kinks=LOCATED, progress=None)
        try:
            run = resolve(model, neighbour(model, self._run.numbers, change), request)
            # the magnitudes of the run itself: a tolerance that changes with the parameters is noise
            return self._quantities.measure(replace(run, magnitude=self._run.magnitude)).values
        except (RequestError, SimulationError):
            return np.full(self._count, np.nan)


def _is_near(run: Run, quantity: Quantity) -> bool:
    """Whether the reductions of steps are as exact as the values along nodes.

    The force of the most loaded ball has a corner where another ball becomes the most loaded one, and the driver's
    steps do not end there.
    """
    if quantity.channel in run.model.states:
        return True
    return KINDS[quantity.kind].extremes == ("max",)
