"""Measure, then write the page: ``python -m benchmarks [PART ...] [--quick] [--fresh] [--out FOLDER]``.

Results go to benchmarks/results/*.json, one file a part, as soon as it is done.  A part whose file was measured on
the same code and machine is kept: an interrupted run goes on where it stopped.  ``--fresh`` measures again.  A name
stands for all parts that begin with it: ``work_precision``, ``sensitivity``.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks import (
    arithmetic,
    costs,
    ensemble,
    jacobians,
    regeneration,
    report,
    sensitivity_cost,
    sensitivity_error,
    work_precision,
)
from benchmarks.machine import load, machine
from benchmarks.problem import ROOT

RESULTS = ROOT / "benchmarks" / "results"


def main(arguments: list[str] | None = None) -> int:
    """Run what is asked for; 0 when all is there."""
    options = _parse(arguments)
    folder = options.out / "results" if options.out else RESULTS
    folder.mkdir(parents=True, exist_ok=True)
    key = _key(options.quick)
    effort = work_precision.QUICK if options.quick else work_precision.Effort()
    rounds = 2 if options.quick else 15

    parts: dict[str, Callable[[], dict[str, Any]]] = {}
    cases = work_precision.cases()
    for case, model in cases[1:2] if options.quick else cases:
        parts[f"work_precision_{case.key}"] = lambda c=case, m=model: work_precision.measure(c, m, effort, _say)
    light, model_of_light = cases[-1]
    parts["one_step"] = lambda: costs.one_step(light, model_of_light, rounds)
    parts["balls"] = lambda: costs.balls(rounds, costs.BALLS[:2] if options.quick else costs.BALLS)
    parts["sensitivity_cost"] = lambda: (
        sensitivity_cost.sensitivity_cost(2, (1, 5), (1,))
        if options.quick
        else sensitivity_cost.sensitivity_cost(rounds)
    )
    parts["sensitivity_error"] = lambda: (
        sensitivity_error.sensitivity_error(2, _say, (1e-4, 1e-6))
        if options.quick
        else sensitivity_error.sensitivity_error(24, _say)
    )
    parts["ensemble"] = lambda: ensemble.throughput(*((32, 2) if options.quick else (10_000, 3)))
    parts["jacobians"] = lambda: jacobians.measure(rounds)
    parts["arithmetic"] = lambda: arithmetic.arithmetic(2 if options.quick else 32, rounds)
    parts["regeneration"] = lambda: regeneration.regeneration(1 if options.quick else 5)
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
        result = {"key": key, "quick": options.quick, "machine": machine(), **part()}
        result["machine"]["load_after"] = load()
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


def _parse(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument(
        "--quick", action="store_true", help="a minute instead of a quarter of an hour; numbers mean little"
    )
    parser.add_argument("--fresh", action="store_true", help="measure again what is there")
    parser.add_argument("parts", nargs="*", metavar="PART", help="only the parts whose names begin so")
    parser.add_argument("--out", type=Path, help="folder for results and page, instead of benchmarks/results and docs")
    return parser.parse_args(arguments)


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _compact(result: dict[str, Any]) -> str:
    """JSON with one line for each innermost record."""

    def text(value: Any, depth: int) -> str:
        flat = json.dumps(value, ensure_ascii=False)
        if len(flat) <= 300 or not isinstance(value, dict | list) or not value:
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


def _key(quick: bool) -> str:
    """Digest of the code that is measured and that measures, and of the machine without its load."""
    digest = hashlib.sha256()
    facts = {name: value for name, value in machine().items() if name != "load"}
    digest.update(json.dumps([quick, facts]).encode())
    for pattern in ("derive/**/*.py", "runtime/**/*.py", "runtime/**/*.[ch]", "benchmarks/*.py", "benchmarks/*.c"):
        for path in sorted(ROOT.glob(pattern)):
            if path.parent.name == "benchmarks" and path.stem in ("report", "figures"):
                continue
            digest.update(path.name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


if __name__ == "__main__":
    sys.exit(main())
