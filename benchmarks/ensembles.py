"""Throughput of ensembles: members one by one, in SIMD lanes on one thread, in lanes on all threads."""

from __future__ import annotations

import os
import time
from typing import Any

from benchmarks.problem import CASES, parameter_sets
from benchmarks.timing import spread

CYCLES, TRANSIENT, RTOL = 2, 1, 1e-6
#: Reductions that cost differently: the end alone, of states, of balls, peak and life of the bearing.
ASKED = {
    "end": ["end:inner.y"],
    "states": ["rms:inner.y", "range:inner.y"],
    "balls": ["max:ball.force", "rms:inner.y"],
    "life": ["max:ball.force", "life"],
}


def measure(members: int, rounds: int) -> dict[str, Any]:
    """Members times cycles a second of each way, for every case; medians over interleaved rounds."""
    threads = os.cpu_count() or 1
    cases = {}
    for case in CASES:
        model = case.model()
        sets = parameter_sets(case, model, members)
        ways: dict[str, dict[str, Any]] = {
            "one by one": {"of": ASKED["end"], "lanes": False, "threads": 1},
            **{f"lanes, {kind}": {"of": asked, "lanes": True, "threads": 1} for kind, asked in ASKED.items()},
            f"lanes, balls, {threads} threads": {"of": ASKED["balls"], "lanes": True, "threads": threads},
        }
        taken: dict[str, list[float]] = {way: [] for way in ways}
        for number in range(rounds + 1):
            for way, options in ways.items():
                some = sets if options["lanes"] else sets[: max(8, members // 10)]
                asked, lanes, count = options["of"], options["lanes"], options["threads"]
                begun = time.perf_counter()
                found = model.simulate_many(
                    some, asked, cycles=CYCLES, transient=TRANSIENT, rtol=RTOL, lanes=lanes, threads=count
                )
                if found.failures:
                    raise RuntimeError(f"{len(found.failures)} members failed: {found.failures[0]}")
                if number:  # the first round compiles
                    taken[way].append(len(some) * CYCLES / (time.perf_counter() - begun))
        cases[case.words] = {way: spread(values) for way, values in taken.items()}
    return {"members": members, "cycles": CYCLES, "rtol": RTOL, "cases": cases}
