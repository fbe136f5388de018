"""Measure, then write the page: ``python -m benchmarks [PART ...] [--quick] [--fresh] [--out FOLDER]``.

Results go to benchmarks/results/*.json, one file a part, as soon as it is done.  A part whose file was measured on
the same code and machine is kept: an interrupted run goes on where it stopped.  ``--fresh`` measures again.  A name
stands for all parts that begin with it: ``work_precision``, ``sensitivity``.  Every file says which state of the code
it was measured at, and the page says so where they differ.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks import (
    arithmetic,
    costs,
    ensemble,
    jacobians,
    provenance,
    regeneration,
    report,
    sensitivity_cost,
    sensitivity_error,
    work_precision,
)
from benchmarks.machine import load, machine
from benchmarks.problem import CASES, ROOT, Case, models

RESULTS = ROOT / "benchmarks" / "results"


def main(arguments: list[str] | None = None) -> int:
    """Run what is asked for; 0 when all is there."""
    options = _parse(arguments)
    folder = options.out / "results" if options.out else RESULTS
    folder.mkdir(parents=True, exist_ok=True)
    state = provenance.present()
    key = _key(options.quick, state)
    parts = parts_of(options.quick)
    unknown = [wanted for wanted in options.parts if not any(name.startswith(wanted) for name in parts)]
    if unknown:
        _say(f"no part begins with {', '.join(unknown)}; there are {', '.join(parts)}")
        return 2

    for name, part in parts.items():
        path = folder / f"{name}.json"
        if options.parts and not any(name.startswith(wanted) for wanted in options.parts):
            continue
        if not options.fresh and _kept(path, key):
            _say(f"{name}: measured before on this code and machine, kept")
            continue
        begun = time.perf_counter()
        before = provenance.present()
        result = {"key": key, "state": before.record(), "quick": options.quick, "machine": machine(), **part()}
        result["machine"]["load_after"] = load()
        after = provenance.digest()
        if not state.digest == before.digest == after:
            _say(f"{name}: the code changed meanwhile; its results say so, and it is measured again next time")
            result |= {"key": "", "state": {**before.record(), "digest": f"{state.digest} to {after}"}}
        result["seconds"] = round(time.perf_counter() - begun, 1)
        temporary = path.with_suffix(".tmp")
        temporary.write_text(_compact(result), encoding="utf-8")
        temporary.replace(path)
        _say(f"{name}: {result['seconds']} s")
    page = (options.out or ROOT / "docs") / "benchmarks.md"
    if not any(folder.glob("work_precision_*.json")):
        _say("no page is written: it needs a part work_precision")
        return 0
    report.write(folder, page)
    print(page if options.out else page.relative_to(ROOT))
    return 0


def parts_of(quick: bool) -> dict[str, Callable[[], dict[str, Any]]]:
    """What measures each part, by the name of its file of results."""
    effort = work_precision.QUICK if quick else work_precision.Effort()
    rounds = 2 if quick else 15
    light = CASES[-1]
    precision = {
        f"work_precision_{case.key}": partial(_work_precision, case, effort)
        for case in (CASES[1:2] if quick else CASES)
    }
    return {
        **precision,
        "one_step": lambda: costs.one_step(light, models()[light.scene], rounds),
        "balls": lambda: costs.balls(rounds, costs.BALLS[:2] if quick else costs.BALLS),
        "sensitivity_cost": lambda: (
            sensitivity_cost.sensitivity_cost(2, (1, 5), (1,)) if quick else sensitivity_cost.sensitivity_cost(rounds)
        ),
        "sensitivity_error": lambda: (
            sensitivity_error.sensitivity_error(2, _say, (1e-4, 1e-6))
            if quick
            else sensitivity_error.sensitivity_error(24, _say)
        ),
        "ensemble": lambda: ensemble.throughput(*((32, 2) if quick else (10_000, 7))),
        "jacobians": lambda: jacobians.measure(rounds),
        "arithmetic": lambda: arithmetic.arithmetic(2 if quick else 32, rounds),
        "regeneration": lambda: regeneration.regeneration(1 if quick else 5),
    }


def _work_precision(case: Case, effort: work_precision.Effort) -> dict[str, Any]:
    return work_precision.measure(case, models()[case.scene], effort, _say)


def _parse(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="two minutes instead of 25; numbers mean little")
    parser.add_argument("--fresh", action="store_true", help="measure again what is there")
    parser.add_argument("parts", nargs="*", metavar="PART", help="only the parts whose names begin so")
    parser.add_argument("--out", type=Path, help="folder for results and page, instead of benchmarks/results and docs")
    return parser.parse_args(arguments)


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _compact(result: dict[str, Any]) -> str:
    """JSON with one line for each innermost record or list."""

    def text(value: Any, depth: int) -> str:
        flat = json.dumps(value, ensure_ascii=False)
        inside = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
        if len(flat) <= 300 or not any(isinstance(item, dict | list) for item in inside):
            return flat
        inner = " " * (depth + 1)
        if isinstance(value, list):
            rows = [text(item, depth + 1) for item in value]
            return "[\n" + ",\n".join(inner + row for row in rows) + f"\n{' ' * depth}]"
        rows = [f"{json.dumps(name)}: {text(item, depth + 1)}" for name, item in value.items()]
        return "{\n" + ",\n".join(inner + row for row in rows) + f"\n{' ' * depth}}}"

    return text(result, 0) + "\n"


def _kept(path: Path, key: str) -> bool:
    try:
        return bool(json.loads(path.read_text(encoding="utf-8"))["key"] == key)
    except (OSError, ValueError, KeyError):
        return False


def _key(quick: bool, state: provenance.State) -> str:
    """Digest of the code that is measured and that measures, and of the machine without its load."""
    facts = {name: value for name, value in machine().items() if name != "load"}
    return hashlib.sha256(json.dumps([quick, facts, state.digest]).encode()).hexdigest()[:16]


def _apart() -> None:
    """Give Python a standard output of its own: numbalsoda's DOP853 prints past it, in Fortran, what seems stiff."""
    sys.stdout.flush()
    sys.stdout = os.fdopen(os.dup(1), "w", encoding="utf-8")
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.close(nowhere)


if __name__ == "__main__":
    _apart()
    sys.exit(main())
