"""Choose the method that integrates a run: the one asked for, or for ``auto`` the one that suits the model.

In: a model, a name.  Out: the name of a method, and the reason for it.
"""

from __future__ import annotations

import warnings

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.extras import INSTALL_COMPILER
from ballpass.runtime.contract.method_registry import NOT_INTEGRATED, STEPPERS
from ballpass.runtime.contract.parameters import check_name, unknown_name
from ballpass.runtime.native.casadi_integrators import METHODS
from ballpass.runtime.native.loaded_model import LoadedModel, NoKernelsWarning

#: Linearly implicit steps suit above this ratio of fastest decay to fastest natural frequency.  Measured on a press
#: with four degrees of freedom and eight balls at rtol 1e-6: explicit steps take the same time at a ratio of 2, twice
#: as long at 7, because they are bounded by 3.3 / decay while a linearly implicit one costs three of them.
STIFF_RATIO = 3.0


def stepper_method(asked: str) -> str:
    """Name of a method of the project's own stepper.

    Raises
    ------
    RequestError
        Another method.
    """
    if asked == "auto":
        return "stepper"
    if asked not in STEPPERS:
        raise RequestError(
            f"method {asked!r}: reductions and ensembles are part of the project's own stepper. "
            f"Take auto or one of {', '.join(STEPPERS)}; for other methods call simulate and reduce its samples."
        )
    return asked


def differentiating_method(what: str, asked: str) -> str:
    """Name of a method that differentiates its own steps, or auto.

    Parameters
    ----------
    what : asks for it, for messages

    Raises
    ------
    RequestError
        Another method.
    """
    if asked not in ("auto", *STEPPERS):
        raise RequestError(
            f"{what}: the method {asked!r} was given; allowed are auto, {', '.join(STEPPERS)}, which differentiate "
            "their own steps."
        )
    return asked


def method_names(model: LoadedModel) -> tuple[str, ...]:
    """Integration methods of a model, besides ``auto``."""
    return (*(STEPPERS if model.has_stepper else ()), *(METHODS if model.has("rhs") else ()))


def choose_method(model: LoadedModel, asked: str, *, stepper: bool = False) -> tuple[str, str]:
    """Name of the method and the reason for it; `NOT_INTEGRATED` for a model without states, whatever was asked for.

    Parameters
    ----------
    stepper : whether nothing but the project's own stepper will do

    Raises
    ------
    RequestError
        No such method, or the model was generated without it.
    """
    if not model.states:
        if asked not in (known := ("auto", *STEPPERS, *METHODS)) and asked != NOT_INTEGRATED:
            raise RequestError(unknown_name("method", asked, known))
        return NOT_INTEGRATED, "the model has no states: its outputs follow from time alone"
    if stepper:
        return stepper_method(asked), "asked for"
    if asked == "auto" and model.has_stepper:
        return "stepper", "the fastest method that a compiler allows"
    if asked in STEPPERS and model.has_stepper:
        return asked, "asked for"
    if asked == "auto" and model.compiled:
        warnings.warn(
            f"{model.manifest.scene}: the generated folder has no kernels for the project's own stepper; write it "
            "again with `ballpass derive`. CasADi's functions and integrators run instead: results are the same "
            "within the tolerance, a simulation takes some ten times as long, and there are no ensembles, reductions "
            "and derivatives of runs. Name the method to run it without this warning.",
            NoKernelsWarning,
            stacklevel=4,
        )
    available = ("auto", *method_names(model))
    if asked == "auto":
        if "cvodes" in available:
            return "cvodes", "the method that runs without the project's own stepper"
        raise RequestError("The model has no right-hand side to integrate. Generate it again with `ballpass derive`.")
    if asked in STEPPERS:
        missing = (
            "the generated folder has no kernels for it; write it again with `ballpass derive`"
            if model.compiled
            else f"it needs a C compiler, and none was found. {INSTALL_COMPILER}"
        )
        raise RequestError(f"method {asked}: {missing}. Or take one of {', '.join(available)}.")
    check_name("method", asked, available)
    return asked, "asked for"
