"""Bounds and defaults of the tolerances of everything that runs a model, each with what it is for.

A plain run (`Model.simulate`, `reduce`, `quantities`, `simulate_many`, `ballpass run`) has that of the scene.
"""

from __future__ import annotations

#: Smallest and largest relative tolerance that can be asked for: below, rounding decides [1].
TOLERANCES = (1e-13, 1e-1)

#: Values of functions of parameters, which optimizers take differences of: their noise is below a search's steps [1].
FUNCTION_RTOL = 1e-9

#: Runs with derivatives, over the tolerance of the function's values: they lose digits [1].
FUNCTION_SLOPES = 1e-2

#: States of a run with derivatives: an error of the motion is one of the derivative, multiplied [1].
DERIVATIVE_RTOL = 1e-11

#: Derivatives in the choice of step sizes, over the tolerance of the states [1].
SENSITIVITY = 10.0

#: Runs of difference quotients, whose noise is divided by small steps [1].
DIFFERENCE_RTOL = 1e-11
