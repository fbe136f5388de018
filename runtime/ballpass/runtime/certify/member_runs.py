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


def member_runs(
    run: Run,
    request: Request,
    quantities: Sequence[Quantity],
    *,
    fine: str,
    progress: Callable[[float], None],
) -> Callable[[Sequence[Mapping[str, float]]], Array]:
    """A function that gives the values of all quantities for each of some changes; NaN where one cannot be simulated.

    Parameters
    ----------
    run : the run itself
    request : what was asked for
    quantities : as well
    fine : method for tight runs
    progress : called with the finished part of each call
    """
    afar = [item for item in quantities if not _is_near(run, item)]
    along = QuantityRun(run.model, quantities, rough=ROUGHNESS * ROUGH, along_nodes=afar)
    tight = replace(request, method=fine, rtol=DIFFERENCE_RTOL, kinks=LOCATED, progress=None)

    def measured(change: Mapping[str, float]) -> Array:
        try:
            one = resolve(run.model, neighbour(run.model, run.numbers, change), tight)
            # the magnitudes of the run itself: a tolerance that changes with the parameters is noise
            return along.measure(replace(one, magnitude=run.magnitude)).values
        except (RequestError, SimulationError):
            return np.full(len(quantities), np.nan)

    def measure(changes: Sequence[Mapping[str, float]]) -> Array:
        found = np.empty((len(changes), len(quantities)))
        with ThreadPoolExecutor(os.cpu_count()) as threads:
            for k, values in enumerate(threads.map(measured, changes)):
                found[k] = values
                progress((k + 1) / len(changes))
        return found

    return measure


def _is_near(run: Run, quantity: Quantity) -> bool:
    """Whether the reductions of steps are as exact as the values along nodes.

    The force of the most loaded ball has a corner where another ball becomes the most loaded one, and the driver's
    steps do not end there.
    """
    if quantity.channel in run.model.states:
        return True
    return KINDS[quantity.kind].extremes == ("max",)
