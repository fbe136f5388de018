"""Forward sensitivities of a run: derivatives of the states by parameters, exact for the discrete solution.

In: a model, numbers of a run, names of parameters.  Out: `Sensitivities`.  The stepper differentiates each accepted
step line by line at fixed step size, many parameters in one pass (`directions`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from ballpass.runtime.contract.defaults import DERIVATIVE_RTOL, LOOSEST_SENSITIVITY, SENSITIVITY, TOLERANCES
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.parameters import Numbers, check_name
from ballpass.runtime.contract.status import Status
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.request.choose_method import differentiating_method
from ballpass.runtime.request.locating import jumping_laws, kinks_with_derivatives, refuse_jumps
from ballpass.runtime.request.request import Request, tolerance
from ballpass.runtime.run.directions import Directions
from ballpass.runtime.run.loop import RunFailed
from ballpass.runtime.show.short import ShortRepr
from ballpass.runtime.solution.integration_error import IntegrationError
from ballpass.runtime.solution.simulate import simulate
from ballpass.runtime.solution.solution import Solution

#: Method of runs with derivatives where laws jump.
EXPLICIT = "stepper-dop853"

Done = TypeVar("Done")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Sensitivities(ShortRepr):
    """A solution and the derivatives of its states.

    Attributes
    ----------
    solution : the run itself
    names : parameters, in the order of the last axis
    x : derivative of each state at fixed time, shape (samples, states, parameters) [state's unit / parameter's unit]
    sensitivity_rtol : tolerance of the derivatives that was taken [1]

    Examples
    --------
    >>> slopes = model.sensitivities("bearing.clearance", cycles=0.5)
    >>> slopes.names, slopes.x.shape  # samples, states, parameters
    (('bearing.clearance',), (1001, 8, 1))
    """

    solution: Solution
    names: tuple[str, ...]
    x: np.ndarray
    sensitivity_rtol: float

    def __getitem__(self, key: tuple[str, str]) -> np.ndarray:
        """Derivative of a state by a parameter, ``s["inner.y", "bearing.clearance"]``, shape (samples,).

        Examples
        --------
        >>> slopes = model.sensitivities("bearing.clearance", cycles=0.5)
        >>> slopes["inner.y", "bearing.clearance"].shape  # [m/m]
        (1001,)
        """
        state, parameter = key
        states = self.solution.states
        check_name("state", state, states)
        check_name("parameter of this sensitivity", parameter, self.names)
        return np.asarray(self.x[:, states.index(state), self.names.index(parameter)])


def sensitivities(
    model: LoadedModel, numbers: Numbers, request: Request, names: Sequence[str], *, with_jumps: bool = False
) -> Sensitivities:
    """Run a model with its derivatives along parameters.

    Parameters
    ----------
    with_jumps : take laws whose force jumps at contact, by `EXPLICIT`: the time of each contact moves with the
        derivatives, so that they jump with the force (saltation); those of linearly implicit steps do not

    Raises
    ------
    RequestError
        An unknown parameter, a method that is not the stepper's, a law whose force jumps.
    IntegrationError
        The computation failed.
    """
    kinks = kinks_with_derivatives(request.kinks, model.manifest)
    if not with_jumps:
        refuse_jumps(model.manifest, "sensitivities")
    elif jumping_laws(model.manifest):
        request = replace(request, method=EXPLICIT)
    differentiating_method("sensitivities", request.method or model.manifest.run.method)
    if not names:
        raise RequestError("sensitivities: no parameter was named. Give the names of one or more parameters.")
    rtol = DERIVATIVE_RTOL if request.rtol is None else tolerance("rtol", request.rtol)

    def run(own: float) -> Sensitivities:
        made: list[Directions] = []

        def prepare(samples: int) -> Directions:
            made.append(Directions(model, numbers, names, samples, kinks))
            return made[0]

        solution = simulate(model, numbers, replace(request, rtol=rtol, sensitivity_rtol=own), prepare)
        x = made[0].states(len(solution))
        return Sensitivities(solution=solution, names=tuple(names), x=x, sensitivity_rtol=own)

    if request.sensitivity_rtol is not None:
        return run(request.sensitivity_rtol)
    return loosened(run, min(SENSITIVITY * rtol, TOLERANCES[1]))[0]


def loosened(run: Callable[[float], Done], tightest: float) -> tuple[Done, float]:
    """A run with derivatives at the tightest tolerance of these that the resolution of time allows; that tolerance."""
    own = tightest
    while True:
        try:
            return run(own), own
        except (IntegrationError, RunFailed) as fault:
            if fault.status is not Status.STEP_TOO_SMALL or own * 10.0 > LOOSEST_SENSITIVITY:
                raise
            own *= 10.0
