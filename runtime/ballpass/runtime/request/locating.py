"""Kinks of the laws: stepped over by error control, or located so that steps end on them.

In: what a user asks for, a model, a method.  Out: the choice, checked, and the driver that follows it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.method_registry import NOT_INTEGRATED, STEPPERS
from ballpass.runtime.contract.parameters import unknown_name
from ballpass.runtime.native.driver_library import SWITCHES
from ballpass.runtime.native.loaded_model import LoadedModel

if TYPE_CHECKING:
    from ballpass.runtime.contract.manifest import Manifest
    from ballpass.runtime.native.stepper import Stepper

Kinks = Literal["stepped-over", "located"]

STEPPED_OVER: Kinks = "stepped-over"
LOCATED: Kinks = "located"
CHOICES: tuple[Kinks, ...] = (STEPPED_OVER, LOCATED)

#: Tolerance from which on the stepper locates kinks by default: that of a scene without one.  Stepped over,
#: extremes are off by ten times as much [1].
TIGHT = 1e-6

#: The same of ensembles, whose lanes cannot: first where the motion has kinks, then where a law jumps [1].
TIGHT_LANES, TIGHT_JUMPS = 3e-7, 1e-6

#: The same where loads act within windows of an angle that is a state: any tolerance [1].
ALWAYS = 1.0


def check_kinks(asked: str) -> Kinks:
    """One of `CHOICES`.

    Raises
    ------
    RequestError
        Another word.
    """
    for known in CHOICES:
        if isinstance(asked, str) and asked == known:
            return known
    raise RequestError(unknown_name("choice of kinks", asked, CHOICES))


def has_kinks(manifest: Manifest) -> bool:
    """Whether the motion has kinks; where the laws are smoothed it has none, and both choices are the same.

    One-sided damping of the rate alone has a kink in the force of each ball, but opposite balls cancel it in the
    motion: the manifest says so.  Hertz's law always has one.
    """
    written = SWITCHES in dict(manifest.files)
    laws = dict(manifest.smoothness)
    elastic = (laws.get(f"{bearing.prefix}elastic", "twice smooth") for bearing in manifest.bearings)
    return written or any(word != "twice smooth" for word in elastic)


def choose_kinks(asked: str | None, method: str, manifest: Manifest, rtol: float, *, lanes: bool = False) -> Kinks:
    """Choice of a run at kinks.

    Parameters
    ----------
    asked : one of `CHOICES`, None for the default
    method : name of the method that runs
    rtol : its tolerance [1]
    lanes : of an ensemble

    Returns
    -------
    Kinks
        By default ``located`` at tight tolerances of ``stepper``, and at all of every method of the stepper where
        loads act within windows of an angle that is a state, or at stops; else ``stepped-over``.

    Raises
    ------
    RequestError
        Another word, or kinks are to be located by a method that cannot.
    """
    if asked is None:
        tight = rtol <= tight_below(manifest, lanes=lanes) and has_kinks(manifest)
        return LOCATED if tight and (method == "stepper" or (manifest.borders and method in STEPPERS)) else STEPPED_OVER
    return check_located(asked, method)


def tight_below(manifest: Manifest, *, lanes: bool = False) -> float:
    """Tolerance from which on `stepper` locates kinks by default [1]."""
    if manifest.borders:
        return ALWAYS
    if not lanes:
        return TIGHT
    return TIGHT_JUMPS if any(word == "discontinuous" for _, word in manifest.smoothness) else TIGHT_LANES


def check_located(asked: str, method: str) -> Kinks:
    """One of `CHOICES` that a method can follow; errors as for `choose_kinks`."""
    chosen = check_kinks(asked)
    if method == NOT_INTEGRATED:  # no step is made
        return STEPPED_OVER
    if chosen == LOCATED and method not in STEPPERS:
        raise RequestError(
            f"kinks = {LOCATED!r}: method {method} cannot end its steps on them. Allowed: {', '.join(STEPPERS)}. Take "
            f"one of these, or leave kinks {STEPPED_OVER}."
        )
    return chosen


def refuse_with_error(error: object, **chosen: object) -> None:
    """Raise `RequestError` where method, tolerance or kinks, by name, are chosen for a run to a named error."""
    given = {name: value for name, value in chosen.items() if value is not None}
    if error is not None and given:
        raise RequestError(
            f"{', '.join(f'{name} = {value!r}' for name, value in given.items())} and an error were both given: a run "
            f"to a named error chooses its own way. Leave {' and '.join(given)} out, or the error."
        )


def kinks_with_derivatives(asked: str | None, manifest: Manifest) -> Kinks:
    """Choice of runs with derivatives at kinks: by default located at any tolerance, where there are some.

    Stepped over, the derivative of a step is not that of the motion; and where the motion switches loads, it
    jumps, so that steps have to end there.

    Raises
    ------
    RequestError
        Another word than of `CHOICES`.
    """
    chosen = LOCATED if asked is None else check_kinks(asked)
    return LOCATED if manifest.borders or (chosen == LOCATED and has_kinks(manifest)) else STEPPED_OVER


def stepper_for(model: LoadedModel, kinks: Kinks, *, derivatives: bool = False) -> Stepper:
    """Driver of single runs; errors as for `Model.stepper`."""
    located = kinks == LOCATED and has_kinks(model.manifest)
    if derivatives:
        return model.locating_differentiating_stepper if located else model.differentiating_stepper
    return model.locating_stepper if located else model.stepper


def jumping_laws(manifest: Manifest) -> list[str]:
    """Laws whose force jumps at contact.

    Loads that jump at the edges of windows are none: steps end there, and the derivative's jump is known.
    """
    return [law for law, word in manifest.smoothness if word == "discontinuous" and not law.startswith("gate.")]


def refuse_jumps(manifest: Manifest, what: str) -> None:
    """Refuse derivatives of a motion with laws whose force jumps at contact.

    Parameters
    ----------
    what : word that the message begins with

    Raises
    ------
    RequestError
        Names the laws.
    """
    jumping = jumping_laws(manifest)
    if jumping:
        raise RequestError(
            f"{what}: the {' and '.join(jumping)} law of this scene is discontinuous (its force jumps at "
            "contact), so the derivative of the steps is not that of the motion. Allowed: a continuous law, "
            '[bearing.damping] law = "tangent" or "one-sided", or a smoothed contact, [bearing.contact] smoothing.'
        )
