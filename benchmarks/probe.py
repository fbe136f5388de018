"""One process of `regeneration`: stages from a scene to a model, timed.  Imports nothing beforehand that is timed.

usage: python -m benchmarks.probe cold|warm|number FOLDER
"""

from __future__ import annotations

import json
import sys
import time
from itertools import pairwise
from pathlib import Path


def probe(how: str, folder: Path) -> dict[str, float | bool]:
    """Stages of one process [s]."""
    clock = time.perf_counter
    seconds: dict[str, float | bool] = {}
    scene, out = folder / "punching_press.toml", folder / "punching_press"
    if how != "warm":
        begun = clock()
        from ballpass.derive import generate, read_scene

        seconds["import ballpass.derive"] = clock() - begun
        begun = clock()
        read_scene(scene)  # the scene alone; `generate` reads it again
        seconds["read"] = clock() - begun
        marks: list[tuple[str, float]] = []
        begun = clock()
        generate(scene, out, progress=lambda stage: marks.append((stage, clock())))
        end = clock()
        for (stage, start), (_, stop) in pairwise([*marks, ("", end)]):
            seconds[stage] = stop - start
        if not marks:
            seconds["generate: numbers only"] = end - begun
    begun = clock()
    from ballpass.runtime import load

    seconds["import ballpass.runtime"] = clock() - begun
    begun = clock()
    model = load(out)
    stepper = model.stepper
    loaded = clock() - begun
    libraries = [library for library in (model.library, stepper.library) if library is not None]
    compiling = sum(library.seconds for library in libraries)
    if how == "cold":
        seconds["C compiler: model"] = libraries[0].seconds
        seconds["C compiler: stepper"] = libraries[-1].seconds
    seconds["load"] = loaded - compiling
    begun = clock()
    model.simulate(cycles=1)
    seconds["first cycle"] = clock() - begun
    seconds["cached"] = all(library.cached for library in libraries)
    return seconds


if __name__ == "__main__":
    print(json.dumps(probe(sys.argv[1], Path(sys.argv[2]))))
