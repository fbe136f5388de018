"""Lives against printed and measured ones: ``python -m scripts.validation.lives``.

The reference rating life of a printed example, radially and in five degrees of freedom, and run-to-failure tests of
XJTU-SY; ``xjtu_lives.csv`` has their lives.
"""

from __future__ import annotations

import csv
import math
import tempfile

import numpy as np
from scripts.validation.lines import HERE

from ballpass.derive import generate
from ballpass.runtime import Model, load
from ballpass.runtime.life.combined_load import ball_bearing
from ballpass.runtime.ratings import life
from ballpass.runtime.ratings.five_degrees import ball_statics
from ballpass.runtime.ratings.of_bearing import ratings_of

#: Angles of ball 1 within a pitch at which the reference life is averaged.
ANGLES = 24

#: Of the printed rows with an axial load: clearance [m], F_r and F_a [N].
COMBINED = ((0.0, 0.0, 1e3), (10e-6, 0.0, 1e3), (10e-6, 1e3, 1e3))


def five_degrees() -> list[str]:
    """Displacements and L_10r under axial and mixed load, the tilt free, a ball on the load's line."""
    out = ["clearance  F_r     F_a     radial      axial        tilt         L_10r"]
    with tempfile.TemporaryDirectory() as folder:
        model = load(generate(HERE / "reference_life.toml", folder))
    info = model.manifest.bearings[0]
    for clearance, radial, axial in COMBINED:
        values = model.numbers({"bearing.clearance": clearance}).values
        ratings, found = ratings_of(info, values), ball_statics(ball_bearing(info, values), (radial, 0.0, axial))
        loads, (x, _, z, _, tilt) = found.ball_load[0].tolist(), found.displacement[0]
        equivalent = tuple(float(life.equivalent_ball_load(loads, turning=one)) for one in (True, False))
        rated = (float(ratings.inner_ball), float(ratings.outer_ball))
        turns = life.reference_life(rated, (equivalent[0], equivalent[1]))
        out.append(
            f"{1e6 * clearance:3.0f} um  {radial:6.0f} N {axial:6.0f} N {abs(1e6 * x):8.4f} um {1e6 * z:9.4f} um "
            f"{abs(1e3 * tilt):7.4f} mrad {turns / 1e6:10.4f} million turns"
        )
    return out


def reference_life() -> tuple[float, float, float]:
    """Approach of the rings [m] and L_10r with a ball on the load's line, L_10r over all angles [turns]."""
    with tempfile.TemporaryDirectory() as folder:
        model = load(generate(HERE / "reference_life.toml", folder))
        ratings = ratings_of(model.manifest.bearings[0], model.numbers().values)

        def at(angle: float) -> tuple[float, float]:
            turned = {"bearing.ball_angle": angle}
            rest = model.static_equilibrium(parameters=turned)
            place = np.array([rest["inner.x"], rest["inner.y"], 0.0, 0.0])
            loads = np.asarray(model.evaluate(0.0, place, ["ball.force"], turned)["ball.force"]).tolist()
            equivalent = tuple(float(life.equivalent_ball_load(loads, turning=one)) for one in (True, False))
            rated = (float(ratings.inner_ball), float(ratings.outer_ball))
            return float(rest["inner.x"]), float(life.reference_life(rated, (equivalent[0], equivalent[1])))

        approach, on_line = at(0.0)
        pitch = 2.0 * math.pi / 7
        damage = [1.0 / at(pitch * k / ANGLES)[1] for k in range(ANGLES)]
    return approach, on_line, 1.0 / float(np.mean(damage))


def rows_of_tests(model: Model) -> list[str]:
    """The table of XJTU-SY: printed and own L_10h, modified and measured lives."""
    out = ["load  speed     L_10h printed, own    L_nmh  measured lives, h                  P/C_r"]
    with (HERE / "xjtu_lives.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(line for line in file if not line.startswith("#")):
            force, speed = float(row["load_kN"]), float(row["speed_rpm"])
            numbers = {"load.force.x": 1e3 * force, "shaft.speed": speed * math.tau / 60.0}
            (bearing,) = model.life(parameters=numbers).bearings
            assert bearing.basic_life is not None
            assert bearing.modified_life is not None
            (warned,) = (words for words in bearing.beyond if "gives lives up to 0.5 C_r" in words)
            lives = " ".join(f"{float(row[f'life_{k}']):5.2f}" for k in range(1, 6))
            share = warned.partition(" is ")[2].partition(" C_r")[0]
            out.append(
                f"{force:2.0f} kN {speed:.0f} rpm  {float(row['printed_L10h']):6.3f} h "
                f"{bearing.hours(bearing.basic_life):6.3f} h   {bearing.hours(bearing.modified_life):4.1f} h  {lives}  "
                f"{share}"
            )
    return out


def printed() -> list[str]:
    """Both tables as text."""
    approach, on_line, mean = reference_life()
    with tempfile.TemporaryDirectory() as folder:
        tests = rows_of_tests(load(generate(HERE / "xjtu_uer204.toml", folder)))
    return [
        f"approach of the rings, ball on the load's line: {1e6 * approach:.4f} um",
        f"L_10r, ball on the load's line: {on_line / 1e6:.1f} million turns",
        f"L_10r, mean over the cage's angle: {mean / 1e6:.1f} million turns",
        "",
        *five_degrees(),
        "",
        *tests,
    ]


if __name__ == "__main__":
    print("\n".join(printed()))
