"""Questions: each a file here, a line in `Questions`, a command of ``ballpass`` and a method of `Model`."""

from __future__ import annotations

from collections.abc import Callable
from types import FunctionType, MethodType
from typing import TYPE_CHECKING, Any

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.plugins import added
from ballpass.runtime.questions.bifurcation import bifurcation
from ballpass.runtime.questions.fit import fit
from ballpass.runtime.questions.jacobian import checked_jacobian
from ballpass.runtime.questions.life import life
from ballpass.runtime.questions.linearize import linearize
from ballpass.runtime.questions.morris import morris
from ballpass.runtime.questions.optimize import optimize
from ballpass.runtime.questions.question import is_declared
from ballpass.runtime.questions.section import section
from ballpass.runtime.questions.sensitivity import sensitivity
from ballpass.runtime.questions.sobol import sobol
from ballpass.runtime.questions.spectrum import spectrum
from ballpass.runtime.questions.steady import steady


class Questions:
    """Questions about a model, as its methods; the command line lists the same."""

    bifurcation = bifurcation
    checked_jacobian = checked_jacobian
    fit = fit
    life = life
    linearize = linearize
    morris = morris
    optimize = optimize
    section = section
    sensitivity = sensitivity
    sobol = sobol
    spectrum = spectrum
    steady = steady

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """A question of a plugin."""
            found = None if name.startswith("_") else added_questions().get(name)
            if found is None:
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            return MethodType(found, self)


def added_questions() -> dict[str, Callable[..., Any]]:
    """Questions of plugins, by their names."""
    asked = [ask for ask in added("questions", FunctionType) if is_declared(ask)]
    found = {ask.__name__: ask for ask in asked}
    if taken := sorted(name for name in found if name in vars(Questions)):
        raise RequestError(f"A plugin has a question {taken[0]!r}, as ballpass has. Allowed: another name. Rename it.")
    return found


#: The same, as a list.
QUESTIONS: list[Callable[..., Any]] = [item for item in vars(Questions).values() if is_declared(item)]
