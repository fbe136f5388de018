"""Where runs start: at the scene's initial state, at one that is given, or where another run ended.

In: a model, numbers, what was asked for.  Out: time and state.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.parameters import Numbers, vector
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.ratings.of_bearing import bearing_words
from ballpass.runtime.request.ball_angles import ball_angles
from ballpass.runtime.show.short import ShortRepr
from ballpass.runtime.time import timeline
from ballpass.runtime.time.turning import beside

#: Angles of driver and balls that differ by less are equal, up to the rounding of many turns [rad].
SAME_ANGLE = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class RunEnd(ShortRepr):
    """End of a run, from which another one continues: ``initial=solution.end``.

    Attributes
    ----------
    time : [s]
    x : state then, shape (states,)
    states : names of the states
    parameters : of the run, by name

    Examples
    --------
    >>> first = model.simulate(cycles=1)
    >>> rest = model.simulate(cycles=2, initial=first.end)  # continues
    >>> f"{rest.t[0] / model.period():.1f} turns"
    '1.0 turns'
    """

    time: float
    x: np.ndarray
    states: tuple[str, ...]
    parameters: Mapping[str, float] = field(repr=False)


def state_at(model: LoadedModel, numbers: Numbers, time: float, x: np.ndarray) -> RunEnd:
    """A start in a state at a time [s]."""
    states = tuple(info.name for info in model.manifest.states)
    return RunEnd(time=time, x=np.array(x), states=states, parameters=numbers.parameters)


#: Type of a given start; None is the scene's.
Start = np.ndarray | RunEnd | None


def start_time(given: Start) -> float:
    """Time at which a run begins [s]."""
    return given.time if isinstance(given, RunEnd) else 0.0


def start_state(model: LoadedModel, numbers: Numbers, given: Start) -> np.ndarray:
    """State at the start, shape (states,): as given, else from the parameters.

    Raises
    ------
    RequestError
        Another shape, a run of other states, or of parameters with which driver or balls have another place.
    """
    if given is None:
        return np.array([numbers.values[name] for name in model.manifest.initial], dtype=float)
    names = tuple(state.name for state in model.manifest.states)
    if isinstance(given, RunEnd):
        if given.states != names:
            raise RequestError(
                f"initial: it is the end of a run with other states ({', '.join(given.states)}); those of this model "
                f"are {', '.join(names)}. Give the end of a run of this scene."
            )
        _refuse_jump(model, numbers, given)
        return given.x
    initial = vector(given)
    if initial.shape != (len(names),) or not np.all(np.isfinite(initial)):
        raise RequestError(
            f"initial: {len(names)} finite numbers are expected ({', '.join(names)}), "
            f"not an array of shape {initial.shape}{'' if np.all(np.isfinite(initial)) else ' with NaN or inf'}."
        )
    return initial


def _refuse_jump(model: LoadedModel, numbers: Numbers, end: RunEnd) -> None:
    """Refuse to continue with numbers that give driver or balls another place at that time than the run before."""
    known = {name: value for name, value in end.parameters.items() if name in numbers.parameters}
    changed = [name for name, value in known.items() if numbers.parameters[name] != value]
    if not changed:
        return
    before = model.numbers({**numbers.parameters, **known})
    angles, others = (
        np.concatenate(
            [
                [timeline.crank_angle(model.manifest, one.values, end.time, end.x)],
                *ball_angles(model, one, end.time, end.x),
            ]
        )
        for one in (before, numbers)
    )
    moved = np.abs(beside(others, angles))
    if np.max(moved) > SAME_ANGLE * max(1.0, end.time / timeline.driver(model.manifest, numbers.values).turn):
        balls = bearing_words("balls", model.manifest.bearings)
        what = "the driver" if moved[0] == np.max(moved) else balls
        raise RequestError(
            f"initial: with {', '.join(changed)} changed, {what} would jump by "
            f"{math.degrees(float(np.max(moved))):.4g} deg at t = {end.time:.6g} s, where the run continues. Allowed: "
            f"parameters that leave driver and {balls} where they are. Give them as they were, or start anew from the "
            "state alone: initial=solution.end.x."
        )
