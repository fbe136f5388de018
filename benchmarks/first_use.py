"""What a first answer costs, and how it grows with alike bearings: processor seconds in new processes."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from benchmarks.preparation import RUN
from benchmarks.problem import ROOT

#: Numbers of alike bearings that share the load of the press.
BEARINGS = (1, 2, 4, 8)
ASKED = ("run", "sweep", "sensitivity")

#: One question in a process of its own; prints the processor seconds of the compiler, and of Python with the run.
ASK = """
import resource, sys
import numpy as np
from ballpass.runtime import load

def spent(who):
    usage = resource.getrusage(who)
    return usage.ru_utime + usage.ru_stime

model, asked = load(sys.argv[1]), sys.argv[2]
quantity = "max:" + next(state for state in model.states if state.endswith("inner.x"))
clearance = next(name for name in model.parameters if name.endswith("clearance"))
begun = spent(resource.RUSAGE_SELF)
if asked == "run":
    model.quantities([quantity])
elif asked == "sweep":
    model.simulate_many({clearance: np.linspace(9e-6, 11e-6, 16)}, [quantity])
else:
    model.sensitivity(quantity, wrt=[clearance])
print(spent(resource.RUSAGE_CHILDREN), spent(resource.RUSAGE_SELF) - begun)
"""


def alike(text: str, bearings: int) -> str:
    """The press with so many of its bearing, each with its share of the load."""
    head, rest = text.split("[bearing]\n", 1)
    table, run = rest.split("[run]\n", 1)
    table = re.sub(r"^share *=.*$", f"share = {1.0 / bearings}", table, flags=re.M)
    parts = []
    for k in range(bearings):
        parts.append(f"[bearings.b{k}]\n" + re.sub(r"^\[bearing\.", f"[bearings.b{k}.", table, flags=re.M))
    return head + "\n".join(parts) + "[run]\n" + re.sub(r"outputs = \[.*?\]", 'outputs = ["*inner.x"]', run, flags=re.S)


def measure(repeats: int) -> dict[str, Any]:
    """Least processor seconds of each question of each scene, of repeats: compiler, and all else; kB of C.

    Raises
    ------
    RuntimeError
        A process failed.
    """
    press = (ROOT / "scenes" / "punching_press.toml").read_text(encoding="utf-8")
    motor = (ROOT / "scenes" / "punching_press_motor.toml").read_text(encoding="utf-8")
    texts = {"press": press, "press with motor": motor}
    texts |= {f"{count} alike bearing{'s' * (count > 1)}": alike(press, count) for count in BEARINGS}
    found: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        for number, (words, text) in enumerate(texts.items()):
            scene, folder = place / f"scene{number}.toml", place / f"generated{number}"
            scene.write_text(text, encoding="utf-8")
            _run(place, "-c", RUN, "derive", str(scene), "--out", str(folder))
            size = sum(path.stat().st_size for path in folder.iterdir() if path.suffix in (".c", ".h"))
            found[words] = {"kilobytes": size / 1e3}
            for asked in ASKED:
                taken = []
                for repeat in range(repeats):
                    cache = {"BALLPASS_CACHE_DIR": str(place / f"{number}-{asked}-{repeat}")}
                    taken.append([float(word) for word in _run(place, "-c", ASK, str(folder), asked, **cache).split()])
                found[words][asked] = min(taken)
    return found


def _run(place: Path, *command: str, **environment: str) -> str:
    done = subprocess.run(
        (sys.executable, *command),
        cwd=place,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr[-1000:]}")
    return done.stdout
