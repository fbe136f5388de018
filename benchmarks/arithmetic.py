"""Part 8: what `-ffast-math` would change and gain, ``python -m benchmarks.arithmetic``.

In: the cycles of part 1.  Out: differences of the quantities of interest between the stepper as it is (IEEE arithmetic,
no contraction) and compiled so that sums may be reordered and multiplications fused, in tolerances; and the time of one
over the other, paired.

The same driver, kernels and tolerance: what differs is rounding, and what contact makes of it.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import astuple
from typing import Any

import numpy as np

from ballpass.runtime.certify.trade import compile_fast_math
from ballpass.runtime.model import Model
from ballpass.runtime.native.stepper import End, Family, Stepper
from benchmarks.own import stepper_run
from benchmarks.problem import BUILD, CASES, Case, Member, errors, models, parameter_sets
from benchmarks.tables import table
from benchmarks.timing import Entry, digits, interleave, spread

#: Tolerance of the runs [1].
TOLERANCE = 1e-5


def arithmetic(members: int, rounds: int) -> dict[str, Any]:
    """Differences in tolerances and ratios of times, for every case."""
    by_scene = models()
    found = []
    for case in CASES:
        fast = compile_fast_math(by_scene[case.scene], BUILD / "generated" / case.scene)
        if fast is None:
            return {"tolerance": TOLERANCE, "members": members, "absent": "no C compiler", "cases": []}
        found.append(_case(case, by_scene[case.scene], fast.stepper, members, rounds))
    return {"tolerance": TOLERANCE, "members": members, "cases": found}


def _case(case: Case, model: Model, fast: Stepper, members: int, rounds: int) -> dict[str, Any]:
    ensemble = [Member(case, model, p) for p in parameter_sets(case, model, members)]
    plain = model.ensemble_driver.stepper  # of the same sources and switches as the fast one
    changes = []
    for member in ensemble:
        member.reference = _states(member, plain)
        changes.append(max(astuple(errors(member, _states(member, fast)))) / TOLERANCE)
    entries = [Entry(call=_call(ensemble, stepper)) for stepper in (plain, fast)]
    interleave(entries, rounds=rounds)
    slow, quick = (np.array(entry.times) for entry in entries)
    return {
        "case": case.key,
        "words": case.words,
        "change": {**spread(changes), "worst": digits(max(changes))},
        "time_over_ieee": spread((quick / slow).tolist()),
    }


def _call(ensemble: list[Member], stepper: Stepper) -> Callable[[int], object]:
    return lambda number: _states(ensemble[number % len(ensemble)], stepper)


def _states(member: Member, stepper: Stepper) -> np.ndarray:
    states, outcome = stepper_run(member, TOLERANCE, Family.AUTO, stepper=stepper)
    if outcome.end is not End.DONE:
        raise RuntimeError(f"{member.case.key}: the stepper ended early: {outcome.end.name}")
    return states


def lines(result: dict[str, Any]) -> list[str]:
    """The table in Markdown."""
    if "absent" in result:
        return [f"Not measured: {result['absent']}."]
    rows = [
        [
            case["words"],
            *(f"{case['change'][what]:.2g}" for what in ("median", "p90", "worst")),
            "{median:.3g}× ({p10:.3g} … {p90:.3g})".format(**case["time_over_ieee"]),
        ]
        for case in result["cases"]
    ]
    return table(["damping", "change, tolerances: median", "90 %", "worst", "time over IEEE"], rows)


def main(arguments: list[str] | None = None) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.arithmetic", description=__doc__)
    parser.add_argument("--members", type=int, default=32)
    parser.add_argument("--rounds", type=int, default=15)
    options = parser.parse_args(arguments)
    print("\n".join(lines(arithmetic(options.members, options.rounds))))
    return 0


if __name__ == "__main__":
    sys.exit(main())
