"""Derivatives of quantities by parameters, with a certificate for each number."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, Literal

from ballpass.runtime.contract.defaults import DERIVATIVE_RTOL
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.options import Check, Cycles, Duration, Option, SensitivityRtol, TightRtol, Transient
from ballpass.runtime.contract.parameters import real
from ballpass.runtime.questions import option_names
from ballpass.runtime.questions.question import Question
from ballpass.runtime.show.progress import shown_steps

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ballpass.runtime.certify.sensitivity_report import SensitivityReport
    from ballpass.runtime.point.point_model import PointModel

Of = Annotated[
    str | Sequence[str] | None,
    option_names.quantity(
        "Quantity: `max:ball.force` (or `peak_ball_force`), `rms:inner.y`, `value:inner.y@240deg`, `drive_work` "
        "… May be repeated. Peak ball force and motion of the rings if none is given."
    ),
]
Wrt = Annotated[
    str | Sequence[str] | None,
    Option(
        words='Parameter by its path in the scene, or a pattern, as `"bearing.*"`. May be repeated. All if none is '
        "given.",
        shown="P",
        names=option_names.parameters,
    ),
]
Method = Annotated[
    str,
    Option(
        words="Of the derivatives: `auto`, or a stepper's name.",
        shown="NAME",
        names=option_names.differentiating_methods,
    ),
]


def _figures(_model: Any, report: SensitivityReport, _parameters: Any) -> Iterator[tuple[str, Figure]]:
    from ballpass.runtime.plot.tornado import tornados

    return tornados(report)


@Question(stage="differentiate", figures=_figures, steady=True)
def sensitivity(
    model: PointModel,
    of: Of = None,
    wrt: Wrt = None,
    cycles: Cycles = None,
    *,
    duration: Duration = None,
    transient: Transient = None,
    parameters: Mapping[str, float] | None = None,
    method: Method = "auto",
    check: Check = True,
    rtol: TightRtol = None,
    sensitivity_rtol: SensitivityRtol = None,
    samples_per_cycle: int | None = None,
    kinks: Literal["stepped-over", "located"] | None = None,
    agreement: float | None = None,
    progress: Callable[[str, float], None] | bool | None = None,
) -> SensitivityReport:
    """Differentiate quantities of interest by parameters, and check every derivative by a second route.

    Where the two routes disagree the command reports both numbers, and its exit code is 1. Charts rank the parameters
    by their effect.

    Parameters
    ----------
    parameters : overrides, SI
    samples_per_cycle : without effect since quadratures have their nodes in the steps of the run
    kinks : as for `sensitivities`
    agreement : relative disagreement of both routes that is allowed
    progress : called with words and a finished fraction; else as for `simulate`

    Raises
    ------
    RequestError
        A wrong request, unknown names, or a law whose force jumps.
    SimulationError
        The computation failed.

    Examples
    --------
    >>> report = model.sensitivity("rms:inner.y", "bearing.clearance", cycles=3)
    >>> pair = report["rms:inner.y", "bearing.clearance"]
    >>> f"{pair.derivative:.2f} {pair.unit}, {pair.check.verdict.value}"
    '0.28 m/m, verified'
    """
    from ballpass.runtime.certify.certificate import AGREEMENT
    from ballpass.runtime.certify.sensitivity_query import Query, answer, length_request

    if agreement is not None and not 0.0 < real(agreement) < 1.0:
        raise RequestError(f"agreement: a number between 0 and 1 is expected, not {agreement!r}.")
    query = Query(
        of=of,
        wrt=wrt,
        request=length_request(model, cycles, duration, transient),
        method=method,
        check=check,
        rtol=DERIVATIVE_RTOL if rtol is None else rtol,
        sensitivity_rtol=DERIVATIVE_RTOL if sensitivity_rtol is None else sensitivity_rtol,
        kinks=kinks,
        agreement=AGREEMENT if agreement is None else agreement,
    )
    numbers = model.numbers(parameters)
    with shown_steps("differentiating", progress) as tell:
        return answer(model, numbers, replace(query, progress=tell))
