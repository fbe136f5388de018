"""Part 4: throughput of ensembles against threads and lanes, ``python -m benchmarks.ensemble [--members N]``.

In: the press with its three dampings, every member with parameters of its own.  Out: members times cycles a second.

The single-run stepper is called member by member on segments made beforehand, so that nothing but its driver counts;
the ensembles bring their own preparation (constants, assembly, segments, magnitudes).  How to read the table: the
column "lanes" is what one core gains, in processor time, which a busy machine distorts least; "threads" is wall time of
one thread over that of two, and "possible" the same for two threads that hash bytes and share nothing: on a machine
that is busy otherwise, or that gives this process less than two processors, both are near one.

Lanes know one explicit method, Dormand-Prince 5(4), while single runs choose between it and DOP853.  So lanes are
compared twice: with single runs as they choose, and with both told to take the same method.  Errors of all are measured
against runs whose kinks are located, at a tight tolerance.
"""

from __future__ import annotations

import argparse
import hashlib
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from ballpass.runtime.many.member_segments import moments, stretches
from ballpass.runtime.many.members import Span, make_members
from ballpass.runtime.model import Model
from ballpass.runtime.native.stepper import METHODS, Family, Segments
from benchmarks.problem import CASES, Case, models, parameter_sets
from benchmarks.tables import table
from benchmarks.timing import Entry, digits, interleave, spread

CYCLES, TRANSIENT, RTOL = 2, 1, 1e-6

#: Ways on one thread, in the order of the table.
_ONE_THREAD = ("single", "one by one, 1", "end, 1", "states, 1", "balls, 1")

#: Members whose errors are measured, the tolerance of their reference, and what is compared: rms and peak.
CHECKED = 64
REFERENCE_RTOL = 1e-11
QUANTITIES = ("rms:inner.y", "max:ball.force")

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
        "rounds": rounds,
        "checked": min(CHECKED, members),
        "cycles": CYCLES,
        "rtol": RTOL,
        "reference_rtol": REFERENCE_RTOL,
        "cases": [_case(case, by_scene[case.scene], members, rounds) for case in CASES],
    }


