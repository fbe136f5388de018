"""Cost of derivatives of a run by their number: time over that of the plain run, and over central differences."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ballpass.runtime.model import Model
from benchmarks.problem import CASES
from benchmarks.timing import interleave, spread, timed

RTOL = 1e-5
COUNTS = (1, 5, 10, 20, 40)
#: Quantities of the full query, by all parameters, each derivative with its certificate.
QUERY = ["peak_ball_force", "rms:inner.y", "range:inner.y", "mean:inner.y", "max:drive_torque"]


def measure(rounds: int, quick: bool) -> dict[str, Any]:
    """Times of `model.sensitivities` over `model.simulate`, for every case, and of the full query [s]."""
    cases: dict[str, Any] = {}
    for case in CASES:
        model, numbers = case.model(), dict(case.changes)
        names = list(model.parameters)
        counts = [count for count in COUNTS if count <= len(names)]
        calls = [_plain(model, numbers), *(_derivatives(model, numbers, names[:count]) for count in counts)]
        for call in calls:  # compiles
            call()
        times = interleave(calls, rounds)
        ratios = times[:, 1:] / times[:, :1]
        cases[case.words] = {
            "plain": spread(times[:, 0]),
            "ratios": {count: spread(ratios[:, k]) for k, count in enumerate(counts)},
        }
    model = CASES[1].model()
    names, quantities = (list(model.parameters)[:1], QUERY[:1]) if quick else (list(model.parameters), QUERY)
    model.sensitivity(QUERY[:1], names[:1])  # compiles
    query = {
        "quantities": quantities,
        "parameters": len(names),
        "seconds": timed(lambda: model.sensitivity(quantities, names)),
    }
    return {"rtol": RTOL, "cases": cases, "query": query}


def _plain(model: Model, numbers: dict[str, float]) -> Callable[[], object]:
    return lambda: model.simulate(1, parameters=numbers, rtol=RTOL, transient=0)


def _derivatives(model: Model, numbers: dict[str, float], names: list[str]) -> Callable[[], object]:
    return lambda: model.sensitivities(names, 1, parameters=numbers, rtol=RTOL)
