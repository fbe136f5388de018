"""An answer at several tolerances, so that each number is printed with the digits that all bear, or its ±.

In: what is asked, as a function of the tolerance.  Out: the answers, the first as it was asked for.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

from ballpass.runtime.contract.errors import SimulationError
from ballpass.runtime.report.digits import further, scatters, second_tolerance, shared
from ballpass.runtime.report.report import Report

_Answer = TypeVar("_Answer")

#: Where numbers have ± since they scatter.
SCATTERED = (
    "the motion amplifies small errors: another tolerance gives other numbers, within about their ±. Take statistics "
    "over many turns, or a shorter run."
)


def repeated(
    ask: Callable[[float | None], _Answer],
    report: Callable[[_Answer], Report],
    rtol: float,
    *,
    judged: Callable[[_Answer], Report] | None = None,
    integrated: bool = True,
) -> tuple[list[_Answer], Report]:
    """Answers (see `further`), and the report of the first with the digits that all bear.

    Parameters
    ----------
    ask : takes the tolerance, None for that of the request
    report : of an answer
    rtol : tolerance of the request [1]
    judged : report that also has numbers that are in files alone, to see whether the motion amplifies small errors
    integrated : False where nothing is, and no tolerance changes a digit
    """
    first = ask(None)
    found: Report = report(first)
    if not integrated:
        return [first], found
    try:
        with warnings.catch_warnings(action="ignore"):  # they are said of the first
            answers = further(first, ask, rtol, lambda two: scatters([(judged or report)(answer) for answer in two]))
    except SimulationError as fault:
        words = f"how many digits of these numbers hold is not known, for a run at another tolerance failed: {fault}"
        return [first], replace(found, warnings=[*found.warnings, words])
    reports = [report(answer) for answer in answers]
    found = shared(reports)
    how = f"Numbers have the digits that relative tolerances of {rtol:g} and {second_tolerance(rtol):g} share, or ±."
    said = [SCATTERED] if len(answers) > 3 else []
    return answers, replace(found, parts=[*found.parts, how], warnings=[*found.warnings, *said])
