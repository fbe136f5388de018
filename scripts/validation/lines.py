"""Lines of spalls in recordings: read them from a folder of MATLAB files, or from the table that is committed.

In: a folder with recordings of CWRU's or MFPT's test stands, as their owners publish them.  Out: `SpallLines`, one for
each file.  No recording is part of this repository: CWRU's have no licence, MFPT's a non-commercial one.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat

from ballpass.runtime.vibration.diagnosis import envelope

HERE = Path(__file__).parent
Array = NDArray[np.float64]

#: Band of the envelope [Hz], and the lines of the squared envelope whose middle height is the floor [Hz].
BAND, FLOOR = (2000.0, 5000.0), (10.0, 500.0)
#: How far around a line its peak is looked for, over its frequency [1].
AROUND = 0.012
#: Neighbours of a line: harmonics, and sidebands at the shaft.
NEIGHBOURS = ((2, 0), (3, 0), (1, -1), (1, 1))


@dataclass(frozen=True, slots=True, kw_only=True)
class SpallLines:
    """Lines of one recording, in the squared envelope, Hann window, four times zero padded.

    Attributes
    ----------
    file, spall : its name, and "inner" or "outer"
    load : on the bearing, in the unit of the source
    nominal : speed of the shaft by the file [Hz]
    line, shaft : frequencies of the ball pass and of the shaft, over `nominal` [1]
    height, shaft_height : of both over the floor [1]
    second, third, below, above : heights of 2 and 3 ball passes, and of ball pass less and plus the shaft, over the
        floor [1]
    """

    file: str
    spall: str
    load: float
    nominal: float
    line: float
    shaft: float
    height: float
    shaft_height: float
    second: float
    third: float
    below: float
    above: float

    @property
    def order(self) -> float:
        """Of the ball pass over the shaft's own line [1]."""
        return self.line / self.shaft


def lines_of(
    signal: Array, rate: float, nominal: float, order: float, *, file: str, spall: str, load: float
) -> SpallLines:
    """Lines of a signal.

    Parameters
    ----------
    rate, nominal : samples a second, and the shaft's nominal speed [Hz]
    order : of the ball pass, about
    """
    frequency, height, floor = squared_envelope(signal, rate, 4)

    def peak(near: float, width: float) -> tuple[float, float]:
        among = np.flatnonzero(np.abs(frequency - near) < width)
        k = int(among[np.argmax(height[among])])
        low, middle, high = np.log(height[k - 1 : k + 2])
        beside = 0.5 * (low - high) / (low - 2.0 * middle + high)
        return float(frequency[k] + beside * frequency[1]), float(height[k]) / floor

    line, line_height = peak(order * nominal, AROUND * order * nominal)
    shaft, shaft_height = peak(nominal, AROUND * nominal)
    others = [peak(k * line + m * shaft, 0.002 * k * line)[1] for k, m in NEIGHBOURS]
    return SpallLines(
        file=file,
        spall=spall,
        load=load,
        nominal=nominal,
        line=line / nominal,
        shaft=shaft / nominal,
        height=line_height,
        shaft_height=shaft_height,
        second=others[0],
        third=others[1],
        below=others[2],
        above=others[3],
    )


def squared_envelope(signal: Array, rate: float, padded: int) -> tuple[Array, Array, float]:
    """Frequencies [Hz] and heights of its spectrum, so many times zero padded, and the height of the floor."""
    time = np.arange(signal.size) / rate
    squared = envelope(time, signal, BAND) ** 2
    spectrum = np.fft.rfft((squared - squared.mean()) * np.hanning(signal.size), padded * signal.size)
    height: Array = np.asarray(np.abs(spectrum), dtype=float)
    frequency: Array = np.asarray(np.fft.rfftfreq(padded * signal.size, 1.0 / rate), dtype=float)
    return frequency, height, float(np.median(height[(frequency > FLOOR[0]) & (frequency < FLOOR[1])]))


