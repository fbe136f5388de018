"""Motions against published ones: ``python -m scripts.validation.motions``.

Varying compliance, Andrews' squeezing mechanism of the IVP test set, SUNDIALS' slider-crank with sensitivities, and two
mechanisms of the Modelica Standard Library.  ``--write`` writes their motions at a tolerance of 1e-12 as CSV instead.
"""

from __future__ import annotations

import csv
import math
import sys
import tempfile
from pathlib import Path

import numpy as np
from scripts.validation.lines import HERE

from ballpass.derive import generate, shipped_scenes
from ballpass.runtime import Model, load

#: Ball-pass frequency [Hz], steady peak to peak along and across the load [um], computed independently; see the page.
COMPLIANCE = ((20, 0.02779, 0.13568), (250, 0.06538, 1.98421), (305, 2.47351, 0.25838), (600, 0.00938, 0.02682))
#: Angles at 0.03 s [rad]: Mazzia and Magherini, Test Set for Initial Value Problem Solvers, release 2.4, 2008.
SQUEEZER = (("driver.angle", 15.8107712), ("body.arm.angle", 0.04082224), ("body.lower_jaw.angle", 1.04808074))
ACCELERATION = 14222.4439199541
#: G, dG/dk, dG/dc: printed output of SUNDIALS' example idasSlCrank_FSA_dns, there to its tolerance; digits beyond from
#: an independent program.
CRANK = (3.3366068, 0.3334481, -0.3637540)
#: Scene of this folder; angle of the crank from its start after 5 s [rad]: the library's file of reference results
#: (modelica/MAP-LIB_ReferenceResults), an independent program: integral of energy, Lagrange's equations by hand.
MODELICA = (("engine1a", 53.41520, 53.41651894255), ("planar_fourbar", -0.93978, -0.93436106))
#: Folder of the motions as CSV, and how many times each has behind its start.
MOTIONS, TIMES = HERE.parents[1] / "docs" / "validation" / "motions", 100


def made(path: Path, folder: str) -> Model:
    """Model of a scene file."""
    return load(generate(path, folder))


def compliance(model: Model, frequency: float) -> tuple[float, float]:
    """Steady peak to peak along and across the load [um]."""
    speed = 2.0 * math.pi * frequency / (8.0 * model.constants()["bearing.cage_ratio"])
    passes = 60 if frequency > 100 else 8
    duration = 4.0 + passes / frequency
    cycles = duration * speed / (2.0 * math.pi)
    run = model.simulate(cycles=cycles, parameters={"shaft.speed": speed}, samples_per_cycle=400, rtol=1e-9)
    steady = run.t > run.t[-1] - passes / frequency
    along, across = (float(np.ptp(run[name][steady])) * 1e6 for name in ("inner.x", "inner.y"))
    return along, across


def slider_crank(folder: Path) -> tuple[float, float, float]:
    """Kinetic energy over 10 s, and its derivatives by stiffness and damping of the spring."""
    text = (HERE.parents[1] / "tests" / "physics" / "slider_crank.toml").read_text(encoding="utf-8")
    path = folder / "slider_crank.toml"
    path.write_text(text.replace('"body.*"]', '"body.*", "kinetic_energy"]'), encoding="utf-8")
    model = made(path, str(folder / "model"))
    names = ["mechanism.springs.link.stiffness", "mechanism.springs.link.damping"]
    found = model.sensitivity("mean:kinetic_energy", names, rtol=1e-10)
    by = {pair.parameter: pair for pair in found.pairs}
    stiffness, damping = (by[name] for name in names)
    return 10.0 * stiffness.value, 10.0 * stiffness.derivative, 10.0 * damping.derivative


def motion(model: Model, rtol: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time [s], angle [rad] and speed [rad/s] of the driver at equal times of the scene's run."""
    run = model.simulate(rtol=rtol, times=np.linspace(0.0, float(model.manifest.run.duration or 0.0), TIMES + 1))
    return run.t, run["driver.angle"], run["driver.speed"]


def write() -> list[str]:
    """Write the motions at a tolerance of 1e-12; the files."""
    scenes = {
        "andrews": shipped_scenes()["andrews"],
        "slider_crank": HERE.parents[1] / "tests/physics/slider_crank.toml",
    }
    scenes |= {name: HERE / f"{name}.toml" for name, *_ in MODELICA}
    for name, path in scenes.items():
        with tempfile.TemporaryDirectory() as folder:
            columns = motion(made(path, folder), 1e-12)
        # ten digits of the largest: two methods agree in them
        places = [9 - math.floor(math.log10(float(np.abs(column).max()))) for column in columns]
        with (MOTIONS / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
            rows = csv.writer(file, lineterminator="\n")
            rows.writerow(["time [s]", "driver.angle [rad]", "driver.speed [rad/s]"])
            rows.writerows(
                [f"{x:.{n}f}" for x, n in zip(row, places, strict=True)] for row in zip(*columns, strict=True)
            )
    return [f"{name}.csv" for name in scenes]


def printed() -> list[str]:
    """The tables as text."""
    scenes = shipped_scenes()
    out = ["ball pass   along the load: theirs, own [um]   across: theirs, own [um]"]
    with tempfile.TemporaryDirectory() as folder:
        model = made(scenes["varying-compliance"], folder)
        for frequency, along, across in COMPLIANCE:
            own = compliance(model, frequency)
            out.append(f"{frequency:4d} Hz      {along:.5f}  {own[0]:.5f}                   {across:.5f}  {own[1]:.5f}")
    with tempfile.TemporaryDirectory() as folder:
        model = made(scenes["andrews"], folder)
        found = float(model.evaluate(0.0)["driver.acceleration"])
        out += ["", f"squeezer, acceleration at the start: theirs {ACCELERATION:.6f}, own {found:.6f} rad/s^2"]
        end = model.simulate(rtol=1e-11)
        out += [
            f"squeezer, {name} at 0.03 s: theirs {value:.7f}, own {float(end[name][-1]):.7f} rad"
            for name, value in SQUEEZER
        ]
    with tempfile.TemporaryDirectory() as folder:
        slopes = slider_crank(Path(folder))
    out.append("")
    for name, theirs, value in zip(("G", "dG/dk", "dG/dc"), CRANK, slopes, strict=True):
        out.append(f"slider-crank, {name}: theirs {theirs:.6f}, own {value:.6f}")
    out.append("")
    for name, file, theirs in MODELICA:
        with tempfile.TemporaryDirectory() as folder:
            _, angle, _ = motion(made(HERE / f"{name}.toml", folder), 1e-12)
        value = angle[-1] - angle[0]
        out.append(f"{name}, angle after 5 s: file {file:.5f}, theirs {theirs:.8f}, own {value:.8f} rad")
    return out


if __name__ == "__main__":
    print("\n".join(write() if "--write" in sys.argv else printed()))
