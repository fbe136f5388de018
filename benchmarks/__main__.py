"""Measure and write the page: ``python -m benchmarks [--quick] [--draw] [--out FOLDER] [PART ...]``."""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import os
import platform
import subprocess
import sys
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from ballpass.runtime.native.compilers import find_compiler
from benchmarks import coupling, ensembles, first_use, page, preparation, questions, sensitivities, work_precision
from benchmarks.problem import CASES, ROOT

PACKAGES = ("casadi", "numpy", "scipy", "sympy", "numba", "numbalsoda", "scikit-sundae", "jax", "diffrax", "exudyn")


def parts(quick: bool) -> dict[str, Callable[[], dict[str, Any]]]:
    """What is measured, by the name of its file of results."""
    effort = work_precision.QUICK if quick else work_precision.Effort()
    return {
        "work_precision": lambda: {case.key: work_precision.measure(case, effort) for case in CASES},
        "coupling": lambda: coupling.measure(1 if quick else 15),
        "ensembles": lambda: ensembles.measure(64 if quick else 10_000, 1 if quick else 5),
        "sensitivities": lambda: sensitivities.measure(1 if quick else 9, quick),
        "preparation": lambda: preparation.measure(1 if quick else 5),
        "first_use": lambda: first_use.measure(1 if quick else 3),
        "questions": lambda: questions.measure(1, 4) if quick else questions.measure(5),
    }


def state() -> dict[str, str]:
    """Commit, date and machine; no paths, no names of machines."""
    commit = _said("git", "describe", "--always", "--abbrev=12") or "unknown"
    if _said("git", "status", "--porcelain", ".", ":!benchmarks/results", ":!docs"):  # these a part writes itself
        commit += "-dirty"
    compiler = find_compiler()
    facts = (
        _processor(),
        f"{os.cpu_count()} cores, vectors of {CASES[0].model().ensemble_driver.lanes} doubles",
        f"{platform.system()} {platform.machine()}",
        _said(*compiler.command, "--version").partition("\n")[0] if compiler else "no compiler",
        f"Python {platform.python_version()}",
        *(f"{name} {_version(name)}" for name in PACKAGES),
    )
    return {"commit": commit, "date": f"{datetime.now(UTC):%Y-%m-%d}", "machine": ", ".join(filter(None, facts))}


def _said(*command: str) -> str:
    try:
        return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False).stdout.strip()
    except FileNotFoundError:
        return ""


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8", errors="replace").splitlines() if info.is_file() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def _version(name: str) -> str:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def main(arguments: list[str] | None = None) -> int:
    """Measure the parts that are asked for; the page holds them and those measured before, each with its commit."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="run every part briefly; the numbers mean nothing")
    parser.add_argument("--draw", action="store_true", help="measure nothing: write the page from existing results")
    parser.add_argument("--out", type=Path, help="folder of page and results; default: docs and benchmarks/results")
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(parts(False))}")
    options = parser.parse_args(arguments)
    known = parts(options.quick)
    unknown = sorted(set(options.parts) - set(known))
    if unknown:
        parser.error(f"unknown part: {', '.join(unknown)}. There are {', '.join(known)}.")
    if options.draw and options.parts:
        parser.error("--draw measures nothing: omit the parts or --draw.")
    out = options.out or (ROOT / "build" / "benchmarks" / "quick" if options.quick else None)
    folder = out / "results" if out else ROOT / "benchmarks" / "results"
    folder.mkdir(parents=True, exist_ok=True)
    for name in [] if options.draw else options.parts or known:
        print(f"benchmarks: {name}", file=sys.stderr, flush=True)
        content = {"state": state(), "result": known[name]()}
        (folder / f"{name}.json").write_text(json.dumps(content, separators=(",", ":")) + "\n", encoding="utf-8")
    found = {name: json.loads(path.read_text()) for name in known if (path := folder / f"{name}.json").is_file()}
    machines = {content["state"]["machine"] for content in found.values()}
    if len(machines) != 1:
        parser.error(
            f"{folder} has results of {len(machines)} machines{': ' * bool(machines)}{'; '.join(sorted(machines))}. A "
            "page is of one: measure the others anew, or delete their files."
        )
    target = (out or ROOT / "docs") / "benchmarks.md"
    page.write(found, target)
    print(target)
    return 0


if __name__ == "__main__":
    sys.exit(main())