def mean_line(signals: Sequence[Array], rate: float, shafts: Sequence[float], order: float) -> tuple[float, float]:
    """Order of the highest line near an order in the mean of spectra over it, and its height over the floor [1].

    Parameters
    ----------
    shafts : speeds [Hz]
    """
    orders, total = order * np.linspace(1.0 - AROUND, 1.0 + AROUND, 2001), np.zeros(2001)
    for signal, shaft in zip(signals, shafts, strict=True):
        frequency, height, floor = squared_envelope(signal, rate, 16)
        total += np.interp(orders * shaft, frequency, height / floor) / len(signals)
    k = int(np.argmax(total))
    return float(orders[k]), float(total[k])


def read_cwru(folder: Path, orders: dict[str, float], spalls: dict[int, str]) -> list[SpallLines]:
    """Drive-end recordings at 12 kHz; `spalls` says what each file number has.  Load in horsepower."""
    found = []
    for number, spall in spalls.items():
        path = only(folder, f"{number}*.mat")
        signal, speed = drive_end(path)
        load = float((re.search(r"_(\d)\.mat$", path.name) or ["", "nan"])[1])
        found.append(lines_of(signal, 12000.0, speed, orders[spall], file=str(number), spall=spall, load=load))
    return found


def drive_end(path: Path) -> tuple[Array, float]:
    """Signal of the drive end, and the speed that the file states [Hz]."""
    data = loadmat(path, squeeze_me=True)
    signal = np.asarray(next(data[key] for key in data if key.endswith("DE_time")), dtype=float)
    return signal, float(next(data[key] for key in data if key.endswith("RPM"))) / 60.0


def read_mfpt(folder: Path, orders: dict[str, float]) -> list[SpallLines]:
    """Recordings of MFPT with different loads [lb]."""
    found = []
    for path in sorted(folder.rglob("*RaceFault_vload_*.mat")):
        record = loadmat(path, squeeze_me=True, struct_as_record=False)["bearing"]
        spall = "inner" if path.name.startswith("Inner") else "outer"
        found.append(
            lines_of(
                np.asarray(record.gs, dtype=float),
                float(record.sr),
                float(record.rate),
                orders[spall],
                file=path.stem,
                spall=spall,
                load=float(record.load),
            )
        )
    if not found:
        raise SystemExit(f"{folder} has no recording of MFPT; expected InnerRaceFault_vload_1.mat and others.")
    return sorted(found, key=lambda one: (one.spall, one.load))


def only(folder: Path, pattern: str) -> Path:
    """The one recording of a pattern."""
    found = sorted(folder.rglob(pattern))
    found = [path for path in found if re.match(pattern.partition("*")[0] + r"\D", path.name)]
    if len(found) != 1:
        raise SystemExit(f"{folder} has {len(found)} recordings {pattern}; expected one: give the folder of 12 kHz.")
    return found[0]


def asked(arguments: Sequence[str]) -> tuple[Path | None, bool]:
    """Folder of the recordings, None where none is given, and whether the table is to be written anew."""
    folders = [Path(one) for one in arguments if one != "--write"]
    write = "--write" in arguments
    if write and not folders:
        raise SystemExit("--write needs the folder of the recordings: give it, or omit --write.")
    return (folders[0] if folders else None), write


def committed(name: str) -> list[SpallLines]:
    """The table of a name beside this file, written by an earlier reading of the recordings."""
    with (HERE / name).open(encoding="utf-8", newline="") as file:
        rows = csv.DictReader(line for line in file if not line.startswith("#"))
        names = [f.name for f in fields(SpallLines) if f.name not in ("file", "spall")]
        return [
            SpallLines(file=row["file"], spall=row["spall"], **{name: float(row[name]) for name in names})
            for row in rows
        ]


def commit(name: str, source: str, rows: Sequence[SpallLines]) -> None:
    """Write such a table."""
    with (HERE / name).open("w", encoding="utf-8", newline="") as file:
        file.write("".join(f"# {line}\n" for line in source.splitlines()))
        table = csv.DictWriter(file, [f.name for f in fields(SpallLines)], lineterminator="\n")
        table.writeheader()
        for row in rows:
            values = asdict(row)
            table.writerow({k: v if isinstance(v, str) else f"{v:.7g}" for k, v in values.items()})
