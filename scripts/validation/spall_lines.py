"""Lines of spalls of CWRU's 6205 against the model's: ``python -m scripts.validation.spall_lines [FOLDER]``.

FOLDER holds the recordings (drive end, 12 kHz); without it the numbers read off them are taken from ``cwru_lines.csv``,
which ``--write`` writes anew.  The contact angle is identified on the outer spall of files 130 to 133 alone.
"""

from __future__ import annotations

import csv
import math
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scripts.validation.kinematics import kinematic_frequencies
from scripts.validation.lines import (
    HERE,
    SpallLines,
    asked,
    commit,
    committed,
    drive_end,
    lines_of,
    mean_line,
    only,
    read_cwru,
)

from ballpass.derive import generate
from ballpass.runtime import load

TABLE, OTHERS, SCENE = "cwru_lines.csv", "cwru_other_lines.csv", HERE / "cwru_6205.toml"
SOURCE = """Lines read off recordings of the Bearing Data Center, Case Western Reserve University (drive end, 12 kHz),
by python -m scripts.validation.spall_lines FOLDER --write; columns: see lines.py.  Load in horsepower."""
OTHER_SOURCE = """Ball pass of the raceway without spall in recordings of CWRU, mean spectrum of each four files, by
python -m scripts.validation.spall_lines FOLDER --write; order over the shaft, height over the floor."""
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
    """Contact angle [rad], and of each group the mean order, what theory gives without and with the angle, its own.

    `others` are order and height of the other raceway's ball pass by the group.
    """

    angle: float
    others: dict[str, tuple[float, float]]
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


def other_of(spall: str) -> str:
    """The raceway without spall."""
    return "inner" if spall == "outer" else "outer"


def slip_of(spall: str, order: float, angle: float) -> float:
    """Slip of a cage at a contact angle by which a ball pass has an order [1]."""
    passes = order if spall == "outer" else BALLS - order
    return 1.0 - passes / ball_pass("outer", angle)


def other_lines(folder: Path | None, lines: Mapping[int, SpallLines]) -> dict[str, tuple[float, float]]:
    """Order and height of the other raceway's ball pass by the group, of recordings or as read off them."""
    if folder is None:
        with (HERE / OTHERS).open(encoding="utf-8", newline="") as file:
            rows = csv.reader(line for line in file if not line.startswith("#"))
            return {name: (float(order), float(height)) for name, order, height in list(rows)[1:]}
    found = {}
    for name, (spall, numbers) in GROUPS.items():
        signals = [drive_end(only(folder, f"{number}*.mat"))[0] for number in numbers]
        shafts = [lines[number].shaft * lines[number].nominal for number in numbers]
        found[name] = mean_line(signals, 12000.0, shafts, ball_pass(other_of(spall), 0.0))
    return found


def commit_others(others: Mapping[str, tuple[float, float]]) -> None:
    """Write the table of the other raceway's lines."""
    rows = [f'"{name}",{order:.7g},{height:.7g}\n' for name, (order, height) in others.items()]
    comment = "".join(f"# {line}\n" for line in OTHER_SOURCE.splitlines())
    (HERE / OTHERS).write_text(f"{comment}group,order,height\n{''.join(rows)}", encoding="utf-8")


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
    return Comparison(
        angle=angle,
        others=other_lines(folder, lines),
        rows=rows,
        lines=tuple(lines.values()),
        simulated=simulated(angle),
    )


def printed(found: Comparison) -> list[str]:
    """The tables as text."""
    out = [f"contact angle by files 130 to 133: {math.degrees(found.angle):.2f} deg", ""]
    out.append("spall                      order   at 0 deg          at this angle     own angle")
    for name, order, plain, angled, own in found.rows:
        out.append(
            f"{name:26} {order:.4f}  {plain:.4f} ({100 * (order / plain - 1):+.2f} %)  "
            f"{angled:.4f} ({100 * (order / angled - 1):+.3f} %)  {math.degrees(own):.1f} deg"
        )
    out += ["", f"{'spall':26} the other ball pass  height  sum     by own angle        slip at that of 130-133"]
    for name, order, _, _, own in found.rows:
        spall, (line, height) = GROUPS[name][0], found.others[name]
        given, slip = ball_pass(other_of(spall), own), slip_of(spall, order, found.angle)
        label = f"BPF{other_of(spall)[0].upper()} {line:.4f}"
        out.append(
            f"{name:26} {label:19}  {height:6.1f}  {order + line:.4f}  "
            f"{given:.4f} ({100 * (line / given - 1):+.3f} %)  {100 * slip:+.2f} %"
        )
    (_, first, *_), (_, second, *_, own) = found.rows[2:]
    apart, passes = 100 * (second / first - 1), BALLS - second
    stated = [float(np.mean([o.line for o in found.lines if int(o.file) in group])) for _, group in GROUPS.values()]
    passed = ball_pass("inner", angle_of("outer", stated[list(GROUPS).index(IDENTIFIED_ON)]))
    spins = (2 * passes / BALLS * (math.cos(angle) + PITCH / BALL) for angle in (own, found.angle))
    out += [
        "",
        f"BPFI of 105-108 and 169-172: {apart:.2f} % apart, {apart / 2:.2f} % from any one number at least",
        "over the speeds that the files state: 105-108 {:+.3f} %, 169-172 {:+.3f} % from the angle of 130-133".format(
            *(100 * (order / passed - 1) for order in stated[2:])
        ),
        "2 BSF of 169-172: {:.3f} by the own angle, {:.3f} by slip".format(*spins),
    ]
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
        lines = measured(folder)
        commit(TABLE, SOURCE, lines)
        commit_others(other_lines(folder, {int(one.file): one for one in lines}))
    print("\n".join(printed(compare(folder))))


if __name__ == "__main__":
    main(sys.argv[1:])
