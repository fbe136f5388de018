"""When states are read stroboscopically, and the periodic state to which readings come.

In: a model, ranges of parameters or none.  Out: `Strobe`.

Readings are a period of the equations apart, or a turn where that is long or there is none: balls or loads are then
elsewhere each time.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ballpass.runtime.ask.kept_parts import KeptParts
from ballpass.runtime.ask.parameter_range import ParameterRange
from ballpass.runtime.contract.defaults import EXPONENT_RTOL
from ballpass.runtime.contract.errors import RequestError, SimulationError
from ballpass.runtime.motion.forcing_period import (
    ForcingPeriod,
    common_period,
    forcing_period,
    phase_drifts,
    sampled_turns,
)
from ballpass.runtime.motion.lyapunov import (
    REPEATED,
    Exponent,
    changes_after,
    common_round,
    kind_of_motion,
    largest_exponent,
    period_of,
    strobe_with_tangents,
)
from ballpass.runtime.motion.shooting import Shooting
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.ratings.of_bearing import bearing_words
from ballpass.runtime.request.locating import jumping_laws
from ballpass.runtime.solution.solution import Solution
from ballpass.runtime.time import timeline
from ballpass.runtime.time.repetition import Repetition

#: Longest period of the equations that is taken between readings, in turns; else it is one turn.
LONGEST_STROBE = 8.0

#: Readings come to a state where changes fall to this share from their first third to their last; longest period of a
#: state that is sought so, in readings.
FALLS, LONGEST_SOUGHT = 0.95, 4

#: Readings by which a motion is named whose points are others.
READ = 60


@dataclass(frozen=True, slots=True, kw_only=True)
class Strobe:
    """When states are read.

    Attributes
    ----------
    period : of the equations; None where readings are a turn apart, after which they are others
    every : time between readings, in words
    """

    period: ForcingPeriod | None
    every: str

    def time(self, model: LoadedModel, parameters: Mapping[str, float]) -> float:
        """Time between readings with these overrides [s]."""
        values = model.numbers(parameters).values
        return timeline.driver(model.manifest, values).turn if self.period is None else self.period.time(values)

    def drifts(self, model: LoadedModel, parameters: Mapping[str, float]) -> Collection[float]:
        """Parts of a round by which phases of the equations move from reading to reading."""
        if self.period is not None:
            return ()
        run, every = sampled_turns(model, parameters), self.time(model, parameters)
        return phase_drifts(model, model.numbers(parameters), run.t, run.x, every).values()

    def settled(
        self,
        model: LoadedModel,
        parameters: Mapping[str, float],
        states: np.ndarray,
        magnitude: np.ndarray,
        parts: KeptParts,
    ) -> tuple[int, np.ndarray] | None:
        """The stable state to which readings come that do not repeat after one, and after how many it repeats.

        None where none is seen.

        A motion that contracts and turns looks like a cycle of many readings as it comes back near to earlier ones.
        Newton's iteration from the last reading finds where it goes, and its multipliers say how fast.
        """
        repeats = period_of(states, magnitude)
        if self.period is None or repeats == 1:
            return None
        begun = Shooting(model=model, parameters=parameters, period=self.period, magnitude=magnitude, parts=parts)
        for period in range(1, repeats or min(LONGEST_SOUGHT, len(states) // 4) + 1):
            if not may_repeat(states, magnitude, repeats, period):
                continue
            try:
                found = replace(begun, repeats=period).solve(states[-1:])
            except SimulationError:
                continue
            if come_to(states, magnitude, period, found.nodes[0], abs(found.multipliers[0])):
                return period, found.nodes[0]
        return None

    def name_of(
        self,
        model: LoadedModel,
        parameters: Mapping[str, float],
        run: Solution,
        begin: float,
        rtol: float | None,
        *,
        follows: bool,
        readings: int,
    ) -> tuple[str, Exponent | None]:
        """Name of the motion of a run that `sample_times` are among the times of, and the exponent that gave it.

        The name is as of `kind_of_motion`. Where states do not tell it, `READ` more readings give the exponent, and as
        many as the run has where these are too few.

        Parameters
        ----------
        begin : from which time on readings count [s]
        rtol : of the tangents; None: as `bifurcation` takes it
        follows : whether the state at an angle is a function of where the balls stand; no exponent is asked for then
        readings : of the run
        """
        drifts, magnitude = self.drifts(model, parameters), np.array(run.statistics.magnitudes)
        if self.period is None and follows:
            rounds = common_round(drifts)
            return f"periodic {rounds}" if rounds else "quasi-periodic", None
        if self.period is not None:
            states = run.x[np.searchsorted(run.t, self.sample_times(model, parameters, begin, float(run.t[-1])))]
            found = (
                self.settled(model, parameters, states, magnitude, KeptParts(None, ())) if model.has_stepper else None
            )
            repeats = found[0] if found is not None else period_of(states, magnitude)
            if repeats:
                return f"periodic {repeats}", None
        kind, grown = "undecided", None
        if not model.has_stepper or jumping_laws(model.manifest):
            return kind, grown
        numbers, step = model.numbers(parameters), self.time(model, parameters)
        tight = EXPONENT_RTOL if rtol is None else rtol
        for count in (READ, readings):
            if kind == "undecided" and count >= READ:
                states, flows = strobe_with_tangents(
                    model, numbers, run.end, step, count, magnitude, tight, lambda: None
                )
                grown = largest_exponent(flows, states, magnitude, drifts)
                kind = kind_of_motion(states, magnitude, grown, drifts, forced=self.period is not None)[0]
        return kind, grown

    def sample_times(self, model: LoadedModel, parameters: Mapping[str, float], begin: float, end: float) -> np.ndarray:
        """Times between two others at which states are read, the last `READ` of them [s]."""
        step = self.time(model, parameters)
        alike = Repetition.of(model.manifest, model.numbers(parameters).values).alike_from
        first, last = math.ceil((begin - alike) / step), math.floor((end - alike) / step)
        return alike + step * np.arange(first, last + 1)[-READ:]


def may_repeat(states: np.ndarray, magnitude: np.ndarray, repeats: int, period: int) -> bool:
    """Whether a state that repeats after so many readings is worth a search: changes fall, or `repeats` is several.

    Parameters
    ----------
    repeats : by `period_of`
    """
    changes = changes_after(states, magnitude, period)
    third = max(len(changes) // 3, 1)
    return repeats % period == 0 and bool(repeats or np.max(changes[-third:]) < FALLS * np.max(changes[:third]))


def come_to(states: np.ndarray, magnitude: np.ndarray, period: int, state: np.ndarray, size: float) -> bool:
    """Whether readings come to a state that repeats, as fast as its largest multiplier says.

    Parameters
    ----------
    size : of that multiplier
    """
    away = np.max(np.abs((states[::-period] - state) / magnitude), axis=1)[::-1]
    third = max(len(away) // 3, 1)
    # between the middles of these thirds a disturbance falls by its power of two thirds of the readings
    return size < 1.0 and bool(np.max(away[-third:]) <= max(REPEATED, size ** (len(away) / 3.0) * np.max(away[:third])))


def strobe_of(
    model: LoadedModel, parameters: Mapping[str, float], over: Sequence[ParameterRange], question: str
) -> Strobe:
    """When states are read, over ranges of parameters or for these numbers alone.

    Raises
    ------
    RequestError
        Nothing turns.
    """
    first = {**parameters, **{one.name: one.low for one in over}}
    values = model.numbers(first).values
    turn = timeline.driver(model.manifest, values).turn
    if not math.isfinite(turn):
        raise RequestError(f"{question}: nothing turns in this scene. Allowed: a driver or shaft that turns.")
    try:
        if not over:
            run = sampled_turns(model, first)
            period = forcing_period(model, model.numbers(first), run.t, run.x, None)
        else:
            period = common_period(model, parameters, over, partial(sampled_turns, model))
    except RequestError:  # no common period: readings are taken each turn, and the report says so
        period = None
    if period is not None and period.time(values) <= LONGEST_STROBE * turn:
        return Strobe(period=period, every=f"each time {period.words}")
    words = bearing_words("once a turn, after which balls or loads are elsewhere", model.manifest.bearings)
    return Strobe(period=None, every=words)
