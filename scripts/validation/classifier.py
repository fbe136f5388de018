"""A classifier that has seen simulated signals alone: ``python -m scripts.validation.classifier [FOLDER]``.

FOLDER holds the recordings of CWRU (drive end); without it the numbers read off them are taken from
``cwru_features.csv``, which ``--write`` writes anew.  Needs scikit-learn.
"""

from __future__ import annotations

import csv
import math
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray
from scipy.io import loadmat
from scipy.signal import decimate
from scripts.validation.lines import BAND, FLOOR, HERE, Array, asked, only
from scripts.validation.spall_lines import SCENE, ball_pass
from sklearn.ensemble import RandomForestClassifier
from sklearn.metrics import confusion_matrix

from ballpass.derive import generate
from ballpass.runtime import Distribution, Sensor, SignalClass, Signals, load, make_data_set
from ballpass.runtime.vibration.diagnosis import envelope

TABLE = HERE / "cwru_features.csv"
SOURCE = """Lines read off recordings of the Bearing Data Center, Case Western Reserve University (drive end), a row a
second, by python -m scripts.validation.classifier FOLDER --write.  Heights over the floor: see classifier.py."""
CLASSES = ("healthy", "inner", "outer")
#: The files that the features were chosen on, and those that nobody had looked at.
CHOSEN = {
    "healthy": (97,),
    "inner": (*range(105, 109), *range(169, 173)),
    "outer": (*range(130, 134), *range(144, 148)),
}
UNSEEN = {
    "inner": (*range(209, 213), *range(3001, 3005)),
    "outer": (156, 159, 160, *range(197, 201), *range(234, 238), *range(246, 250), *range(258, 262)),
}
RATE = 12000.0
#: Speeds of the motor by its load in horsepower [rpm].
SPEEDS = (1797.0, 1772.0, 1750.0, 1730.0)
#: How far around a line its peak is looked for, over its frequency: contact angle and slip move it by less [1].
AROUND = 0.012
#: Members of each class, and background of each data set [m/s^2]: the healthy recording has 0.7.
MEMBERS, BACKGROUNDS = 20, (0.3, 0.7, 1.5)


@dataclass(frozen=True, slots=True, kw_only=True)
class Second:
    """A second of a recording: file, class, and its features."""

    file: int
    label: str
    features: tuple[float, ...]


def features_of(signal: Array, speed: float) -> tuple[float, ...]:
    """Heights of 1 and 2 BPFO, 1 and 2 BPFI over the floor of the squared envelope's spectrum, as logarithms.

    Parameters
    ----------
    speed : of the shaft, about [Hz]
    """
    squared = envelope(np.arange(signal.size) / RATE, signal, BAND) ** 2
    count = 4 * signal.size
    height = np.abs(np.fft.rfft((squared - squared.mean()) * np.hanning(signal.size), count))
    frequency = np.fft.rfftfreq(count, 1.0 / RATE)
    floor = np.median(height[(frequency > FLOOR[0]) & (frequency < FLOOR[1])])
    places = [k * ball_pass(spall, 0.0) * speed for spall in ("outer", "inner") for k in (1, 2)]
    return tuple(math.log10(height[np.abs(frequency - at) < AROUND * at].max() / floor) for at in places)


def simulated(seeds: Sequence[int] = (1, 2, 3)) -> tuple[Array, list[str]]:
    """Features of simulated seconds, a data set for each background, and their classes."""

    def between(low: float, high: float) -> Distribution:
        return Distribution(name="uniform", arguments={"loc": low, "scale": high - low})

    speeds = between(1720.0 * math.tau / 60.0, 1800.0 * math.tau / 60.0)
    common = {
        "shaft.speed": speeds,
        "load.force.y": between(-300.0, -50.0),
        "bearing.clearance": between(-8e-6, 0.0),
        "bearing.contact_angle": between(0.0, math.radians(11.0)),
        "bearing.outer_ring.stiffness": between(0.7e8, 2.5e8),
        "bearing.outer_ring.damping": between(200.0, 600.0),
        "bearing.ball_angle": between(0.0, math.tau),
    }
    none, chord = 1e-6, between(1e-4, 5e-4)  # a spall of a micrometre is none
    place = between(-math.pi, 0.0)  # the lower half, where the load is
    own: dict[str, dict[str, Distribution | float]] = {
        "healthy": {"bearing.defects.inner.chord": none, "bearing.defects.outer.chord": none},
        "inner": {"bearing.defects.inner.chord": chord, "bearing.defects.outer.chord": none},
        "outer": {
            "bearing.defects.inner.chord": none,
            "bearing.defects.outer.chord": chord,
            "bearing.defects.outer.angle": place,
        },
    }
    rows, labels = [], []
    with tempfile.TemporaryDirectory() as folder:
        model = load(generate(SCENE, Path(folder) / "model"))
        classes = [
            SignalClass(label=label, model=model, members=MEMBERS, parameters={**common, **numbers})
            for label, numbers in own.items()
        ]
        for seed, background in zip(seeds, BACKGROUNDS, strict=True):
            sensor = Sensor(low_pass=5500.0, noise=background)
            signals = Signals(outputs=("outer.ay",), sample_rate=RATE, duration=1.0, transient=0.1, sensor=sensor)
            path = make_data_set(Path(folder) / f"{seed}.nc", classes, signals, seed=seed).path
            with xarray.open_dataset(path) as found:
                turns = found.parameters.sel(parameter="shaft.speed").values / math.tau
                rows += [features_of(one, turn) for one, turn in zip(found["outer.ay"].values, turns, strict=True)]
                labels += [str(label) for label in found.label.values]
    return np.array(rows), labels


