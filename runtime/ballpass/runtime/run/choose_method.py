"""Which method integrates a run: the one asked for, or for ``auto`` the one that suits the model.

In: a model, a name, the scales of a run.  Out: the name of a method, and the reason for it.
"""

from __future__ import annotations

import warnings

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.parameters import unknown_name
from ballpass.runtime.native.casadi_integrators import METHODS
from ballpass.runtime.native.loaded_model import LoadedModel, NoKernelsWarning
from ballpass.runtime.native.stepper import METHODS as STEPPERS
from ballpass.runtime.run.scales import Scales

#: `auto` takes ``rosenbrock`` above this ratio of fastest decay to fastest natural frequency.  Measured on a press with
#: four degrees of freedom and eight balls at rtol 1e-6: both take equal time at a ratio of 2, ``erk`` twice as long at
#: 7, because its steps are bounded by 3.3 / decay while each of ``rosenbrock`` costs three of its steps.
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


def method_names(model: LoadedModel) -> tuple[str, ...]:
    """Integration methods of a model, besides ``auto``."""
    return (*(STEPPERS if model.has_stepper else ()), *_virtual_methods(model))


def _virtual_methods(model: LoadedModel) -> tuple[str, ...]:
    """CasADi's methods: all, where the model has a right-hand side."""
    return tuple(METHODS) if model.has("rhs") else ()


def choose_method(model: LoadedModel, asked: str, scales: Scales | None) -> tuple[str, str]:
    """Name of the method and the reason for it.

    Parameters
    ----------
    scales : what the choice between CasADi's methods depends on; None where the stepper is there to be taken

    Raises
    ------
    RequestError
        No such method, or the model was generated without it.
    """
    if asked == "auto" and model.has_stepper:
        return "stepper", "the fastest method that a compiler allows"
    if asked in STEPPERS and model.has_stepper:
        return asked, "asked for"
    available = _virtual_methods(model)
    if asked == "auto" and model.compiled:
        reason = f" ({model.manifest.unfit})" if model.manifest.unfit else ""
        warnings.warn(
            f"{model.manifest.scene}: the generated folder has no kernels for the project's own stepper, which does "
            f"not take such a scene{reason}. CasADi's functions and integrators run instead: results are the same "
            "within the tolerance, a simulation takes some ten times as long, and there are no ensembles, reductions "
            "and derivatives of runs. Name the method to run it without this warning.",
            NoKernelsWarning,
            stacklevel=4,
        )
    if asked == "auto" and scales is not None:
        ratio = f"fastest decay {scales.decay:.3g} 1/s, fastest natural frequency {scales.frequency:.3g} rad/s"
        name, why = ("rosenbrock", "stiff") if scales.stiffness > STIFF_RATIO else ("erk", "not stiff")
        if name in available:
            return name, f"{why}: {ratio}"
        raise RequestError("The model has no right-hand side to integrate. Generate it again with `ballpass derive`.")
    if asked in STEPPERS:
        missing = (
            "the generated folder has no kernels for it; write it again with `ballpass derive`"
            if model.compiled
            else "it needs a C compiler, and none was found; install gcc or clang, or `pip install ziglang`"
        )
        raise RequestError(f"method {asked}: {missing}. Or take one of {', '.join(('auto', *available))}.")
    if asked not in available:
        raise RequestError(unknown_name("method", asked, ("auto", *method_names(model))))
    return asked, "asked for"
