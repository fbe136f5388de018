"""Method and tolerances of runs with derivatives of quantities, and motion that has no derivatives.

In: a model, numbers, a request.  Out: a `Run`, and `Values` made by it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ballpass.runtime.certify.growth import refuse_growth
from ballpass.runtime.contract.errors import SimulationError
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.quantity.quantity_run import EvaluatedQuantities, QuantityRun
from ballpass.runtime.quantity.records import Quantity
from ballpass.runtime.request.choose_method import STIFF_RATIO, differentiating_method
from ballpass.runtime.request.locating import kinks_with_derivatives
from ballpass.runtime.request.magnitudes import model_scales
from ballpass.runtime.request.request import Request
from ballpass.runtime.request.resolve import SCALED_TURNS, Run, asked_span, resolve
from ballpass.runtime.request.segments import check_count
from ballpass.runtime.request.start import start_state
from ballpass.runtime.run.reductions import channel_names
from ballpass.runtime.solution.sensitivity import loosened
from ballpass.runtime.time import timeline

#: Growth of a change of the start below which a motion is not chaotic: one of 1e-10 (`growth.TINY`) then changes the
#: motion by 1e-6, far from what four digits bear.  Shipped scenes have 300 at most, chaotic ones 1e9 [1].
TAME = 1e4


def derivative_run(model: LoadedModel, numbers: Numbers, request: Request) -> tuple[Run, str]:
    """A run with derivatives, and the method for tight runs of difference quotients.

    Raises
    ------
    RequestError
        A wrong request, or a method that does not differentiate its own steps.
    """
    asked = differentiating_method("sensitivity", request.method or "auto")
    fine = "stepper-dop853"
    if model.states:
        turn = timeline.stretch(model.manifest, numbers.values)
        looked_at = min(asked_span(model, numbers, request).duration, SCALED_TURNS * turn)
        scales = model_scales(model, numbers, start_state(model, numbers, request.initial), looked_at, turn)
        fine = "stepper-rodas5p" if scales.stiffness > STIFF_RATIO else fine
    method = fine if asked == "auto" else asked
    run = resolve(
        model, numbers, replace(request, method=method, kinks=kinks_with_derivatives(request.kinks, model.manifest))
    )
    check_count(model.manifest, numbers, run.duration, run.stretch)  # before any long computation
    return run.check_steady(), fine


def differentiate(
    quantities: QuantityRun, run: Run, names: Sequence[str], sensitivity_rtol: float
) -> tuple[EvaluatedQuantities, float]:
    """Derivatives at the tightest tolerance that the resolution of time allows; that tolerance."""
    return loosened(lambda tolerance: quantities.differentiate(run, names, tolerance), sensitivity_rtol)


def differentiate_unless_chaotic(
    quantities: QuantityRun, run: Run, request: Request, names: Sequence[str], sensitivity_rtol: float
) -> tuple[EvaluatedQuantities, float]:
    """The same where the motion is not chaotic.

    The derivative along the start, which the run gives beside the others, shows most motions to be tame; values from a
    moved start decide about the others.  Along many parameters of a long run `refuse_chaos` beforehand takes less time.

    Parameters
    ----------
    request : that of the run

    Raises
    ------
    SimulationError
        It is; or the computation failed.
    """
    try:
        found, tolerance = differentiate(quantities, run, names, sensitivity_rtol)
    except SimulationError:
        refuse_chaos(run.model, run.numbers, quantities.quantities, request)
        raise
    if not found.growth <= TAME:
        refuse_chaos(run.model, run.numbers, quantities.quantities, request)
    return found, tolerance


def refuse_chaos(model: LoadedModel, numbers: Numbers, quantities: Sequence[Quantity], request: Request) -> None:
    """Refuse derivatives where the motion amplifies a tiny change too much (chaos); see `refuse_growth`.

    Raises
    ------
    SimulationError
        It does.
    """
    moving = [item.name for item in quantities if item.channel in channel_names(model.manifest)]
    if moving and model.has_stepper:
        refuse_growth(
            model, numbers, replace(request, transient_cycles=0.0, method=None, rtol=None, kinks=None), moving
        )
