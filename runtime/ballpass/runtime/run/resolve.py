"""The run that a request means: every open choice made once, for everything that runs a model.

In: a model, numbers, a `Request`.  Out: a `Run`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ballpass.runtime.contract.defaults import longer_words
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.method_registry import STEPPERS
from ballpass.runtime.contract.parameters import Numbers, real
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.run.choose_method import choose_method
from ballpass.runtime.run.locating import Kinks, choose_kinks
from ballpass.runtime.run.magnitudes import model_scales, stepper_magnitudes
from ballpass.runtime.run.request import Request, asked_length, check_length, run_length, tolerance
from ballpass.runtime.run.start import start_state, start_time
from ballpass.runtime.time import timeline

#: Turns of a run from which the magnitudes of its states are taken.
SCALED_TURNS = 16


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Run:
    """A run with all choices made.

    Attributes
    ----------
    model, numbers : to run
    begin, end : [s]
    turn : time of a turn, infinite where nothing turns [s]
    turns : how many were asked for; None where a time was
    transient_cycles : turns from t = 0 on that do not count
    start : time from which on the run counts [s]
    initial : state at the start, shape (states,)
    method, reason : name of the method, and why it was chosen; `NOT_INTEGRATED` for a model without states
    rtol : relative tolerance [1]
    kinks : treatment of the kinks of the laws
    magnitude : of the states, shape (states,)
    progress : called with the finished fraction of the run
    """

    model: LoadedModel
    numbers: Numbers
    begin: float
    end: float
    turn: float
    turns: float | None
    transient_cycles: float
    start: float
    initial: np.ndarray
    method: str
    reason: str = "asked for"
    rtol: float
    kinks: Kinks
    magnitude: np.ndarray
    progress: Callable[[float], None] | None = None

    @property
    def duration(self) -> float:
        """Length [s]."""
        return self.end - self.begin

    @property
    def cycles(self) -> float:
        """Turns of the run; 1 where nothing turns."""
        return self.duration / self.turn if math.isfinite(self.turn) else 1.0

    @property
    def tolerance(self) -> np.ndarray:
        """Error allowed in a step, shape (states,)."""
        return np.asarray(self.rtol * self.magnitude)

    def by(self, method: str, rtol: float, kinks: Kinks) -> Run:
        """The same run by another method of the stepper."""
        return replace(self, method=method, rtol=rtol, kinks=kinks, reason="asked for")

    def check_steady(self) -> Run:
        """The run itself.

        Raises
        ------
        RequestError
            The transient is no number of turns from 0 on, nothing turns, or nothing is left of the run.
        """
        check_span(self.end - self.begin, self.turn, self.transient_cycles, self.begin)
        return self


def check_span(duration: float, turn: float, transient: float, begin: float = 0.0) -> float:
    """Time from which on a run counts [s].

    Raises
    ------
    RequestError
        The run is too long, the transient no number of turns from 0 on, nothing turns, or nothing is left of the run.
    """
    end = begin + duration
    check_length(end, turn)
    check_transient(transient)
    if transient > 0.0 and not math.isfinite(turn):
        raise RequestError("transient: its cycles are turns, and nothing turns in this model. Set it to 0.")
    start = max(begin, transient * turn if transient > 0.0 else 0.0)
    if start >= end * (1.0 - 1e-9):
        raise RequestError(
            f"The run of {end / turn:g} cycles lies within its {transient:g} transient cycles: nothing is left. "
            f"Remedy: {longer_words(transient)}."
        )
    return start


def check_transient(given: float) -> float:
    """A number of turns from 0 on; RequestError for another."""
    if not 0.0 <= real(given) < math.inf:
        raise RequestError(f"transient: a number of cycles from 0 on is expected, not {given!r}.")
    return real(given)


def asked_transient(model: LoadedModel, given: float | None) -> float:
    """Turns that do not count: as given, else from the model's run settings; checked."""
    return check_transient(model.run_settings.transient_cycles if given is None else given)


def resolve(
    model: LoadedModel,
    numbers: Numbers,
    request: Request,
    *,
    duration: float | None = None,
    stepper: bool = True,
) -> Run:
    """The run that a request means; what it leaves open is taken from the scene's run settings.

    Parameters
    ----------
    duration : of the run, where its samples give it [s]
    stepper : whether nothing but the project's own stepper can run it

    Raises
    ------
    RequestError
        The request is wrong; the message says what is allowed.
    """
    settings = model.manifest.run
    turn = timeline.period(model.manifest, numbers.values)
    transient = asked_transient(model, request.transient_cycles)
    rtol = tolerance("rtol", settings.rtol if request.rtol is None else request.rtol)
    begin, initial = start_time(request.initial), start_state(model, numbers, request.initial)
    if duration is None:
        duration = run_length(model, request, turn)
        check_length(begin + duration, turn)
    asked = request.method or settings.method
    looked_at = min(duration, SCALED_TURNS * turn)
    magnitude = np.zeros(0)
    method, reason = choose_method(model, asked, stepper=stepper)
    if method in STEPPERS:
        magnitude = stepper_magnitudes(model, model.stepper, numbers, initial, looked_at, turn, begin)
    elif model.states:
        magnitude = model_scales(model, numbers, initial, looked_at, turn, begin).magnitude
    return Run(
        model=model,
        numbers=numbers,
        begin=begin,
        end=begin + duration,
        turn=turn,
        turns=asked_length(model, request.cycles, request.duration)[0] if request.times is None else None,
        transient_cycles=transient,
        start=max(begin, transient * turn if transient > 0.0 else 0.0),
        initial=initial,
        method=method,
        reason=reason,
        rtol=rtol,
        kinks=choose_kinks(request.kinks, method, model.manifest, rtol),
        magnitude=magnitude,
        progress=request.progress,
    )
