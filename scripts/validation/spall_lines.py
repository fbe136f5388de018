"""Lines of spalls of CWRU's 6205 against the model's: ``python -m scripts.validation.spall_lines [FOLDER]``.

FOLDER holds the recordings (drive end, 12 kHz); without it the numbers read off them are taken from ``cwru_lines.csv``,
which ``--write`` writes anew.  The contact angle is identified on the outer spall of files 130 to 133 alone.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scripts.validation.lines import HERE, SpallLines, asked, commit, committed, lines_of, read_cwru

from ballpass.derive import generate
from ballpass.runtime import load
from ballpass.runtime.ratings.kinematic_frequencies import kinematic_frequencies

TABLE, SCENE = "cwru_lines.csv", HERE / "cwru_6205.toml"
SOURCE = """Lines read off recordings of the Bearing Data Center, Case Western Reserve University (drive end, 12 kHz),
by python -m scripts.validation.spall_lines FOLDER --write; columns: see lines.py.  Load in horsepower."""
BALLS, BALL, PITCH = 9, 0.3126 * 0.0254, 1.537 * 0.0254
#: Files and what they have: outer spall of 0.007 in at 6 and at 3 o'clock, inner spalls of 0.007 in and 0.014 in.
GROUPS = {
    "outer 0.007 in, 6 o'clock": ("outer", range(130, 134)),
    "outer 0.007 in, 3 o'clock": ("outer", range(144, 148)),
    "inner 0.007 in": ("inner", range(105, 109)),
    "inner 0.014 in": ("inner", range(169, 173)),
}
IDENTIFIED_ON = "outer 0.007 in, 6 o'clock"


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Contact angle [rad], and of each group the mean order, what theory gives without and with the angle, its own."""

    angle: float
    rows: tuple[tuple[str, float, float, float, float], ...]
    lines: tuple[SpallLines, ...]
    simulated: tuple[SpallLines, ...]


def ball_pass(spall: str, angle: float) -> float:
    """Order of the ball pass [1]."""
    found = kinematic_frequencies(BALLS, BALL, PITCH, 2.0 * math.pi, angle)
    return found.ball_pass_outer if spall == "outer" else found.ball_pass_inner


def angle_of(spall: str, order: float) -> float:
    """Contact angle at which a ball pass has an order [rad]."""
    share = abs(1.0 - 2.0 * order / BALLS)
    return math.acos(min(share * PITCH / BALL, 1.0))


def measured(folder: Path | None) -> list[SpallLines]:
    """Lines of the recordings, or those read off them."""
    if folder is None:
        return committed(TABLE)
    spalls = {number: spall for spall, numbers in GROUPS.values() for number in numbers}
    return read_cwru(folder, {spall: ball_pass(spall, 0.0) for spall in ("inner", "outer")}, spalls)


def simulated(angle: float) -> tuple[SpallLines, ...]:
    """Lines of the model with one spall each, at the acceleration of the outer ring."""
    with tempfile.TemporaryDirectory() as folder:
        model = load(generate(SCENE, folder))
        found = []
        for spall, other in (("outer", "inner"), ("inner", "outer")):
            numbers = {"bearing.contact_angle": angle, f"bearing.defects.{other}.chord": 1e-6}
            run = model.simulate(parameters=numbers)
            speed = run.parameters["shaft.speed"] / (2.0 * math.pi)
            signal: NDArray[np.float64] = run["outer.ay"]
            rate = 1.0 / float(np.mean(np.diff(run.t)))
            lines = lines_of(signal, rate, speed, ball_pass(spall, angle), file="simulated", spall=spall, load=0.0)
            found.append(replace(lines, shaft=1.0))  # known; a model with an outer spall alone has no line of it
    return tuple(found)


def compare(folder: Path | None = None) -> Comparison:
    """Identify the angle and compare."""
    lines = {int(one.file): one for one in measured(folder)}
    orders = {name: float(np.mean([lines[n].order for n in numbers])) for name, (_, numbers) in GROUPS.items()}
    angle = angle_of("outer", orders[IDENTIFIED_ON])
    rows = tuple(
        (name, orders[name], ball_pass(spall, 0.0), ball_pass(spall, angle), angle_of(spall, orders[name]))
        for name, (spall, _) in GROUPS.items()
    )
    return Comparison(angle=angle, rows=rows, lines=tuple(lines.values()), simulated=simulated(angle))


def printed(found: Comparison) -> list[str]:
    """The tables as text."""
    out = [f"contact angle by files 130 to 133: {math.degrees(found.angle):.2f} deg", ""]
    out.append("spall                      order   at 0 deg          at this angle     own angle")
    for name, order, plain, angled, own in found.rows:
        out.append(
            f"{name:26} {order:.4f}  {plain:.4f} ({100 * (order / plain - 1):+.2f} %)  "
            f"{angled:.4f} ({100 * (order / angled - 1):+.3f} %)  {math.degrees(own):.1f} deg"
        )
    out += ["", "file       spall  order   over the line's height, in %:", " " * 28 + "2x  3x  -shaft  +shaft  shaft"]
    for one in (*found.lines, *found.simulated):
        second, third, below, above, shaft = (
            100.0 * height / one.height for height in (one.second, one.third, one.below, one.above, one.shaft_height)
        )
        out.append(
            f"{one.file:10} {one.spall}  {one.order:.4f} {second:5.0f}{third:4.0f}{below:8.0f}{above:8.0f}{shaft:7.0f}"
        )
    return out


def main(arguments: Sequence[str]) -> None:
    folder, write = asked(arguments)
    if write:
        commit(TABLE, SOURCE, measured(folder))
    print("\n".join(printed(compare(folder))))


if __name__ == "__main__":
    main(sys.argv[1:])