def measured(folder: Path | None) -> list[Second]:
    """Seconds of the recordings, or what was read off them."""
    if folder is None:
        with TABLE.open(encoding="utf-8", newline="") as file:
            rows = csv.reader(line for line in file if not line.startswith("#"))
            next(rows)
            return [Second(file=int(n), label=label, features=tuple(map(float, f))) for n, label, *f in rows]
    found = []
    for label in CLASSES:
        for number in (*CHOSEN.get(label, ()), *UNSEEN.get(label, ())):
            path = only(folder, f"{number}*.mat")
            data = loadmat(path, squeeze_me=True)
            signal = np.asarray(next(data[key] for key in data if key.endswith("DE_time")), dtype=float)
            if label == "healthy":
                signal = decimate(signal, 4, ftype="fir")  # as many samples as the recordings at 48 kHz have
            speed = SPEEDS[int(path.stem[-1])] / 60.0
            second = int(RATE)
            found += [
                Second(file=number, label=label, features=features_of(signal[k : k + second], speed))
                for k in range(0, signal.size - second + 1, second)
            ]
    return found


def printed(seconds: Sequence[Second] | None = None) -> list[str]:
    """Both confusion matrices, and what was found in each file that was not always right."""
    seconds = measured(None) if seconds is None else seconds
    seen, labels = simulated()
    forest = RandomForestClassifier(500, random_state=0).fit(seen, labels)
    found = forest.predict(np.array([one.features for one in seconds]))
    out = [f"trained on {len(labels)} simulated seconds"]
    for words, files in (("files the features were chosen on", CHOSEN), ("files that no choice was made on", UNSEEN)):
        numbers = {number for those in files.values() for number in those}
        pairs = [(one, str(said)) for one, said in zip(seconds, found, strict=True) if one.file in numbers]
        table = confusion_matrix([one.label for one, _ in pairs], [said for _, said in pairs], labels=CLASSES)
        right = sum(one.label == said for one, said in pairs)
        out += [
            "",
            f"{words}: {right} of {len(pairs)} seconds right",
            "is      found " + " ".join(f"{c:>7}" for c in CLASSES),
        ]
        out += [
            f"{label:13} " + " ".join(f"{count:7}" for count in row)
            for label, row in zip(CLASSES, table, strict=True)
            if row.sum()
        ]
        for number in sorted(numbers):
            of_file = [(one.label, said) for one, said in pairs if one.file == number]
            wrong = [said for label, said in of_file if said != label]
            if wrong:
                counts = ", ".join(f"{wrong.count(c)} {c}" for c in CLASSES if c in wrong)
                out.append(f"file {number}, {of_file[0][0]}: {counts} of {len(of_file)}")
    return out


def main(arguments: Sequence[str]) -> None:
    folder, write = asked(arguments)
    seconds = measured(folder)
    if write:
        with TABLE.open("w", encoding="utf-8", newline="") as file:
            file.write("".join(f"# {line}\n" for line in SOURCE.splitlines()))
            table = csv.writer(file, lineterminator="\n")
            table.writerow(["file", "class", "bpfo", "bpfo_2", "bpfi", "bpfi_2"])
            table.writerows([one.file, one.label, *(f"{x:.5f}" for x in one.features)] for one in seconds)
    print("\n".join(printed(seconds)))


if __name__ == "__main__":
    main(sys.argv[1:])
