"""The state at which a run of a model starts, from what is given for it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.parameters import Numbers, vector
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.request.start import RunEnd, Start

#: State at the start: given, "equilibrium", or the end of a run that this one continues; None takes the scene's.
Initial = Sequence[float] | np.ndarray | RunEnd | Literal["equilibrium"] | None


def start_of(model: LoadedModel, numbers: Numbers, initial: Initial) -> Start:
    """Start of a run; RequestError for an unknown word."""
    if initial is None or isinstance(initial, RunEnd):
        return initial
    if hasattr(initial, "__array__") or (isinstance(initial, Sequence) and not isinstance(initial, str)):
        return vector(initial)
    if initial != "equilibrium":
        raise RequestError(
            f'initial: {initial!r:.60} ({type(initial).__name__}) was given. Allowed: a state, "equilibrium", or the '
            "end of a run: Solution.end continues it from its time on, Solution.end.x is its state, to begin at t = 0."
        )
    from ballpass.runtime.point.equilibrium import start_at_rest  # with SciPy

    return start_at_rest(model, numbers)
