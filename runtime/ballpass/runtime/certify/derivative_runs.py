"""How runs with derivatives of quantities step: method, magnitudes, tolerances.

In: a model, numbers, a window.  Out: a `Stepping`, and a `Course` made by it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ballpass.runtime.ask.nodes import Window
from ballpass.runtime.ask.quantity_records import Quantity
from ballpass.runtime.ask.study import Course, Span, Study
from ballpass.runtime.ask.track import Stepping
from ballpass.runtime.certify.growth import refuse_growth
from ballpass.runtime.contract.errors import RequestError, SimulationError
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.stepper import METHODS, Family
from ballpass.runtime.run.locating import kinks_with_derivatives
from ballpass.runtime.run.magnitudes import model_scales
from ballpass.runtime.run.reductions import channel_names
from ballpass.runtime.run.request import Request
from ballpass.runtime.run.simulate import STIFF_RATIO

#: The derivatives' tolerance is loosened tenfold, down to this, where steps would fall below the resolution of time:
#: under laws whose slope is infinite at contact onset derivatives have singular rates there.
LOOSEST = 1e-6


def stepping_with_derivatives(
    model: LoadedModel,
    numbers: Numbers,
    window: Window,
    *,
    method: str = "auto",
    rtol: float,
    sensitivity_rtol: float,
    kinks: str | None = None,
) -> tuple[Stepping, Family]:
    """How to step with derivatives, and the family for tight runs of difference quotients.

    Raises
    ------
    RequestError
        A method that does not differentiate its own steps.
    """
    if method not in ("auto", *METHODS):
        raise RequestError(
            f"sensitivity: the method {method!r} was given; allowed are auto, {', '.join(METHODS)}, which "
            "differentiate their own steps."
        )
    magnitude, family, fine = np.zeros(0), Family.AUTO, Family.AUTO
    if model.states:
        start = np.array([numbers.values[name] for name in model.manifest.initial])
        scales = model_scales(model, numbers, start, window.duration, window.turn)
        magnitude, stiff = scales.magnitude, scales.stiffness > STIFF_RATIO
        family = METHODS.get(method, Family.AUTO)
        if family is Family.AUTO:
            family = Family.RODAS5P if stiff else Family.DOP853
        fine = Family.RODAS5P if stiff else Family.DOP853
    stepping = Stepping(
        family=family,
        rtol=rtol,
        magnitude=magnitude,
        kinks=kinks_with_derivatives(kinks, model.manifest),
        sensitivity_rtol=sensitivity_rtol,
    )
    return stepping, fine


def differentiate(study: Study, numbers: Numbers, names: Sequence[str], stepping: Stepping) -> tuple[Course, float]:
    """Derivatives at the tightest tolerance that the resolution of time allows; that tolerance."""
    tolerance = stepping.sensitivity_rtol
    assert tolerance is not None
    while True:
        try:
            return study.differentiate(numbers, names, replace(stepping, sensitivity_rtol=tolerance)), tolerance
        except SimulationError:
            if tolerance * 10.0 > max(LOOSEST, stepping.sensitivity_rtol or 0.0):
                raise
            tolerance *= 10.0


def refuse_chaos(
    model: LoadedModel,
    numbers: Numbers,
    quantities: Sequence[Quantity],
    span: Span,
    progress: Callable[[float], None] | None = None,
) -> None:
    """Refuse derivatives of quantities whose motion amplifies a tiny change beyond meaning; see `refuse_growth`.

    Raises
    ------
    SimulationError
        It does.
    """
    moving = [item.name for item in quantities if item.channel in channel_names(model.manifest)]
    if moving and model.has_stepper:
        request = Request(cycles=span.cycles, duration=span.duration, transient_cycles=0.0, progress=progress)
        refuse_growth(model, numbers, request, moving)
