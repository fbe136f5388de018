"""Small vibrations about the static equilibrium of an instant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ballpass.runtime.contract.options import CrankAngle, Instant
from ballpass.runtime.questions.question import Question

if TYPE_CHECKING:
    from ballpass.runtime.point.linearize import Linearization
    from ballpass.runtime.point.point_model import PointModel


@Question(stage="linearize", runs=False, requires="states")
def linearize(
    model: PointModel,
    t: Instant = None,
    *,
    crank_angle: CrankAngle = None,
    x: Sequence[float] | np.ndarray | None = None,
    parameters: Mapping[str, float] | None = None,
) -> Linearization:
    """Matrices, natural frequencies and modes of small vibrations about the static equilibrium of an instant.

    Parameters
    ----------
    x : another state, shape (states,)
    parameters : overrides, SI

    Warns
    -----
    KinkWarning
        The damping law has no derivative at this state; the warning names the value given.

    Raises
    ------
    RequestError
        As for `static_equilibrium`.

    Examples
    --------
    >>> small = model.linearize(crank_angle=4.2)  # [rad]
    >>> small.natural_frequencies.round()  # [Hz]
    array([1064., 1108., 2923., 4180.])
    """
    from ballpass.runtime.point.equilibrium import instant, static_equilibrium
    from ballpass.runtime.point.linearize import linearize  # with SciPy

    numbers = model.numbers(parameters)
    time = instant(model, numbers, t, crank_angle)
    state = static_equilibrium(model, numbers, t=time).x if x is None else x
    return linearize(model, numbers, t=time, x=state, at_equilibrium=x is None)
