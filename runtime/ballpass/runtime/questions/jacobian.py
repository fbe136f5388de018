"""Derivatives at one instant, each checked by differences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated

from ballpass.runtime.contract.options import Check, CrankAngle, Instant, Option
from ballpass.runtime.questions import option_names
from ballpass.runtime.questions.question import Question

if TYPE_CHECKING:
    from ballpass.runtime.certify.jacobian_check import CheckedJacobian
    from ballpass.runtime.point.point_model import PointModel

Of = Annotated[
    str | Sequence[str],
    Option(
        words="What to differentiate: `rhs`, a quantity (also one that `run.outputs` does not name), a pattern as "
        '`"reaction.A.*"`. May be repeated.',
        names=option_names.functions,
    ),
]
Wrt = Annotated[
    str | Sequence[str],
    Option(
        words="By what: `states`, a state, `time`, `crank_angle`, a number of the scene. May be repeated.",
        names=option_names.directions,
    ),
]
State = Annotated[
    str,
    Option(
        words="Position of the rings: `equilibrium` (static, under the load of that instant) or `initial`.",
        choices=("equilibrium", "initial"),
    ),
]


@Question(name="jacobian", stage="differentiate", runs=False)
def checked_jacobian(
    model: PointModel,
    of: Of,
    wrt: Wrt,
    *,
    crank_angle: CrankAngle = None,
    t: Instant = None,
    state: State = "equilibrium",
    check: Check = True,
    parameters: Mapping[str, float] | None = None,
) -> CheckedJacobian:
    """Derivatives of quantities at one instant, from generated code, each checked by differences.

    The exit code of the command is 1 where the two disagree.

    Parameters
    ----------
    parameters : overrides, SI

    Raises
    ------
    RequestError
        Unknown names, all at once, or an instant that is none.

    Examples
    --------
    >>> found = model.checked_jacobian("drive_torque", "mechanism.driver.speed", t=0.01)
    >>> f"{found.value.item():.3g}", found.verdict.value
    ('-0.0425', 'verified')
    """
    from ballpass.runtime.certify.jacobian_check import checked_jacobian
    from ballpass.runtime.point.equilibrium import instant, static_equilibrium

    numbers = model.numbers(parameters)
    time = instant(model, numbers, t, crank_angle)
    x = static_equilibrium(model, numbers, t=time).x if model.manifest.bearings and state == "equilibrium" else None
    return checked_jacobian(model, numbers, of, wrt, t=time, x=x, check=check)
