"""Part 5: how long it takes from a scene to a model, by stage, each time in a new process.

`cold`: nothing there, everything is derived, written and compiled.  `warm`: everything is there.  `number`: a number
in the scene has changed.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from benchmarks.problem import ROOT
from benchmarks.timing import spread


def regeneration(repeats: int) -> dict[str, Any]:
    """Seconds of each stage over `repeats` fresh processes."""
    found: dict[str, dict[str, list[float]]] = {"cold": {}, "warm": {}, "number": {}}
    compiled_again = False
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as folder:
            shutil.copy(ROOT / "scenes" / "punching_press.toml", folder)
            for how in ("cold", "warm", "number"):
                if how == "number":
                    path = Path(folder, "punching_press.toml")
                    text = path.read_text(encoding="utf-8")
                    path.write_text(text.replace('clearance = "10 um"', 'clearance = "12 um"'), encoding="utf-8")
                environment = {**os.environ, "RACEWAY_CACHE_DIR": str(Path(folder, "cache"))}
                done = subprocess.run(
                    [sys.executable, "-m", "benchmarks.probe", how, folder],
                    cwd=ROOT,
                    env=environment,
                    capture_output=True,
                    text=True,
                    check=False,
                )
                if done.returncode:
                    raise RuntimeError(f"regeneration, {how}: {done.stderr.strip().splitlines()[-1:]}")
                seconds = json.loads(done.stdout.splitlines()[-1])
                compiled_again |= how != "cold" and not seconds.pop("cached", True)
                seconds.pop("cached", None)
                for stage, value in seconds.items():
                    found[how].setdefault(stage, []).append(value)
    return {
        "repeats": repeats,
        "stages": {how: {stage: spread(values) for stage, values in rows.items()} for how, rows in found.items()},
        "compiled_again": compiled_again,
    }
