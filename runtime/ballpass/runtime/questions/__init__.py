"""Questions: each a file here, a line in `Questions`, a command of ``ballpass`` and a method of `Model`."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from ballpass.runtime.questions.bifurcation import bifurcation
from ballpass.runtime.questions.fit import fit
from ballpass.runtime.questions.jacobian import checked_jacobian
from ballpass.runtime.questions.life import life
from ballpass.runtime.questions.linearize import linearize
from ballpass.runtime.questions.morris import morris
from ballpass.runtime.questions.optimize import optimize
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


#: The same, as a list.
QUESTIONS: list[Callable[..., Any]] = [item for item in vars(Questions).values() if inspect.isfunction(item)]
