"""Part 5: how long it takes from a scene to a model, by stage, each time in a new process.

`cold`: nothing there, everything is derived, written and compiled.  `warm`: everything is there.  `number`: a number
in the scene has changed.  Files of the generated folder and of the cache are looked at before and after, and so they
are around a run with a number set on the command line.
"""

from __future__ import annotations

import hashlib
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
    written: dict[str, set[str]] = {"generated": set(), "cache": set()}
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            places = {"generated": folder / "punching_press", "cache": folder / "cache"}
            shutil.copy(ROOT / "scenes" / "punching_press.toml", folder)
            for how in ("cold", "warm", "number"):
                if how == "number":
                    path = folder / "punching_press.toml"
                    text = path.read_text(encoding="utf-8")
                    path.write_text(text.replace('clearance = "10 um"', 'clearance = "12 um"'), encoding="utf-8")
                before = {place: _contents(where) for place, where in places.items()}
                seconds = json.loads(_run(["-m", "benchmarks.probe", how, name], ROOT, folder).splitlines()[-1])
                if how == "number":
                    for place, where in places.items():
                        written[place] |= _differing(before[place], _contents(where))
                compiled_again |= how != "cold" and not seconds.pop("cached", True)
                seconds.pop("cached", None)
                for stage, value in seconds.items():
                    found[how].setdefault(stage, []).append(value)
    return {
        "repeats": repeats,
        "stages": {how: {stage: spread(values) for stage, values in rows.items()} for how, rows in found.items()},
        "compiled_again": compiled_again,
        "written": {"scene": {place: sorted(names) for place, names in written.items()}, "set": _written_by_set()},
    }


def _written_by_set() -> dict[str, list[str]]:
    """Files that a run with a number set on the command line writes, beside its results."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        places = {"generated": folder / "generated", "cache": folder / "cache"}
        shutil.copy(ROOT / "scenes" / "punching_press.toml", folder)
        command = [
            "-c",
            "from ballpass.runtime.app.entry import main; main()",
            "run",
            "punching_press.toml",
            "--no-figures",
        ]
        _run(command, folder, folder)
        before = {place: _contents(where) for place, where in places.items()}
        _run([*command, "--set", "bearing.clearance=12 um"], folder, folder)
        return {place: sorted(_differing(before[place], _contents(where))) for place, where in places.items()}


def _run(words: list[str], where: Path, folder: Path) -> str:
    """What a new Python process prints, with its compiled cache in `folder`.

    Raises
    ------
    RuntimeError
        It failed.
    """
    environment = {**os.environ, "BALLPASS_CACHE_DIR": str(folder / "cache")}
    done = subprocess.run(
        [sys.executable, *words], cwd=where, env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise RuntimeError(f"regeneration, {' '.join(words[:3])}: {done.stderr.strip().splitlines()[-1:]}")
    return done.stdout


def _contents(folder: Path) -> dict[str, tuple[int, str]]:
    """Time of writing and digest of every file below a folder."""
    return {
        path.relative_to(folder).as_posix(): (path.stat().st_mtime_ns, hashlib.sha256(path.read_bytes()).hexdigest())
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def _differing(before: dict[str, tuple[int, str]], after: dict[str, tuple[int, str]]) -> set[str]:
    """Files that are new, gone, or were written again."""
    return {name for name in before.keys() | after.keys() if before.get(name) != after.get(name)}
