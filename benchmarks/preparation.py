"""How long it takes from a scene to results, each time in a new process: derivation, compilation, a warm run."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.problem import ROOT
from benchmarks.timing import spread

RUN = "from ballpass.runtime.app.entry import main; main()"
COMPILE = (
    "from ballpass.runtime import load; model = load('generated/punching_press'); model.simulate(cycles=1, transient=0)"
)
CHANGED = "bearing.clearance=12 um"
#: Words for the page, and what Python runs.
STEPS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("`ballpass --help`", ("-c", RUN, "--help")),
    ("`ballpass derive`, nothing there", ("-c", RUN, "derive", "punching_press.toml")),
    ("`ballpass derive`, nothing changed", ("-c", RUN, "derive", "punching_press.toml")),
    ("load and simulate a cycle, compiles", ("-c", COMPILE)),
    ("load and simulate a cycle, warm", ("-c", COMPILE)),
    ("`ballpass run --no-figures`, compiles the outputs", ("-c", RUN, "run", "punching_press.toml", "--no-figures")),
    ("`ballpass run --no-figures`, warm", ("-c", RUN, "run", "punching_press.toml", "--no-figures")),
    ("`ballpass run`, warm", ("-c", RUN, "run", "punching_press.toml")),
    (
        "`ballpass run --no-figures --set …`",
        ("-c", RUN, "run", "punching_press.toml", "--no-figures", "--set", CHANGED),
    ),
)


def measure(repeats: int) -> dict[str, Any]:
    """Seconds of each step; medians over the repeats, each in a folder and a cache of its own.

    Raises
    ------
    RuntimeError
        A process failed.
    """
    taken: dict[str, list[float]] = {words: [] for words, _ in STEPS}
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as name:
            shutil.copy(ROOT / "scenes" / "punching_press.toml", name)
            environment = {**os.environ, "BALLPASS_CACHE_DIR": str(Path(name) / "cache")}
            for words, command in STEPS:
                begun = time.perf_counter()
                done = subprocess.run(
                    (sys.executable, *command), cwd=name, env=environment, capture_output=True, text=True, check=False
                )
                taken[words].append(time.perf_counter() - begun)
                if done.returncode:
                    raise RuntimeError(f"{words}: {done.stderr[-1000:]}")
    return {"repeats": repeats, "steps": {words: spread(values) for words, values in taken.items()}}