def _case(case: Case, model: Model, members: int, rounds: int) -> dict[str, Any]:
    sets = parameter_sets(case, model, members)
    if not model.ensemble_driver.lanes > 1:  # compiles it, before anything is timed
        raise RuntimeError("the ensembles' driver has no lanes")
    # a part is enough for the slow ones
    few, some = max(8, members // 10), max(8, members // 4)
    runs = _single_runs(model, sets[:few])
    same = "stepper-rodas5p" if runs(Family.AUTO) == Family.RODAS5P else "stepper-dp54"
    calls: dict[str, tuple[int, Callable[[], object]]] = {
        "single": (few, lambda: runs(Family.AUTO)),
        "single, same method": (few, lambda: runs(METHODS[same])),
        "one by one, 1": (few, _ensemble(model, sets[:few], KEPT["end"], 1, lanes=False)),
        "end, same method, 1": (some, _ensemble(model, sets[:some], KEPT["end"], 1, method=same)),
    }
    for kind, kept in KEPT.items():
        for threads in (1, 2) if kind == "end" else (1,):
            count = members if kind == "end" else some
            calls[f"{kind}, {threads}"] = (count, _ensemble(model, sets[:count], kept, threads))
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

    interleave([Entry(call=visit(name)) for name in calls], rounds=rounds)
    pairs = {
        "lanes": (cpu["single"], cpu["end, 1"]),
        "lanes_same": (cpu["single, same method"], cpu["end, same method, 1"]),
        "threads": (wall["end, 1"], wall["end, 2"]),
        "possible": (wall["hash, 1"], wall["hash, 2"]),
    }
    # a visit calls several times where that takes little
    ratios = {
        name: spread(
            [float(np.median(a) / np.median(b)) for a, b in zip(_visits(x, rounds), _visits(y, rounds), strict=True)]
        )
        for name, (x, y) in pairs.items()
    }
    return {
        "case": case.key,
        "words": case.words,
        "same_method": same,
        "rows": {
            name: {
                "members": calls[name][0],
                "cpu_a_cycle": spread(cpu[name]),
                "per_second": digits(1.0 / float(np.median(wall[name]))),
            }
            for name in calls
        },
        "ratios": ratios,
        "errors": _errors(model, sets[: min(CHECKED, members)], same),
    }


def _visits(times: list[float], rounds: int) -> list[np.ndarray]:
    return np.array_split(np.array(times), rounds)


def _errors(model: Model, sets: list[dict[str, float]], same: str) -> dict[str, dict[str, Any]]:
    """Relative errors of rms and peak at the tolerance of the ensembles, of lanes and single runs."""

    def values(**asked: Any) -> np.ndarray:
        found = model.simulate_many(sets, QUANTITIES, cycles=CYCLES, transient=TRANSIENT, **asked)
        if found.failures:
            raise RuntimeError(f"{len(found.failures)} members failed: {found.failures[0]}")
        return np.array([found[name] for name in QUANTITIES])

    expected = values(rtol=REFERENCE_RTOL, kinks="located")
    asked: dict[str, dict[str, Any]] = {
        "lanes": {},
        "single": {"lanes": False},
        "single, same method": {"lanes": False, "method": same},
    }
    found = {}
    for name, more in asked.items():
        wrong = np.abs(values(rtol=RTOL, **more) / expected - 1.0)
        found[name] = {what: spread(row) for what, row in zip(("rms", "peak"), wrong, strict=True)}
    return found


def _ensemble(
    model: Model,
    sets: list[dict[str, float]],
    kept: tuple[str, ...],
    threads: int,
    *,
    lanes: bool = True,
    method: str | None = None,
) -> Callable[[], object]:
    return lambda: model.simulate_many(
        sets, kept, cycles=CYCLES, transient=TRANSIENT, rtol=RTOL, method=method, threads=threads, lanes=lanes
    )


def _hashing(threads: int) -> Callable[[], object]:
    """A fixed amount of work without the interpreter's lock, shared by threads."""
    data = bytes(100_000_000)

    def run() -> None:
        with ThreadPoolExecutor(max_workers=threads) as pool:
            for done in [pool.submit(hashlib.sha256, data) for _ in range(2)]:
                done.result()

    return run


def _single_runs(model: Model, sets: list[dict[str, float]]) -> Callable[[Family], Family]:
    """The stepper of single runs over these members, without reductions and outputs; tells the method it ended with."""
    members = make_members(model, sets)
    turns = np.array([model.period(one) for one in sets])
    span = Span(durations=CYCLES * turns, turns=turns, starts=TRANSIENT * turns)
    everybody = np.arange(len(sets))
    (arrays,) = stretches(model, members, span, everybody)
    looked_at = moments(model, members, span, everybody)
    tolerance = RTOL * model.ensemble_driver.magnitudes(arrays, members.initial, *looked_at)
    runs = []
    for k, (a, b) in enumerate(zip(arrays.first[:-1], arrays.first[1:], strict=True)):
        segments = Segments(
            times=arrays.times[a + k : b + k + 1].copy(),
            inputs=arrays.inputs[a:b].copy(),
            restarts=arrays.restarts[a:b].copy(),
        )
        runs.append((tolerance[k], arrays.p[k], arrays.c[k], members.initial[k], segments))

    def run(family: Family) -> Family:
        for allowed, p, c, start, segments in runs:
            outcome = model.stepper.run(
                family=family,
                tolerance=allowed,
                p=p,
                c=c,
                x=start.copy(),
                segments=segments,
                output_times=np.zeros(0),
                output_states=None,
            )
        return outcome.family

    return run


def lines(result: dict[str, Any]) -> list[str]:
    """The tables in Markdown: times and throughput, then lanes against single runs and the errors of both."""
    head = (
        "damping",
        *("single run, µs", "one by one, µs", "lanes, µs", "with states, µs", "with balls, µs"),
        *("members·cycles/s, 1 thread", "2 threads", "threads", "possible"),
    )
    rows, against = [], []
    for case in result["cases"]:
        micro = [f"{1e6 * case['rows'][name]['cpu_a_cycle']['median']:.3g}" for name in _ONE_THREAD]
        rates = [f"{case['rows'][f'end, {n}']['per_second']:.4g}" for n in (1, 2)]
        rows.append((case["words"], *micro, *rates, *(times(case["ratios"][name]) for name in ("threads", "possible"))))
        wrong = case["errors"]
        for what, ratio, name in (
            ("as each chooses", "lanes", "single"),
            (f"both {case['same_method'].removeprefix('stepper-')}", "lanes_same", "single, same method"),
        ):
            cells = [f"{wrong[who][of]['median']:.1e}" for of in ("rms", "peak") for who in (name, "lanes")]
            against.append((f"{case['words']}: {what}", times(case["ratios"][ratio]), *cells))
    errors = ("rms, single", "rms, lanes", "peak, single", "peak, lanes")
    return [*table(head, rows), "", *table(("lanes against single runs", "single / lanes", *errors), against)]


def times(ratio: dict[str, float]) -> str:
    """A ratio with the 10th and 90th percentile over the rounds."""
    return f"{ratio['median']:.2f}× ({ratio['p10']:.2f} … {ratio['p90']:.2f})"


def main(arguments: list[str] | None = None) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.ensemble", description=__doc__)
    parser.add_argument("--members", type=int, default=1024)
    parser.add_argument("--rounds", type=int, default=7)
    options = parser.parse_args(arguments)
    print("\n".join(lines(throughput(options.members, options.rounds))))
    return 0


if __name__ == "__main__":
    sys.exit(main())
