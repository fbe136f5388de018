"""Load zone and kurtosis against the place of a spall: ``python -m scripts.validation.load_zone [FOLDER]``.

FOLDER holds the recordings of CWRU (drive end, 12 kHz); without it the numbers read off them are taken from
``cwru_load_zone.csv``, which ``--write`` writes anew.
"""

from __future__ import annotations

import csv
import math
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.io import loadmat
from scipy.signal import resample
from scripts.validation.lines import HERE, asked, only
from scripts.validation.spall_lines import SCENE

from ballpass.derive import generate
from ballpass.runtime import Model, load
from ballpass.runtime.vibration.diagnosis import DiagnosisStatistics, diagnosis

TABLE = HERE / "cwru_load_zone.csv"
SOURCE = """Read off recordings of the Bearing Data Center, Case Western Reserve University (drive end, 12 kHz), by
python -m scripts.validation.load_zone FOLDER --write.  Load of the motor in hp; rms about the mean in g; kurtosis."""
#: Where the spall of 0.007 in is [o'clock], its files at 0 to 3 hp, and its angle from +x [deg].
PLACES: dict[int, tuple[Sequence[int], float]] = {
    6: (range(130, 134), -90.0),
    3: (range(144, 148), 0.0),
    12: ((156, 158, 159, 160), 90.0),
}
RATE = 12000.0
#: Loads of the model [N], and dampings of its outer ring at the scene's load [N s/m].
LOADS, DAMPINGS = (50.0, 100.0, 150.0, 200.0), (200.0, 300.0, 400.0)
NO_SPALL = {"bearing.defects.inner.chord": 1e-6, "bearing.defects.outer.chord": 1e-6}


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedSpall:
    """A recording with the spall at a place [o'clock]: load of the motor [hp], rms about the mean [g], kurtosis [1]."""

    file: int
    place: int
    load: int
    rms: float
    kurtosis: float


def measured(folder: Path | None) -> list[PlacedSpall]:
    """Numbers of the recordings, or those read off them."""
    if folder is None:
        with TABLE.open(encoding="utf-8", newline="") as file:
            return [
                PlacedSpall(
                    file=int(row["file"]),
                    place=int(row["place"]),
                    load=int(row["load"]),
                    rms=float(row["rms"]),
                    kurtosis=float(row["kurtosis"]),
                )
                for row in csv.DictReader(line for line in file if not line.startswith("#"))
            ]
    found = []
    for place, (files, _) in PLACES.items():
        for horsepower, number in enumerate(files):
            data = loadmat(only(folder, f"{number}*.mat"), squeeze_me=True)
            read = diagnosis(next(data[key] for key in data if key.endswith("DE_time")))
            found.append(PlacedSpall(file=number, place=place, load=horsepower, rms=read.rms, kurtosis=read.kurtosis))
    return found


def at_place(model: Model, place: int, axis: str, numbers: Mapping[str, float]) -> DiagnosisStatistics:
    """Statistics of the outer ring's acceleration along an axis, at the recordings' sampling rate [m/s^2]."""
    angle = {"bearing.defects.outer.angle": math.radians(PLACES[place][1])}
    run = model.simulate(parameters={"bearing.defects.inner.chord": 1e-6, **angle, **numbers}).steady()
    rate = 1.0 / float(np.mean(np.diff(run.t)))
    signal = run[f"outer.a{axis}"][:-1]  # whole turns
    return diagnosis(resample(signal, round(signal.size * RATE / rate)))


def ball_forces(model: Model, numbers: Mapping[str, float]) -> tuple[float, float]:
    """Highest and lowest force of a ball without a spall, which are those at 6 and at 12 o'clock [N]."""
    force = model.simulate(parameters={**NO_SPALL, **numbers}).steady()["ball.elastic_force"]
    return float(np.max(force)), float(np.min(force))


def printed(rows: Sequence[PlacedSpall] | None = None) -> list[str]:
    """The tables as text."""
    read = {(one.place, one.load): one for one in (measured(None) if rows is None else rows)}
    out = [
        "recordings    rms, g                over 6 o'clock   kurtosis",
        "load          6      3      12      3      12        6      3      12",
    ]
    for load_ in range(4):
        six, three, twelve = (read[place, load_] for place in (6, 3, 12))
        out.append(
            f"{load_} hp        {six.rms:5.3f}  {three.rms:5.3f}  {twelve.rms:5.3f}   "
            f"{three.rms / six.rms:5.3f}  {twelve.rms / six.rms:5.3f}    "
            f"{six.kurtosis:5.2f}  {three.kurtosis:5.2f}  {twelve.kurtosis:5.2f}"
        )
    out += [
        "",
        "model     ball forces, N      rms over 6 o'clock          kurtosis",
        "load      6        12         3, across  3      12        6      3, across  12",
    ]
    with tempfile.TemporaryDirectory() as folder:
        model = load(generate(SCENE, folder))
        for force in LOADS:
            numbers = {"load.force.y": -force}
            high, low = ball_forces(model, numbers)
            at_six, at_twelve, beside = (at_place(model, place, "y", numbers) for place in (6, 12, 3))
            across = at_place(model, 3, "x", numbers)
            out.append(
                f"{force:3.0f} N  {high:7.2f}  {low:7.2f}        {across.rms / at_six.rms:6.3f}   "
                f"{beside.rms / at_six.rms:7.4f}  {at_twelve.rms / at_six.rms:6.3f}    "
                f"{at_six.kurtosis:5.2f}  {across.kurtosis:9.2f}  {at_twelve.kurtosis:6.2f}"
            )
        out += ["", "model, 6 o'clock, 100 N: damping of the outer ring, kurtosis"]
        for damping in DAMPINGS:
            kurtosis = at_place(model, 6, "y", {"bearing.outer_ring.damping": damping}).kurtosis
            out.append(f"{damping:3.0f} N s/m  {kurtosis:5.2f}")
    return out


def main(arguments: Sequence[str]) -> None:
    folder, write = asked(arguments)
    rows = measured(folder)
    if write:
        with TABLE.open("w", encoding="utf-8", newline="") as file:
            file.write("".join(f"# {line}\n" for line in SOURCE.splitlines()))
            table = csv.writer(file, lineterminator="\n")
            table.writerow(["file", "place", "load", "rms", "kurtosis"])
            table.writerows([one.file, one.place, one.load, f"{one.rms:.5f}", f"{one.kurtosis:.5f}"] for one in rows)
    print("\n".join(printed(rows)))


if __name__ == "__main__":
    main(sys.argv[1:])
