"""``ballpass spectrum``: the lines of a signal, and which characteristic frequency of which bearing each is.

In: a scene, or a file of a run.  Out: a table of the highest lines, statistics of diagnosis, a figure.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from ballpass.runtime.app.commands import options
from ballpass.runtime.app.commands.asked import read_asked, read_duration, read_formats, read_quantity
from ballpass.runtime.app.commands.shared import (
    Stages,
    can_draw,
    check_folder,
    command,
    load_model,
    name_of,
    show,
    show_json,
)
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.extras import need
from ballpass.runtime.run.tables import show_tables, simple_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ballpass.runtime.quantity.characteristic import CharacteristicLine
    from ballpass.runtime.run.solution import Solution

SCALINGS = ("amplitude", "power", "density")
#: Samples a segment of the spectrogram of a run-up has of the whole, at most.
SEGMENTS = 40


@dataclass(frozen=True, slots=True, kw_only=True)
class Lines:
    """A spectrum as it is shown: positions and heights of its lines, with their units."""

    position: np.ndarray
    height: np.ndarray
    resolution: float
    over: str
    unit: str


def spectrum(
    scene: Annotated[
        Path,
        typer.Argument(
            metavar="SCENE",
            help="Scene file (TOML), or the solution.nc of a run, or what ballpass stream wrote.",
            show_default=False,
        ),
    ],
    of: Annotated[str, typer.Option("--of", metavar="OUTPUT", help="Output or state of the scene: inner.ax.")],
    envelope: Annotated[
        str | None,
        typer.Option(metavar="LOW:HIGH", help="The envelope of this band instead of the signal: 2kHz:8kHz."),
    ] = None,
    orders: Annotated[
        bool, typer.Option("--orders", help="Over multiples of the shaft's speed, also where that changes.")
    ] = False,
    spectrogram: Annotated[
        bool, typer.Option("--spectrogram", help="Draw amplitudes over time and frequency, as of a run-up.")
    ] = False,
    window: Annotated[
        str, typer.Option(metavar="NAME", help="Window of scipy.signal: hann, boxcar, flattop, blackmanharris.")
    ] = "hann",
    scaling: Annotated[
        str, typer.Option(metavar="HOW", help="amplitude, power of the lines, or density of the power.")
    ] = "amplitude",
    top: Annotated[int, typer.Option(metavar="N", help="Lines of the table.")] = 10,
    sample_rate: options.SampleRate = None,
    cycles: options.Cycles = None,
    duration: options.Duration = None,
    transient: options.Transient = None,
    set_: options.Settings = None,
    rtol: options.Tolerance = None,
    out: options.ResultsFolder = None,
    json_: options.Json = False,
    figures: options.Figures = True,
    format_: options.FigureFormats = None,
) -> None:
    """The highest lines of a signal of the steady motion, and what each is: BPFO, BPFI, 2 BSF, FTF, the shaft."""
    with command(scene) as stages:
        band = _read_band(envelope)
        _check(scaling, top, orders=orders, spectrogram=spectrogram)
        need("scipy")  # before anything is simulated
        folder = out if out is not None else Path("results") / name_of(scene)
        figures, formats = figures and can_draw(), read_formats(format_)
        if figures:
            check_folder(folder)
        if scene.suffix == ".nc":
            given = (sample_rate, cycles, duration, set_, rtol)
            if any(one is not None for one in given):
                raise RequestError(
                    f"{scene} holds a run that is done: options of a simulation have no place. Allowed: --of, "
                    "--envelope, --orders, --spectrogram, --window, --scaling, --top, --transient."
                )
            from ballpass.runtime.run.solution_file import load_solution

            stages("read")
            solution = load_solution(scene)
        else:
            solution = _simulated(scene, stages, of, sample_rate, cycles, duration, transient, set_, rtol)
        if transient is not None:
            from dataclasses import replace

            solution = replace(solution, transient_cycles=transient)
        stages("spectrum")
        from ballpass.runtime.ask.vibration import diagnosis
        from ballpass.runtime.quantity.characteristic import characteristic_lines, identify

        steady = solution.steady()
        signal = _signal(steady, of)
        unit = next((i.unit for i in (*steady.manifest.outputs, *steady.manifest.states) if i.name == of), "")
        t = steady.t
        statistics = diagnosis(signal)
        found = _lines(steady, t, signal, unit, band, window, scaling, orders=orders)
        values = {**solution.parameters, **solution.constants}
        changing = solution.period is None and solution.cycle_length is not None
        marks = () if changing and not orders else characteristic_lines(steady.manifest, values, orders=orders)
        peaks = _peaks(found, top)
        rows = [
            {
                "order" if orders else "frequency": float(found.position[k]),
                scaling: float(found.height[k]),
                "line": identify(float(found.position[k]), marks, found.resolution),
            }
            for k in peaks
        ]
        files: list[Path] = []
        if figures:
            stages("draw")
            from ballpass.runtime.plot.style import write_figures

            drawn = _draw(steady, found, marks, of, signal, unit, band, scaling, window, as_map=spectrogram)
            folder.mkdir(parents=True, exist_ok=True)
            files = write_figures([drawn], folder, formats, f"{drawn[0]}.md")
    if json_:
        show_json(
            {
                "of": of,
                "unit": unit,
                "window": window,
                "scaling": scaling,
                "envelope": list(band) if band else None,
                "resolution": found.resolution,
                "statistics": asdict(statistics),
                "characteristic": [asdict(mark) for mark in marks],
                "lines": rows,
                "figure": str(files[0]) if files else None,
            }
        )
        return
    _show(rows, found, marks, statistics, of, unit, orders=orders)
    if files:
        show(f"figure: {', '.join(map(str, files[:-1]))}")


def _check(scaling: str, top: int, *, orders: bool, spectrogram: bool) -> None:
    if scaling not in SCALINGS:
        raise RequestError(f"--scaling: {scaling!r} is none of the choices. Allowed: {', '.join(SCALINGS)}.")
    if orders and scaling != "amplitude":
        raise RequestError("--orders gives amplitudes, and --scaling was given as well. Leave one of the two away.")
    if orders and spectrogram:
        raise RequestError("--orders and --spectrogram were both given. Leave one of the two away.")
    if top < 1:
        raise RequestError(f"--top: {top} lines cannot be shown. Allowed: a whole number from 1 on.")


def _read_band(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    low, colon, high = text.partition(":")
    if not colon:
        raise RequestError(f"--envelope: {text!r} is no band. Allowed: two frequencies, as in 2kHz:8kHz.")
    edges = [read_quantity("--envelope", _spaced(edge), "Hz") for edge in (low, high)]
    return edges[0] or 0.0, edges[1] or 0.0


def _spaced(edge: str) -> str:
    """A number and its unit, with a space between: 2kHz."""
    digits = edge.strip().rstrip("kMHz ")
    return f"{digits} {edge.strip()[len(digits) :].strip()}"


def _simulated(
    scene: Path,
    stages: Stages,
    of: str,
    sample_rate: str | None,
    cycles: float | None,
    duration: str | None,
    transient: float | None,
    set_: list[str] | None,
    rtol: float | None,
) -> Solution:
    stages("read")
    seconds = read_duration(duration, cycles)
    rate = read_quantity("--sample-rate", sample_rate, "Hz")
    asked = read_asked(scene, set_, seconds, transient)
    model = load_model(scene, stages, asked.run.method, None, rtol, overrides=asked.overrides)
    states = [info.name for info in model.manifest.states]
    stages("simulate")
    return model.simulate(
        cycles=cycles,
        duration=seconds,
        transient=transient,
        parameters=asked.overrides,
        rtol=rtol,
        sample_rate=rate,
        outputs=[] if of in states and of not in model.outputs else [of],
        progress=stages.fraction,
    )


def _signal(solution: Solution, of: str) -> np.ndarray:
    signal = solution[of]
    if signal.ndim != 1:
        raise RequestError(f"--of: {of} has one value for each ball. Allowed: an output with one value, as inner.ax.")
    return signal


def _lines(
    solution: Solution,
    t: np.ndarray,
    signal: np.ndarray,
    unit: str,
    band: tuple[float, float] | None,
    window: str,
    scaling: str,
    *,
    orders: bool,
) -> Lines:
    from ballpass.runtime.ask.spectrum import amplitude_spectrum, power_spectrum
    from ballpass.runtime.ask.vibration import envelope, order_spectrum

    if band is not None:
        signal = envelope(t, signal, band)
    if orders:
        found = order_spectrum(_angle(solution), signal, window=window)
        return Lines(
            position=found.frequency, height=found.amplitude, resolution=found.resolution, over="order", unit=unit
        )
    if scaling == "amplitude":
        whole = amplitude_spectrum(t, signal, window=window)
        return Lines(
            position=whole.frequency, height=whole.amplitude, resolution=whole.resolution, over="Hz", unit=unit
        )
    power = power_spectrum(t, signal, window=window, scaling="spectrum" if scaling == "power" else "density")
    square = f"({unit})^2" + ("/Hz" if scaling == "density" else "")
    return Lines(position=power.frequency, height=power.power, resolution=power.resolution, over="Hz", unit=square)


def _angle(solution: Solution) -> np.ndarray:
    """Angle of driver or shaft at the samples, counted on beyond a turn [rad]."""
    from ballpass.runtime.run.inputs import shaft_speed

    mechanism = solution.manifest.mechanism
    if mechanism is not None and mechanism.angle:
        return solution[mechanism.angle]
    speed = shaft_speed(solution.manifest, {**solution.parameters, **solution.constants})
    if speed == 0.0:
        raise RequestError("--orders: nothing turns in this scene, so that there are no orders. Leave it away.")
    return np.asarray(speed * solution.t)


def _peaks(found: Lines, top: int) -> list[int]:
    """Places of the highest local maxima, highest first; without the line of frequency zero and its neighbour."""
    height = found.height
    inner = np.flatnonzero((height[1:-1] >= height[:-2]) & (height[1:-1] > height[2:])) + 1
    inner = inner[inner > 1]
    return [int(k) for k in inner[np.argsort(height[inner])[::-1][:top]]]


def _draw(
    solution: Solution,
    found: Lines,
    marks: tuple[CharacteristicLine, ...],
    of: str,
    signal: np.ndarray,
    unit: str,
    band: tuple[float, float] | None,
    scaling: str,
    window: str,
    *,
    as_map: bool,
) -> tuple[str, Figure]:
    from ballpass.runtime.plot.style import label, unit_words
    from ballpass.runtime.plot.vibration import draw_lines, draw_spectrogram

    infos = (*solution.manifest.states, *solution.manifest.outputs)
    described = next((info.description for info in infos if info.name == of), of)
    words = described[:1].lower() + described[1:]
    what = f"envelope of {of}, {band[0]:g} to {band[1]:g} Hz" if band else of
    title = f"{solution.manifest.title}: {what}"
    if as_map:
        from ballpass.runtime.ask.vibration import envelope, spectrogram
        from ballpass.runtime.quantity.characteristic import characteristic_lines

        values = envelope(solution.t, signal, band) if band else signal
        length = float(solution.t[-1] - solution.t[0])
        shown = spectrogram(solution.t, values, segment=length / SEGMENTS, window=window)
        numbers = {**solution.parameters, **solution.constants}
        orders = characteristic_lines(solution.manifest, numbers, orders=True)
        speed = np.zeros(len(shown.time))
        if orders:
            speed = np.abs(np.interp(shown.time, solution.t, np.gradient(_angle(solution), solution.t))) / (2.0 * np.pi)
        figure = draw_spectrogram(shown, orders, speed, title=title, unit=unit_words(unit))
        return "spectrogram", figure
    heads = {"order": "order of the shaft [1]", "Hz": "frequency [Hz]"}
    figure = draw_lines(
        found.position,
        found.height,
        marks,
        title=title,
        across=heads[found.over],
        up=label(f"{scaling} of {'the envelope of ' if band else ''}{words}", found.unit),
        text=f"{window} window, lines {found.resolution:.3g}{' Hz' if found.over == 'Hz' else ''} apart.",
    )
    return "spectrum", figure


def _show(
    rows: list[dict[str, Any]],
    found: Lines,
    marks: tuple[CharacteristicLine, ...],
    statistics: Any,
    of: str,
    unit: str,
    *,
    orders: bool,
) -> None:
    across = "order" if orders else "frequency [Hz]"
    table = simple_table(f"Highest lines of {of}", [across, found.unit, "line"], right=[across, found.unit])
    for row in rows:
        position, height, line = row.values()
        table.add_row(f"{position:.6g}", f"{height:.4g}", line)
    show_tables(table)
    if marks:
        words = ", ".join(f"{mark.label} {mark.frequency:.6g}" for mark in marks)
        show(f"{words}{'' if orders else ' Hz'}; lines {found.resolution:.3g} apart")
    s = statistics
    show(
        f"rms {s.rms:.4g} {unit}, peak {s.peak:.4g} {unit}, crest factor {s.crest_factor:.3g}, kurtosis "
        f"{s.kurtosis:.3g}, skewness {s.skewness:.3g}"
    )
