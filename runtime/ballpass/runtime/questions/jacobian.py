"""Derivatives at one instant, each checked by differences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated

from ballpass.runtime.contract.options import Check, CrankAngle, Instant, Option
from ballpass.runtime.contract.units import printed_unit
from ballpass.runtime.questions import option_names
from ballpass.runtime.questions.question import Question
from ballpass.runtime.report.report import Report, ReportTable

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


def _report(result: CheckedJacobian) -> Report:
    """Entries with their check, and the notes; entries that are structurally zero are left out and counted."""
    from ballpass.runtime.certify.certificate import Verdict

    facts = result.to_dict()
    entries = facts["jacobian"]
    shown = [
        entry
        for entry in entries
        if entry["verdict"] == Verdict.DISAGREES.value
        or entry["value"] != 0.0
        or entry["sides"]
        or len(result.rows) == 1
    ]
    agreed = all(entry["verdict"] == Verdict.VERIFIED.value for entry in shown)  # the title says so for all
    rows = []
    for entry in shown:
        value, second = (None if entry[key] is None else f"{entry[key]:z.7g}" for key in ("value", "second"))
        if entry["sides"]:
            value = "{:z.7g} or {:z.7g}".format(*entry["sides"])
        verdict = [] if agreed else [entry["verdict"]]
        unit = printed_unit(entry["unit"])
        rows.append((entry["of"], entry["wrt"], value or "not finite", second or "", unit, *verdict))
    table = ReportTable(
        title=f"Derivatives at t = {result.time:.6g} s: {result.verdict.value}",
        heads=("quantity", "parameter", "derivative", "by differences", "unit", *([] if agreed else ["verdict"])),
        rows=rows,
        right=("derivative", "by differences"),
    )
    still = len(entries) - len(shown)
    disagrees = "the two routes disagree; both numbers are shown. " + " ".join(result.notes)
    return Report(
        parts=(table, *([f"{still} more {'is' if still == 1 else 'are'} zero."] if still else []), *result.notes),
        facts=facts,
        records=entries,
        index=("of", "wrt"),
        fault=disagrees if result.verdict is Verdict.DISAGREES else "",
    )


@Question(name="jacobian", report=_report, stage="differentiate", runs=False)
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
    from ballpass.runtime.point.run_start import run_numbers

    numbers = run_numbers(model, parameters)
    time = instant(model, numbers, t, crank_angle)
    x = static_equilibrium(model, numbers, t=time).x if model.manifest.bearings and state == "equilibrium" else None
    return checked_jacobian(model, numbers, of, wrt, t=time, x=x, check=check)
