"""One run, integrated as often as wanted: what all methods and tolerances have in common is made once.

In: a model, parameters, a length of run.  Out: a `WholeRun`; `WholeRun.integrate` gives quantities from on-line
reductions, as `Model.reduce` does, and the time of the integration alone.
"""

from __future__ import annotations

import math
import time as clocks
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.parameters import Numbers, unknown_name
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.reduction_rows import reduction_rows
from ballpass.runtime.point.assembly import check_assembly
from ballpass.runtime.ratings.readings import KINDS as LIFE
from ballpass.runtime.run.locating import LOCATED, STEPPED_OVER, Kinks, stepper_for
from ballpass.runtime.run.magnitudes import stepper_magnitudes
from ballpass.runtime.run.reduced_run import SCALED_TURNS, Begun, check_span, choose_family, integrate_reduced
from ballpass.runtime.run.reductions import channel_names, channels_needed, observable_aliases, observe
from ballpass.runtime.run.request import Request, make_plan

#: Kinds of observables whose relative error means something.
KINDS = ("max", "min", "mean", "rms", "range", *LIFE)

#: An observable: kind and channel.
Observable = tuple[str, str]

#: Time of this thread on its processor where the system counts it finely: other programs do not enter.
_now = clocks.thread_time if clocks.get_clock_info("thread_time").resolution < 1e-5 else clocks.perf_counter


@dataclass(frozen=True, slots=True, kw_only=True)
class Way:
    """How to integrate: a method of the stepper, its tolerance [1], what it does at kinks."""

    method: str
    rtol: float
    kinks: Kinks = STEPPED_OVER

    @property
    def words(self) -> str:
        """For people: method, tolerance, and kinks where they are located."""
        return f"{self.method}, rtol {self.rtol:g}" + (", kinks located" if self.kinks == LOCATED else "")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Integrated:
    """What an integration gave.

    Attributes
    ----------
    values : of the observables, shape (observables,)
    motion : largest and smallest value of each state, over its magnitude, shape (2 * states,)
    seconds : of the integration alone [s]
    steps, rejected : of the whole run
    """

    values: np.ndarray
    motion: np.ndarray
    seconds: float
    steps: int
    rejected: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WholeRun:
    """A run that is ready to be integrated.

    Attributes
    ----------
    initial : state at the start, shape (states,)
    magnitude : of the states, shape (states,)
    begin, duration, turn, start : time at the start, length, time of a turn, time from which on is reduced [s]
    """

    model: LoadedModel
    numbers: Numbers
    initial: np.ndarray
    magnitude: np.ndarray
    begin: float
    duration: float
    turn: float
    start: float

    @property
    def cycles(self) -> float:
        """Turns of the run; 1 where nothing turns."""
        return self.duration / self.turn if math.isfinite(self.turn) else 1.0

    def integrate(
        self,
        observables: Sequence[Observable],
        way: Way,
        moved: float | np.ndarray = 0.0,
        progress: Callable[[float], None] | None = None,
    ) -> Integrated:
        """Integrate all of it.

        Parameters
        ----------
        moved : added to the positions at the start, a number or shape (states / 2,) [m]
        progress : called with the finished fraction

        Raises
        ------
        RunFailed
            The method could not reach the end.
        """
        layout = reduction_rows(self.model.manifest)
        states = self.model.states
        needed = {name for observable in observables for name in channels_needed(*observable)}
        row = layout.empty(1, self.start, {*states, *needed})
        state = self.initial.copy()
        state[: len(state) // 2] += moved
        stepper = stepper_for(self.model, way.kinks)  # compiled before it is timed
        begin = _now()
        steps, rejected = integrate_reduced(
            self.model,
            stepper,
            self.numbers,
            choose_family(way.method),
            way.rtol * self.magnitude,
            state,
            row[0],
            (self.begin + self.duration, self.turn, self.start),
            progress=progress,
            begun=Begun(time=self.begin),
        )
        seconds = _now() - begin

        def found(kind: str, channel: str) -> float:
            return float(observe(self.model.manifest, kind, channel, row, state[None], self.numbers.values)[0])

        return Integrated(
            values=np.array([found(*observable) for observable in observables]),
            motion=np.array([found(kind, name) for kind in ("max", "min") for name in states])
            / np.tile(self.magnitude, 2),
            seconds=seconds,
            steps=steps,
            rejected=rejected,
        )


def prepare(model: LoadedModel, numbers: Numbers, request: Request) -> WholeRun:
    """Prepare a run.  What the request leaves open is taken from the scene's run settings.

    Raises
    ------
    RequestError
        A wrong request, a linkage that cannot be assembled, or no compiler for the stepper.
    """
    check_assembly(model, numbers)
    plan = make_plan(model, numbers, request)
    length, turn = plan.duration, plan.turn
    looked_at = min(length, SCALED_TURNS * turn)
    return WholeRun(
        model=model,
        numbers=numbers,
        initial=plan.initial,
        magnitude=stepper_magnitudes(model, model.stepper, numbers, plan.initial, looked_at, turn, plan.begin),
        begin=plan.begin,
        duration=length,
        turn=turn,
        start=check_span(length, turn, plan.transient_cycles, plan.begin),
    )


def check_observables(model: LoadedModel, names: Sequence[str]) -> tuple[Observable, ...]:
    """Kind and channel of observables by name: ``peak_ball_force``, ``rms:inner.y``.

    Raises
    ------
    RequestError
        Unknown names, or kinds that have no relative error.
    """
    aliases = observable_aliases(channel_names(model.manifest))
    known = {name: found for name, found in aliases.items() if found[0] in KINDS}
    faults = [_fault(model, name, known) for name in names if name not in known]
    if not names or faults:
        raise RequestError("\n".join(faults) or "of: at least one quantity is expected. Example: peak_ball_force.")
    return tuple(known[name] for name in names)


def _fault(model: LoadedModel, name: str, known: Mapping[str, Observable]) -> str:
    """Why there is no error of a quantity."""
    channel = str(name).rpartition(":")[2]
    offered = ", ".join(dict.fromkeys(channel for _, channel in known.values()))
    computed = {info.name for info in model.manifest.quantities}
    if channel not in channel_names(model.manifest) and channel in computed | {
        info.rpartition(".")[0] for info in computed
    }:
        return (
            f"{name!r}: {channel} is not integrated but follows from time or from the states; it has no error of "
            f"integration of its own. Errors are measured of: {offered}."
        )
    return unknown_name("quantity", name, known)


def default_observables(model: LoadedModel) -> tuple[str, ...]:
    """Peak ball force, rms and range of the inner ring's motion."""
    channels = [name.replace(".", "_") for name in channel_names(model.manifest)]
    peaks = [name for name in channels if name.endswith("ball_force")]
    rings = [name for name in channels if name.endswith(("inner_x", "inner_y"))]
    return (*(f"peak_{name}" for name in peaks), *(f"{kind}_{name}" for kind in ("rms", "range") for name in rings))
