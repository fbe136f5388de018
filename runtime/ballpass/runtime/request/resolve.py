"""The run that a request means: every open choice made once, for everything that runs a model.

In: a model, numbers, a `Request`.  Out: a `Run`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.method_registry import STEPPERS
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.request.assembly import check_assembly, may_lock
from ballpass.runtime.request.choose_method import choose_method
from ballpass.runtime.request.locating import Kinks, choose_kinks, stepper_for
from ballpass.runtime.request.magnitudes import model_scales, stepper_magnitudes
from ballpass.runtime.request.request import Request, asked_length, tolerance
from ballpass.runtime.request.start import start_state, start_time
from ballpass.runtime.time import timeline
from ballpass.runtime.time.span import Span, check_transient

#: Turns of a run from which the magnitudes of its states are taken.
SCALED_TURNS = 16


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Run:
    """A run with all choices made.

    Attributes
    ----------
    model, numbers : to run
    span : its time
    initial : state at the start, shape (states,)
    method, reason : name of the method, and why it was chosen; `NOT_INTEGRATED` for a model without states
    rtol : relative tolerance [1]
    kinks : treatment of the kinks of the laws
    magnitude : of the states, shape (states,)
    progress : called with the finished fraction of the run
    """

    model: LoadedModel
    numbers: Numbers
    span: Span
    initial: np.ndarray
    method: str
    reason: str = "asked for"
    rtol: float
    kinks: Kinks
    magnitude: np.ndarray
    progress: Callable[[float], None] | None = None

    @property
    def begin(self) -> float:
        """[s]."""
        return self.span.begin

    @property
    def start(self) -> float:
        """Time from which on it counts [s]."""
        return self.span.start

    @property
    def end(self) -> float:
        """[s]."""
        return self.span.end

    @property
    def duration(self) -> float:
        """Length [s]."""
        return self.span.duration

    @property
    def stretch(self) -> float:
        """Time after which it is cut, so that angles stay small; infinite where it need not be [s]."""
        return timeline.stretch(self.model.manifest, self.numbers.values)

    @property
    def tolerance(self) -> np.ndarray:
        """Error allowed in a step, shape (states,)."""
        return np.asarray(self.rtol * self.magnitude)

    def check_steady(self) -> Run:
        """The run itself; RequestError as for `Span.check`."""
        self.span.check()
        return self


def asked_transient(model: LoadedModel, given: float | None) -> float:
    """Turns that do not count: as given, else from the model's run settings; checked."""
    return check_transient(model.run_settings.transient_cycles if given is None else given)


def asked_span(model: LoadedModel, numbers: Numbers, request: Request) -> Span:
    """The time that a request means; what it leaves open is taken from the scene's run settings."""
    cycles, duration = asked_length(model, request.cycles, request.duration)
    return Span.of(
        timeline.driver(model.manifest, numbers.values),
        begin=start_time(request.initial),
        cycles=cycles,
        duration=math.nan if duration is None else duration,
        transient=asked_transient(model, request.transient_cycles),
    )


def resolve(
    model: LoadedModel, numbers: Numbers, request: Request, *, span: Span | None = None, stepper: bool = True
) -> Run:
    """The run that a request means; what it leaves open is taken from the scene's run settings.

    Parameters
    ----------
    span : its time, where its samples give it
    stepper : whether nothing but the project's own stepper can run it

    Raises
    ------
    RequestError
        The request is wrong; the message says what is allowed.
    """
    settings = model.manifest.run
    rtol = tolerance("rtol", settings.rtol if request.rtol is None else request.rtol)
    span = asked_span(model, numbers, request) if span is None else span
    check_assembly(model, numbers, span.end)
    initial = start_state(model, numbers, request.initial)
    stretch = timeline.stretch(model.manifest, numbers.values)
    looked_at = min(span.duration, SCALED_TURNS * stretch)
    magnitude = np.zeros(0)
    method, reason = choose_method(model, request.method or settings.method, stepper=stepper)
    if method not in STEPPERS and may_lock(model, numbers):
        raise RequestError(
            f"method {method}: a torque may turn the driver to the end of its range, or to where the linkage locks, "
            "and only the project's own stepper finds when. Take --method stepper; it needs a C compiler."
        )
    kinks = choose_kinks(request.kinks, method, model.manifest, rtol)
    if method in STEPPERS:
        # by the library that will run: each takes seconds to compile
        driver = stepper_for(model, kinks)
        magnitude = stepper_magnitudes(model, driver, numbers, initial, looked_at, stretch, span.begin)
    elif model.states:
        magnitude = model_scales(model, numbers, initial, looked_at, stretch, span.begin).magnitude
    return Run(
        model=model,
        numbers=numbers,
        span=span,
        initial=initial,
        method=method,
        reason=reason,
        rtol=rtol,
        kinks=kinks,
        magnitude=magnitude,
        progress=request.progress,
    )
