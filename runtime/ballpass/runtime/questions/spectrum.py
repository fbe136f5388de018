"""The spectral lines of a signal, and the characteristic frequency of a bearing that each belongs to."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.options import (
    Cycles,
    Duration,
    Option,
    RecordedRate,
    Rtol,
    TimeColumn,
    Transient,
    rate_of_samples,
)
from ballpass.runtime.contract.units import printed_unit, show, table_unit
from ballpass.runtime.questions import option_names
from ballpass.runtime.questions.question import AnyModel, Question
from ballpass.runtime.ratings.of_bearing import bearing_words
from ballpass.runtime.report.report import Report, ReportTable
from ballpass.runtime.report.reported import Reported
from ballpass.runtime.show.progress import Progress
from ballpass.runtime.show.short import ShortRepr
from ballpass.runtime.vibration.sensor import Sensor, sensor_of_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ballpass.runtime.contract.manifest import Manifest
    from ballpass.runtime.quantity.characteristic import CharacteristicLine
    from ballpass.runtime.solution.solution import Solution
    from ballpass.runtime.vibration.diagnosis import DiagnosisStatistics

#: Bands of a kurtogram are so many times as wide as the fastest line at least: impacts stay apart in them.
WIDTHS = 3.0
#: Samples a segment of the spectrogram of a run-up has of the whole, at most.
SEGMENTS = 40

#: Lines below this share of the highest are rounding, in amplitude [1].
ROUNDING = 1e-13

#: Samples of the window whose reading between two lines is computed, and the least reading of which nothing is said.
SAMPLES = 1000
LEAST_READING = 0.99

#: Fewest samples of a recording.
FEWEST = 16

#: Options of runs.
_OF_RUNS = ("sample_rate", "cycles", "duration", "transient", "rtol", "sensor")

#: What the short names of characteristic frequencies stand for.
MEANINGS = {
    "FTF": "turns of the cage",
    "BPFO": "balls passing a place of the outer raceway",
    "BPFI": "balls passing a place of the inner raceway",
    "2 BSF": "a place of a ball meeting either raceway",
}

SampleRate = Annotated[
    float | None,
    rate_of_samples("Lines up to half of this; the run is sampled as finely as the scene says at least."),
]
Of = Annotated[
    str | None,
    Option(
        words="Output or state with one value: `inner.y`, or `inner.ax` where `run.outputs` names it.",
        shown="OUTPUT",
        names=option_names.signals,
    ),
]
Recording = Annotated[
    str | Path | None,
    Option(
        words="A measured signal instead of a run: a CSV or NetCDF file. The scene's bearings name its lines.",
        shown="FILE",
        reader=Path,
    ),
]
SignalColumn = Annotated[
    str | None, Option(words="Column of the recording; the only one beside the time if not given.", shown="COLUMN")
]
Band = Annotated[
    tuple[float, float] | None,
    Option(words="The envelope of this band instead of the signal.", example="2kHz:8kHz", shown="LOW:HIGH", unit="Hz"),
]
Kurtogram = Annotated[
    bool,
    Option(words="The envelope of the band with the highest kurtosis, in which impacts ring.", flags=("--kurtogram",)),
]
ThroughSensor = Annotated[
    Sensor | None,
    Option(
        words="What a sensor makes of the output, its mounting, filter, noise and bits.",
        example='"resonance=8 kHz, low_pass=10 kHz"',
        shown="SENSOR",
        reader=sensor_of_text,
    ),
]
Orders = Annotated[
    bool, Option(words="Over multiples of the shaft's speed, also where that changes.", flags=("--orders",))
]
AsMap = Annotated[
    bool, Option(words="Draw amplitudes over time and frequency instead, as of a run-up.", flags=("--spectrogram",))
]
Window = Annotated[
    str, Option(words="Window of `scipy.signal`: `hann`, `boxcar`, `flattop`, `blackmanharris`.", shown="NAME")
]
Scaling = Annotated[
    str,
    Option(
        words="`amplitude`, `power` of the lines, or `density` of the power.",
        shown="HOW",
        choices=("amplitude", "power", "density"),
    ),
]
Top = Annotated[int, Option(words="Lines of the table.", shown="N", least=1)]


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class SignalSpectrum(ShortRepr, Reported):
    """A spectrum with its highest lines named.

    Attributes
    ----------
    of, unit : the signal
    envelope : band whose envelope was taken [Hz], None for the signal itself
    kurtosis : of the band that the kurtogram chose, 0 for noise; None without one [1]
    orders : whether positions are multiples of the shaft's speed instead of frequencies
    spectrogram : whether the figure is one over time
    window, scaling : of the spectrum
    position, height : of all lines [Hz or 1], [`height_unit`]
    height_unit : SI unit of the heights
    resolution : distance of two lines
    highest : places of the highest local maxima, highest first
    marks : characteristic frequencies or orders
    statistics : of the signal
    solution : its steady part
    warnings : what to mind
    notes : how a recording was read

    Examples
    --------
    >>> found = model.spectrum("drive_torque", cycles=12, transient=2, orders=True, top=1)
    >>> found.names
    ('shaft',)
    """

    of: str
    unit: str
    envelope: tuple[float, float] | None
    kurtosis: float | None
    orders: bool
    spectrogram: bool
    window: str
    scaling: str
    position: np.ndarray
    height: np.ndarray
    height_unit: str
    resolution: float
    highest: tuple[int, ...]
    marks: tuple[CharacteristicLine, ...]
    statistics: DiagnosisStatistics
    solution: Solution
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """What the highest lines are: "BPFO", "2 shaft"; empty for what is none."""
        from ballpass.runtime.quantity.characteristic import name_of

        return tuple(name_of(self._top(k), self.marks, self.resolution) for k in self.highest)

    @property
    def mark_heights(self) -> tuple[float, ...]:
        """Height at each characteristic frequency, of the nearest line; nan above the last one [`height_unit`]."""
        places = (round(mark.frequency / self.resolution) for mark in self.marks)
        return tuple(float(self.height[k]) if k < len(self.height) else math.nan for k in places)

    def _top(self, k: int) -> float:
        """Position of a local maximum: that of the parabola through the logarithms of three lines."""
        low, high, behind = np.log(np.maximum(self.height[k - 1 : k + 2], 1e-300 + 1e-9 * self.height[k]))
        bend = low - 2.0 * high + behind
        return float(self.position[k] + (self.resolution * 0.5 * (low - behind) / bend if bend < 0.0 else 0.0))

    def _report(self) -> Report:
        rows = [
            {
                "order" if self.orders else "frequency": float(self.position[k]),
                self.scaling: float(self.height[k]),
                "line": name,
            }
            for k, name in zip(self.highest, self.names, strict=True)
        ]
        across = "order" if self.orders else "frequency [Hz]"
        infos = (*self.solution.manifest.states, *self.solution.manifest.outputs)
        words = next((info.description for info in infos if info.name == self.of), "")
        factor, height_unit = table_unit(self.height_unit)
        columns: dict[str, Callable[[tuple[float, float, str]], str]] = {
            f">{across}": lambda line: f"{line[0]:.6g}",
            f">{self.scaling} [{height_unit}]": lambda line: "" if math.isnan(line[1]) else f"{factor * line[1]:.4g}",
            "line": lambda line: line[2],
        }
        highest = zip(self.position[list(self.highest)], self.height[list(self.highest)], self.names, strict=True)
        title = f"Highest lines of {self.of}{': ' if words else ''}{words[:1].lower()}{words[1:]}"
        table = ReportTable.of(highest, columns, title=title)
        marks = [(mark.frequency, own, mark.label) for mark, own in zip(self.marks, self.mark_heights, strict=True)]
        at_marks = ReportTable.of(marks, columns, title="Heights at the characteristic lines")
        s = self.statistics
        said = [f"lines of the spectrum are {self.resolution:.3g}{'' if self.orders else ' Hz'} apart", *self.notes]
        names = dict.fromkeys(mark.name for mark in self.marks)
        abbreviated = "; ".join(f"{name}: {MEANINGS[name]}" for name in names if name in MEANINGS)
        abbreviated = bearing_words(abbreviated, self.solution.manifest.bearings)
        said += [abbreviated] if abbreviated else []
        times, shown = table_unit(self.unit)
        said.append(
            f"rms {times * s.rms:.4g} {shown}, peak {times * s.peak:.4g} {shown}, crest factor {s.crest_factor:.3g}, "
            f"kurtosis {s.kurtosis:.3g}, skewness {s.skewness:.3g}"
        )
        if self.scaling != "density" and (low := _lowest_reading(self.window)) < LEAST_READING:
            low = low if self.scaling == "amplitude" else low**2
            said.append(
                f"window {self.window}: the height of a frequency between two lines reads up to "
                f"{100 * (1 - low):.0f} % low; --window flattop reads it right"
            )
        if self.envelope is not None:
            low, high = self.envelope
            chosen = "" if self.kurtosis is None else f", chosen by its kurtosis of {self.kurtosis:.3g}"
            said.append(f"envelope of {low:.5g} to {high:.5g} Hz{chosen}")
        facts = {
            **self._named("of", "unit", "window", "scaling", "envelope", "kurtosis", "resolution"),
            "statistics": asdict(s),
            "characteristic": [
                asdict(mark) | {self.scaling: own} for mark, own in zip(self.marks, self.mark_heights, strict=True)
            ],
            "lines": rows,
            "notes": list(self.notes),
            "units": {"resolution": "Hz"},
            "figure": None,  # the command puts the file here
        }
        return Report(
            parts=(table, *([at_marks] if self.marks else []), *said), facts=facts, records=rows, warnings=self.warnings
        )


def _lowest_reading(window: str) -> float:
    """Height that a sine of amplitude 1 has midway between two lines."""
    from ballpass.runtime.vibration.spectrum import window_weights

    weights = window_weights(window, SAMPLES)
    return float(abs(np.exp(1j * np.pi * np.arange(SAMPLES) / SAMPLES) @ weights) / np.sum(weights))


def _check(values: Mapping[str, Any]) -> None:
    recorded = values["recording"] is not None
    if (values["of"] is not None) == recorded:
        raise RequestError(
            "--recording gives the signal, and --of was given as well. Omit one of the two."
            if recorded
            else "--of is missing. It takes: output or state with one value: `inner.y`, or `inner.ax` where "
            "`run.outputs` names it. For a measured signal give --recording FILE."
        )
    of_run = [f"--{name.replace('_', '-')}" for name in _OF_RUNS if recorded and values[name] is not None]
    of_recording = [f"--{name}" for name in ("signal", "time", "rate") if not recorded and values[name] is not None]
    for wrong in (*of_run, *of_recording):
        what = "a run, and --recording gives the signal" if recorded else "a recording, and there is no --recording"
        raise RequestError(f"{wrong} is of {what}. Omit it.")
    if values["kurtogram"] and values["envelope"] is not None:
        raise RequestError("--kurtogram chooses the band, and --envelope was given as well. Omit one of the two.")
    if values["orders"] and values["scaling"] != "amplitude":
        raise RequestError("--orders gives amplitudes, and --scaling was given as well. Omit one of the two.")
    if values["orders"] and values["spectrogram"]:
        raise RequestError("--orders and --spectrogram were both given. Omit one of the two.")


def _figures(_model: AnyModel, found: SignalSpectrum, _parameters: Any) -> Iterator[tuple[str, Figure]]:
    from ballpass.runtime.plot.style import label
    from ballpass.runtime.plot.vibration import draw_lines, draw_spectrogram

    solution, band = found.solution, found.envelope
    infos = (*solution.manifest.states, *solution.manifest.outputs)
    described = next((info.description for info in infos if info.name == found.of), found.of)
    words = described[:1].lower() + described[1:]
    what = f"envelope of {found.of}, {band[0]:g} to {band[1]:g} Hz" if band else found.of
    title = f"{solution.manifest.title}: {what}"
    if found.spectrogram:
        from ballpass.runtime.quantity.characteristic import characteristic_lines, mean_speeds
        from ballpass.runtime.vibration.diagnosis import envelope, spectrogram

        signal = solution[found.of]
        values = envelope(solution.t, signal, band) if band else signal
        length = float(solution.t[-1] - solution.t[0])
        over_time = spectrogram(solution.t, values, segment=length / SEGMENTS, window=found.window)
        numbers = mean_speeds(solution)
        orders = characteristic_lines(solution.manifest, numbers, orders=True)
        speed = np.zeros(len(over_time.time))
        if orders:
            rate = np.gradient(_angle(solution), solution.t)
            speed = np.abs(np.interp(over_time.time, solution.t, rate)) / (2.0 * np.pi)
        yield "spectrogram", draw_spectrogram(over_time, orders, speed, title=title, unit=found.unit)
        return
    factor, shown = table_unit(found.height_unit)
    figure = draw_lines(
        found.position,
        factor * found.height,
        found.marks,
        title=title,
        across="order of the shaft [1]" if found.orders else "frequency [Hz]",
        up=label(f"{found.scaling} of {'the envelope of ' if band else ''}{words}", shown),
        text=f"{found.window} window, lines {found.resolution:.3g}{'' if found.orders else ' Hz'} apart.",
    )
    yield "spectrum", figure


def _files(found: SignalSpectrum) -> Mapping[str, bytes]:
    text = io.BytesIO()
    across = "order [1]" if found.orders else "frequency [Hz]"
    heads = f"{across},{found.scaling} of {found.of} [{found.height_unit}]"
    np.savetxt(text, np.column_stack([found.position, found.height]), "%.9g", ",", header=heads, comments="")
    return {"spectrum.csv": text.getvalue()}


@Question(
    stage="computing the spectrum",
    samples=True,
    needs="scipy",
    check=_check,
    figures=_figures,
    files=_files,
    always=True,
    takes_runs=True,
    digits=True,
)
def spectrum(
    model: AnyModel,
    of: Of = None,
    *,
    recording: Recording = None,
    signal: SignalColumn = None,
    time: TimeColumn = None,
    rate: RecordedRate = None,
    envelope: Band = None,
    kurtogram: Kurtogram = False,
    sensor: ThroughSensor = None,
    orders: Orders = False,
    spectrogram: AsMap = False,
    window: Window = "hann",
    scaling: Scaling = "amplitude",
    top: Top = 10,
    sample_rate: SampleRate = None,
    cycles: Cycles = None,
    duration: Duration = None,
    transient: Transient = None,
    parameters: Mapping[str, float] | None = None,
    rtol: Rtol = None,
    progress: Progress = None,
) -> SignalSpectrum:
    """The highest lines of a signal of the steady motion, each with its name: BPFO, BPFI, 2 BSF, FTF, the shaft.

    The signal is an output of a run, or a recording of the machine in its own unit. Without a length the run has as
    many turns as tell the ball pass from the shaft's multiples.

    Parameters
    ----------
    parameters : overrides, SI
    progress : as for `simulate`

    Raises
    ------
    RequestError
        A wrong request, or a signal that has one value for each ball.
    IntegrationError
        The computation failed.

    Examples
    --------
    >>> model.spectrum("drive_torque", cycles=12, transient=2, orders=True, top=1).names
    ('shaft',)
    """
    from ballpass.runtime.quantity.characteristic import carries_lines, characteristic_lines, mean_speeds
    from ballpass.runtime.solution.solution import Solution
    from ballpass.runtime.time.timeline import is_even
    from ballpass.runtime.vibration.diagnosis import diagnosis, order_spectrum
    from ballpass.runtime.vibration.diagnosis import envelope as envelope_of
    from ballpass.runtime.vibration.diagnosis import kurtogram as kurtogram_of
    from ballpass.runtime.vibration.spectrum import amplitude_spectrum, power_spectrum

    channel, notes, warnings = of or "", tuple[str, ...](), tuple[str, ...]()
    if recording is not None:
        changing = isinstance(model, Solution) or not is_even(model.manifest, model.numbers(parameters).values)
        if changing and (orders or spectrogram or isinstance(model, Solution)):
            raise RequestError(
                "--recording: its lines are named by a scene, over orders and time by one of constant speed. Allowed: "
                "ballpass spectrum SCENE --recording FILE. Give a scene, with the speed of the recording (--set)."
            )
        run, channel, unit, notes = _recorded(model, Path(recording), signal, time, rate, parameters)
    elif isinstance(model, Solution):
        if any(item is not None for item in (sample_rate, cycles, duration, rtol, parameters or None)):
            raise RequestError(
                "This is a finished run: options of a simulation do not apply. Allowed: --of, --envelope, "
                "--orders, --spectrogram, --window, --scaling, --top, --transient."
            )
        run = model if transient is None else replace(model, transient_cycles=transient)
        warnings = _too_slow(run)
    else:
        states = [info.name for info in model.manifest.states]
        scene_rate = _scene_rate(model.manifest, model.numbers(parameters).values)
        finest = scene_rate if sensor is None else max(scene_rate, sensor.rate)
        wanted = finest if sample_rate is None and finest > scene_rate else sample_rate
        run = model.simulate(
            cycles=_turns(model, parameters, transient) if cycles is None and duration is None else cycles,
            duration=duration,
            transient=transient,
            parameters=parameters,
            rtol=rtol,
            sample_rate=None if wanted is None else wanted * max(1, math.ceil(finest / wanted)),
            outputs=[] if channel in states and channel not in model.outputs else [channel],
            progress=progress,
        )
    if run[channel].ndim != 1:
        ball = bearing_words("ball", run.manifest.bearings, channel)
        raise RequestError(
            f"--of: {channel} has one value for each {ball}. Allowed: an output with one value, as inner.ax."
        )
    if sensor is not None:
        run = replace(run, outputs={**run.outputs, channel: _measured(run, channel, sensor)})
    solution = run.steady()
    samples = solution[channel]
    numbers = mean_speeds(solution) if recording is None else {**run.parameters, **run.constants}
    kurtosis = None
    if kurtogram:
        fastest = max((mark.frequency for mark in characteristic_lines(solution.manifest, numbers)), default=0.0)
        best = kurtogram_of(solution.t, samples, WIDTHS * fastest)[0]
        envelope, kurtosis = (best.low, best.high), best.kurtosis
    values = samples if envelope is None else envelope_of(solution.t, samples, envelope)
    t, even = solution.t[:-1], values[:-1]  # the end of a whole number of turns is their start again
    if recording is None:
        unit = next((i.unit for i in (*solution.manifest.outputs, *solution.manifest.states) if i.name == channel), "")
    if orders or scaling == "amplitude":
        if orders:
            lines = order_spectrum(_angle(solution), values, window=window)
        else:
            lines = amplitude_spectrum(t, even, window=window)
        position, height, resolution = lines.frequency, lines.amplitude, lines.resolution
        height_unit = unit
    else:
        kind: Literal["spectrum", "density"] = "spectrum" if scaling == "power" else "density"
        power = power_spectrum(t, even, window=window, scaling=kind)
        position, height, resolution = power.frequency, power.power, power.resolution
        height_unit = f"({unit})^2" + ("/Hz" if scaling == "density" else "")
    if sample_rate is not None and not orders:
        within = position <= 0.5 * sample_rate * (1.0 + 1e-9)
        position, height = position[within], height[within]
    marks = characteristic_lines(solution.manifest, numbers, orders=orders)
    if recording is None and not carries_lines(solution.manifest, channel):
        marks = tuple(mark for mark in marks if not mark.of_bearing)
    changing = solution.period is None and run.cycle_length is not None
    return SignalSpectrum(
        of=channel,
        unit=unit,
        envelope=envelope,
        kurtosis=kurtosis,
        orders=orders,
        spectrogram=spectrogram,
        window=window,
        scaling=scaling,
        position=position,
        height=height,
        height_unit=height_unit,
        resolution=resolution,
        highest=_peaks(height, top, ROUNDING if height_unit == unit else ROUNDING**2),
        marks=() if changing and not orders else marks,
        statistics=diagnosis(samples),
        solution=solution,
        warnings=warnings,
        notes=notes,
    )


def _recorded(
    model: AnyModel,
    path: Path,
    signal: str | None,
    time: str | None,
    rate: float | None,
    parameters: Mapping[str, float] | None,
) -> tuple[Solution, str, str, tuple[str, ...]]:
    """A recording in place of a run, its column, its unit, and words on how it was read."""
    from ballpass.runtime.contract.column_files import read_columns
    from ballpass.runtime.contract.status import Status
    from ballpass.runtime.fit.measured import said_numbers
    from ballpass.runtime.solution.solution import Solution, Statistics
    from ballpass.runtime.time.timeline import shaft_speed
    from ballpass.runtime.time.turning import TURN

    file = read_columns(path)
    t = file.time(time, rate)
    clock = file.time_column(time).head if rate is None else None
    others = [one.head for one in file.columns if one.head != clock]
    if signal is None and len(others) != 1:
        listed = ", ".join(map(show, others)) or "none"
        raise RequestError(f"--signal: {path.name} has several columns. Allowed: {listed}. Name one.")
    column = file.column(signal or others[0])
    samples = file.numbers(column)
    if len(t) < FEWEST or not (np.all(np.isfinite(t)) and np.all(np.isfinite(samples)) and np.all(np.diff(t) > 0.0)):
        raise RequestError(
            f"{path.name}: {len(t)} rows. Allowed: {FEWEST} or more, each with a number, and times that increase. "
            "Leave out rows without a number at the ends, or fill them."
        )
    said, left_out = said_numbers(model.manifest, path.name, file.said)
    numbers = model.numbers({**said, **(parameters or {})})
    turns = shaft_speed(model.manifest, numbers.values) / TURN
    run = Solution(
        t=t,
        x=np.zeros((len(t), len(model.manifest.states))),
        outputs={column.name: samples},
        parameters=numbers.parameters,
        constants={info.name: numbers.values[info.name] for info in model.manifest.constants},
        cycle_length=1.0 / abs(turns) if turns else None,
        transient_cycles=0.0,
        manifest=model.manifest,
        statistics=Statistics(method="recording", reason=str(path), rtol=0.0),
        status=Status.DONE,
    )
    layout = f" ({file.layout})" if file.layout else ""
    words = f"{column.head} of {path.name}{layout}: {len(t)} samples in {t[-1] - t[0]:.6g} s"
    speed = f"lines are those at {60.0 * abs(turns):.6g} rpm; --set gives the speed of the recording"
    return run, column.name, printed_unit(column.unit), (words, speed, *left_out)


def _measured(run: Solution, of: str, sensor: Sensor) -> np.ndarray:
    """A signal of a run as a sensor gives it; its noise is the same in every call."""
    from ballpass.runtime.vibration.spectrum import even_samples

    time, values = even_samples(run.t, run[of])
    rate = (len(time) - 1) / (time[-1] - time[0])
    if rate < sensor.rate * (1.0 - 1e-9):
        raise RequestError(
            f"--sensor: the run was sampled at {rate:.6g} Hz, and the sensor filters up to a tenth of "
            f"{sensor.rate:.6g} Hz. Sample it at {sensor.rate:.6g} Hz, or ask for the scene's spectrum."
        )
    return sensor.measured(values, rate, np.random.default_rng(0))


def _scene_rate(manifest: Manifest, values: Mapping[str, float]) -> float:
    """Samples a second that the scene says [Hz]; 0 where nothing turns."""
    from ballpass.runtime.time.timeline import shaft_speed
    from ballpass.runtime.time.turning import TURN

    return manifest.run.samples_per_cycle * abs(shaft_speed(manifest, values)) / TURN


def _too_slow(run: Solution) -> tuple[str, ...]:
    """A warning where a run that is done was sampled more slowly than its scene says."""
    rate = (len(run.t) - 1) / (run.t[-1] - run.t[0]) if len(run.t) > 1 else math.inf
    finest = _scene_rate(run.manifest, {**run.parameters, **run.constants})
    if rate >= finest * (1.0 - 1e-6):
        return ()
    return (
        f"The run was sampled at {rate:.6g} Hz, its scene says {finest:.6g} Hz: what lies above {rate / 2.0:.6g} Hz is "
        "folded below it and stands among the lines. Sample it at the scene's rate, or ask for the scene's spectrum.",
    )


def _turns(model: AnyModel, parameters: Mapping[str, float] | None, transient: float | None) -> float | None:
    """Turns of a run that separates ball pass from the shaft; None for those of the scene, where turns differ."""
    from ballpass.runtime.quantity.characteristic import turns_to_separate
    from ballpass.runtime.time.repetition import Repetition

    manifest, values = model.manifest, model.numbers(parameters).values
    repetition, settings = Repetition.of(manifest, values), model.run_settings
    dropped = settings.transient_cycles if transient is None else transient
    if not repetition.holds(repetition.driver.after(dropped)):
        return None
    stated = repetition.driver.turns(0.0, settings.duration or 0.0) if settings.cycles is None else settings.cycles
    return max(stated, dropped + turns_to_separate(manifest, values))


def _angle(solution: Solution) -> np.ndarray:
    """Angle of driver or shaft at the samples, counted beyond a turn [rad]."""
    from ballpass.runtime.time.timeline import driver, start_angle

    mechanism, values = solution.manifest.mechanism, {**solution.parameters, **solution.constants}
    if mechanism is not None and mechanism.angle:
        return solution[mechanism.angle]
    turning = driver(solution.manifest, values)
    if turning.fastest == 0.0:
        raise RequestError("--orders: nothing turns in this scene, so that there are no orders. Omit it.")
    return np.asarray(turning.at(solution.t)[0] - start_angle(solution.manifest, values))


def _peaks(height: np.ndarray, top: int, least: float) -> tuple[int, ...]:
    """Places of the highest local maxima, highest first; without the line of frequency zero and its neighbour.

    Parameters
    ----------
    least : share of the highest line below which others are rounding [1]
    """
    inner = np.flatnonzero((height[1:-1] >= height[:-2]) & (height[1:-1] > height[2:])) + 1
    inner = inner[(inner > 1) & (height[inner] > least * np.max(height))]
    return tuple(int(k) for k in inner[np.argsort(height[inner])[::-1][:top]])
