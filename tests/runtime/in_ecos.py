"""Simulates FMUs in Ecos, a co-simulation engine in C++ that reads FMUs by fmi4c, in a process of its own.

In: JSON on stdin: models (name to path), connections (source, sink, by the motor or not), parameters, step
[s], how many, names wanted, a file.  Out: in this file their values behind each step, as JSON.
"""

from __future__ import annotations

import ctypes
import json
import math
import sys
from pathlib import Path


def kloss(speed: float) -> float:
    """Torque of the motor of the scene punching_press_motor."""
    synchronous = 500.0 / 60.0 * 2.0 * math.pi
    slip = (synchronous - speed) / synchronous
    return 2.0 * 25.0 / (slip / 0.3 + 0.3 / slip)


def main() -> None:
    for library in sorted(Path(sys.prefix, "lib").glob("libtbb.so.*")):  # Ecos needs it, and its wheel has none
        ctypes.CDLL(str(library), ctypes.RTLD_GLOBAL)
    import ecospy  # type: ignore[import-not-found, import-untyped, unused-ignore]

    asked = json.load(sys.stdin)
    structure = ecospy.EcosSimulationStructure()
    for name, path in asked["models"].items():
        structure.add_model(name, path)
    for source, sink, by_motor in asked["connections"]:
        structure.make_real_connection(source, sink, kloss if by_motor else None)
    structure.add_parameter_set("start", asked["parameters"])
    simulation = ecospy.EcosSimulation(structure=structure, step_size=asked["step"])
    assert simulation.init(parameter_set="start"), ecospy.EcosLib.get_last_error()
    rows = []
    for _ in range(asked["count"]):
        simulation.step()
        rows.append([simulation.get_real(name) for name in asked["wanted"]])
    simulation.terminate()
    simulation.free()
    Path(asked["result"]).write_text(json.dumps(rows), encoding="utf-8")  # Ecos writes to stdout


if __name__ == "__main__":
    main()
