"""Bounds and defaults of the tolerances of everything that runs a model, each with what it is for.

A plain run (`Model.simulate`, `reduce`, `quantities`, `simulate_many`, `ballpass run`) has that of the scene.
"""

from __future__ import annotations

import math

#: Smallest and largest relative tolerance that can be asked for: below, rounding decides [1].
TOLERANCES = (1e-13, 1e-1)

#: Values of functions of parameters, which optimizers take differences of: their noise is below a search's steps [1].
FUNCTION_RTOL = 1e-9

#: Runs with derivatives, over the tolerance of the function's values: they lose digits [1].
FUNCTION_SLOPES = 1e-2

#: States of a run with derivatives: an error of the motion is one of the derivative, multiplied [1].
DERIVATIVE_RTOL = 1e-11

#: Derivatives of states in the choice of step sizes, over the tolerance of the states.  Those of quantities take the
#: same tolerance: what is left behind a spall is a thousandth of what they are within it [1].
SENSITIVITY = 10.0

#: The derivatives' tolerance is loosened tenfold, down to this, where steps would fall below the resolution of time:
#: under laws whose slope is infinite at contact onset derivatives have singular rates there [1].
LOOSEST_SENSITIVITY = 1e-6

#: Runs of difference quotients, whose noise is divided by small steps [1].
DIFFERENCE_RTOL = 1e-11

#: Points of Poincaré sections and of bifurcation diagrams, without derivatives: they are drawn [1].
SECTION_RTOL = 1e-7

#: Runs with a tangent for Lyapunov exponents.  In a turn in which the tangent shrinks to a thousandth its size depends
#: on the last digits: at 1e-9 the press at 20 um is still 1.3 % off [1].
EXPONENT_RTOL = 1e-10

#: Branches of periodic states, whose ends and bifurcations are then located to about this [1].
BRANCH_RTOL = 1e-9

#: Runs of `optimize`, each with derivatives by all that varies [1].
OPTIMUM_RTOL = 1e-8

#: Runs of `fit`, each with derivatives by all that is fitted [1].
FIT_RTOL = 1e-9

#: Turns that count of a run whose length is not given, or a few more where loads repeat after several: those of the
#: steady machine.
STEADY_CYCLES = 10


def longer_words(transient: float, *, turning: bool = True) -> str:
    """What to do where nothing is left of a run behind its transient turns."""
    cycles = math.floor(transient) + STEADY_CYCLES
    longer = f"run longer, as cycles = {cycles} (--cycles {cycles}), or " if turning else ""
    return f"{longer}leave out none (--transient 0; in a scene transient_cycles = 0)"
