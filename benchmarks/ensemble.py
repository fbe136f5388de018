"""Part 4: throughput of ensembles against threads and lanes, ``python -m benchmarks.ensemble [--members N]``.

In: the press with its three dampings, every member with parameters of its own.  Out: members times cycles a second.

The single-run stepper is called member by member on segments made beforehand, so that nothing but its driver counts;
the ensembles bring their own preparation (constants, assembly, segments, magnitudes).  How to read the table: the
column "lanes" is what one core gains, in processor time, which a busy machine distorts least; "threads" is wall time of
one thread over that of two, and "possible" the same for two threads that hash bytes and share nothing: on a machine
that is busy otherwise, or that gives this process less than two processors, both are near one.
"""

from __future__ import annotations

import argparse
import hashlib
import math
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from benchmarks.problem import CASES, Case, models, parameter_sets
from benchmarks.tables import table
from benchmarks.timing import Entry, digits, interleave
from raceway.runtime.ensembles.member_segments import member_arrays
from raceway.runtime.ensembles.members import Span, make_members
from raceway.runtime.integrate.stepper import Family, Segments
from raceway.runtime.model import Model

CYCLES, TRANSIENT, RTOL = 2, 1, 1e-6

#: Ways on one thread, in the order of the table.
_ONE_THREAD = ("single", "one by one, 1", "end, 1", "states, 1", "balls, 1")

#: Observables of the kinds that cost: only the end, reductions of states, reductions of balls.
KEPT = {
    "end": ("end:inner.y",),
    "states": ("rms:inner.y", "range:inner.y"),
    "balls": ("max:ball.force", "rms:inner.y"),
}


def throughput(members: int, rounds: int) -> dict[str, Any]:
    """Members times cycles a second, for every case; medians over interleaved rounds."""
    by_scene = models()
    return {
        "members": members,
        "cycles": CYCLES,
        "rtol": RTOL,
        "cases": [_case(case, by_scene[case.scene], members, rounds) for case in CASES],
    }


def _case(case: Case, model: Model, members: int, rounds: int) -> dict[str, Any]:
    sets = parameter_sets(case, model, members)
    if not model.ensemble_driver.lanes > 1:  # compiles it, before anything is timed
        raise RuntimeError("the ensembles' driver has no lanes")
    # a quarter is enough for the slow one
    few = max(8, members // 4)
    calls: dict[str, tuple[int, Callable[[], object]]] = {"single": (few, _single_runs(model, sets[:few]))}
    calls["one by one, 1"] = (few, _ensemble(model, sets[:few], KEPT["end"], 1, lanes=False))
    for kind, kept in KEPT.items():
        for threads in (1, 2) if kind == "end" else (1,):
            calls[f"{kind}, {threads}"] = (members, _ensemble(model, sets, kept, threads))
    calls |= {f"hash, {threads}": (1, _hashing(threads)) for threads in (1, 2)}
    cpu: dict[str, list[float]] = {name: [] for name in calls}
    wall: dict[str, list[float]] = {name: [] for name in calls}

    def visit(name: str) -> Callable[[int], None]:
        count, call = calls[name]

        def timed(_: int) -> None:
            begun = (time.process_time(), time.perf_counter())
            call()
            cpu[name].append((time.process_time() - begun[0]) / (count * CYCLES))
            wall[name].append((time.perf_counter() - begun[1]) / (count * CYCLES))

        return timed

    interleave([Entry(call=visit(name)) for name in calls], rounds=rounds, budget=math.inf)
    return {
        "case": case.key,
        "words": case.words,
        "rows": {
            name: {
                "cpu_a_cycle": digits(float(np.median(cpu[name]))),
                "per_second": digits(1.0 / float(np.median(wall[name]))),
            }
            for name in calls
        },
        "lanes": digits(float(np.median(np.array(cpu["single"][:rounds]) / np.array(cpu["end, 1"][:rounds])))),
        "threads": digits(float(np.median(np.array(wall["end, 1"][:rounds]) / np.array(wall["end, 2"][:rounds])))),
        "possible": digits(float(np.median(np.array(wall["hash, 1"][:rounds]) / np.array(wall["hash, 2"][:rounds])))),
    }


def _ensemble(
    model: Model, sets: list[dict[str, float]], kept: tuple[str, ...], threads: int, *, lanes: bool = True
) -> Callable[[], object]:
    return lambda: model.simulate_many(
        sets, kept, cycles=CYCLES, transient=TRANSIENT, rtol=RTOL, threads=threads, lanes=lanes
    )


def _hashing(threads: int) -> Callable[[], object]:
    """A fixed amount of work without the interpreter's lock, shared by threads."""
    data = bytes(100_000_000)

    def run() -> None:
        with ThreadPoolExecutor(max_workers=threads) as pool:
            for done in [pool.submit(hashlib.sha256, data) for _ in range(2)]:
                done.result()

    return run


def _single_runs(model: Model, sets: list[dict[str, float]]) -> Callable[[], object]:
    """The stepper of single runs over these members, without reductions and outputs."""
    members = make_members(model, sets)
    turns = np.array([model.period(one) for one in sets])
    span = Span(durations=CYCLES * turns, turns=turns, starts=TRANSIENT * turns)
    arrays, (first, inputs, horizons) = member_arrays(model, members, span, np.arange(len(sets)))
    tolerance = RTOL * model.ensemble_driver.magnitudes(arrays, members.initial, first, inputs, horizons)
    runs = []
    for k, (a, b) in enumerate(zip(arrays.first[:-1], arrays.first[1:], strict=True)):
        segments = Segments(
            times=arrays.times[a + k : b + k + 1].copy(),
            inputs=arrays.inputs[a:b].copy(),
            restarts=arrays.restarts[a:b].copy(),
        )
        runs.append((tolerance[k], arrays.p[k], arrays.c[k], members.initial[k], segments))

    def run() -> None:
        for allowed, p, c, start, segments in runs:
            model.stepper.run(
                family=Family.AUTO,
                tolerance=allowed,
                p=p,
                c=c,
                x=start.copy(),
                segments=segments,
                output_times=np.zeros(0),
                output_states=None,
            )

    return run


def lines(result: dict[str, Any]) -> list[str]:
    """The table in Markdown."""
    head = (
        "damping",
        *("single run, µs", "one by one, µs", "lanes, µs", "with states, µs", "with balls, µs"),
        *("lanes", "members·cycles/s, 1 thread", "2 threads", "threads", "possible"),
    )
    rows = []
    for case in result["cases"]:
        micro = [f"{1e6 * case['rows'][name]['cpu_a_cycle']:.3g}" for name in _ONE_THREAD]
        rates = [f"{case['rows'][f'end, {n}']['per_second']:.4g}" for n in (1, 2)]
        rows.append(
            (
                case["words"],
                *micro,
                f"{case['lanes']:.2f}×",
                *rates,
                f"{case['threads']:.2f}×",
                f"{case['possible']:.2f}×",
            )
        )
    return table(head, rows)


def main(arguments: list[str] | None = None) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.ensemble", description=__doc__)
    parser.add_argument("--members", type=int, default=1024)
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args(arguments)
    print("\n".join(lines(throughput(options.members, options.rounds))))
    return 0


if __name__ == "__main__":
    sys.exit(main())
