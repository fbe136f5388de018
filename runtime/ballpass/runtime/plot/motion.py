"""Motion of the inner ring: orbit (Fig. 5 of the paper), spectra (Fig. 6), phase portrait (Fig. 7)."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import StrMethodFormatter

from ballpass.runtime.ask.observables import hermite, orbits, stroboscopic_points
from ballpass.runtime.ask.spectrum import AmplitudeSpectrum, Window, amplitude_spectrum
from ballpass.runtime.plot.record import Array, Record
from ballpass.runtime.plot.style import GREY, INK, SAND, SIGNAL, frame, legend_above, new_figure, styled

#: Points drawn between two samples where velocities are known: a resonance has but ten samples a period.
_FINER = 8

#: How crank harmonics and multiples of the ball-pass frequency are marked.
_HARMONICS: dict[str, Any] = {"color": "#adb5bd", "linestyle": (0, (1, 1.5)), "linewidth": 0.7}
_BALL_PASS: dict[str, Any] = {"color": SIGNAL, "linestyle": (0, (6, 2)), "linewidth": 1.2}

#: Ratio of the extents from which equal scales would leave a sliver.
_SLIVER = 4.0


def _path(record: Record, window: slice, axis: str) -> tuple[Array, Array, Array]:
    """Times [s], positions [m] and velocities [m/s] of the inner ring, between samples by the Hermite cubic.

    Without the velocity among the outputs: the samples, and no velocities.
    """
    t, x = record.t[window], record.values(f"inner.{axis}")[window]
    if not record.has(f"inner.v{axis}"):
        return t, x, np.zeros(0)
    fine = np.append((t[:-1, None] + np.diff(t)[:, None] * np.arange(_FINER) / _FINER).ravel(), t[-1])
    return fine, *hermite(t, x, record.values(f"inner.v{axis}")[window], fine)


@styled
def orbit(record: Record) -> Figure:
    """Path of the inner ring's centre: the last turn dark, the steady turns before it light and wide under it."""
    figure = new_figure(5.4, layout=None)
    axes = figure.add_subplot()
    equal = draw_orbit(axes, record)
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
    scales = "Equal scales." if equal else "Each axis has a scale of its own."
    gap = ""
    if record.cycle_length is not None and record.turns:
        path = orbits(record.t, record.values("inner.x"), record.values("inner.y"), cycle_length=record.cycle_length)
        gap = f" Start and end of the last turn are {1e6 * path[-1].gap:.3g} µm apart."
    title = record.title("Orbit of the inner ring's centre")
    frame(figure, title, f"{scales}{gap} {record.settings()}.", left=0.9, right=2.1)
    return figure


def draw_orbit(axes: Axes, record: Record) -> bool:
    """The path, with labels for a legend; whether both axes have one scale."""
    last = record.last_turns(1)
    if last.start > 0:
        x, y = (1e6 * _path(record, slice(0, last.start + 1), axis)[1] for axis in "xy")
        # wide, to be seen where the last turn covers it
        axes.plot(x, y, color=SAND, linewidth=2.4, label="steady turns before it")
    (t, x, _), (_, y, _) = (_path(record, last, axis) for axis in "xy")
    x, y = 1e6 * x, 1e6 * y
    axes.plot(x, y, color=INK, linewidth=1.1, label="last turn" if record.turns else "path")
    _highlight_windows(axes, record, t, x, y)
    start: dict[str, Any] = {"color": "white", "markeredgecolor": INK, "markersize": 8}
    axes.plot(x[0], y[0], "o", label="start of the last turn", zorder=4, **start)
    axes.plot(x[-1], y[-1], "s", color=INK, markersize=4, label="end of the last turn", zorder=5)
    wide, high = (max(float(np.ptp(record.values(f"inner.{axis}"))), 1e-15) for axis in "xy")
    equal = max(wide, high) < _SLIVER * min(wide, high)
    if equal:
        axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x of the inner ring's centre [µm]")
    axes.set_ylabel("y of the inner ring's centre [µm]")
    return equal


def _highlight_windows(axes: Axes, record: Record, t: Array, x: Array, y: Array) -> None:
    """The part of the path on which an applied load acts, thick."""
    angle = record.crank_angle(t)
    label = "an applied load acts"
    for start, end in record.load_windows():
        inside = (angle - start) % (2.0 * np.pi) < end - start
        axes.plot(np.where(inside, x, np.nan), np.where(inside, y, np.nan), color=SIGNAL, linewidth=1.9, label=label)
        label = "_nolegend_"


@styled
def spectra(record: Record) -> Figure:
    """Displacement amplitude spectra along x and y, with crank harmonics and ball-pass frequency marked."""
    length = record.cycle_length
    # a mechanism repeats each turn: its harmonics fall on lines.  Without one a window keeps the leakage low
    window: Window = "boxcar" if record.manifest.mechanism is not None else "hann"
    lines = {
        axis: amplitude_spectrum(record.t, record.values(f"inner.{axis}") * 1e6, cycle_length=length, window=window)
        for axis in "xy"
    }
    marks = record.frequencies()
    frequencies = (marks.shaft, marks.ball_pass_outer) if marks is not None and marks.shaft > 0.0 else ()
    figure = new_figure(5.6, layout=None)
    panels = figure.subplots(2, 1, sharex=True, sharey=True)
    peak = max(float(np.max(s.amplitude)) for s in lines.values())
    floor = max(peak * 1e-4, 1e-12)
    limit = shown_range(list(lines.values()), shaft=marks.shaft if marks else 0.0)
    for axes, (axis, spectrum), letter in zip(panels, lines.items(), "ab", strict=True):
        shown = (spectrum.frequency > 0.0) & (spectrum.frequency <= limit)
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))  # not by mathtext, which is slow
        axes.minorticks_off()
        axes.set_ylim(floor, 4.0 * peak)
        for frequency, look in zip(frequencies, (_HARMONICS, _BALL_PASS), strict=False):
            every = frequency * np.arange(1, int(limit / frequency) + 1)
            axes.vlines(every, 0.0, 1.0, transform=axes.get_xaxis_transform(), zorder=0.5, **look)
        tops = np.maximum(spectrum.amplitude[shown], floor)
        axes.vlines(spectrum.frequency[shown], floor, tops, color=INK, linewidth=1.2)
        dots = shown & (spectrum.amplitude > floor)
        axes.plot(spectrum.frequency[dots], spectrum.amplitude[dots], "o", color=INK, markersize=2.6)
        axes.grid(visible=False, axis="x")
        axes.set_title(f"{letter}) {axis} direction")
        axes.set_ylabel("amplitude [µm]")
    panels[-1].set_xlim(0.0, limit)
    panels[-1].set_xlabel("frequency [Hz]")
    spectrum = lines["x"]
    whole = f"{spectrum.cycles} whole turn{'s' if spectrum.cycles != 1 else ''}"
    cycles = "the whole record" if spectrum.cycles is None else whole
    weighting = "no window" if window == "boxcar" else "Hann window"
    text = f"Amplitude, mean removed, {cycles}, {weighting}, lines {spectrum.resolution:.3g} Hz apart."
    if frequencies:
        shaft, ball_pass = frequencies
        crank = "crank" if record.manifest.mechanism is not None else "shaft"
        words = f"{crank} harmonics, {shaft:.4g} Hz", f"ball pass (BPFO) and multiples, {ball_pass:.4g} Hz"
        legend_above(figure, [Line2D([], [], **look | {"linewidth": 1.4}) for look in (_HARMONICS, _BALL_PASS)], words)
        text += _unresolved(ball_pass, shaft, spectrum.resolution, crank)
    frame(figure, record.title("Displacement spectra"), f"{text} {record.settings()}.", hspace=0.25)
    return figure


def shown_range(spectra: list[AmplitudeSpectrum], *, shaft: float) -> float:
    """Upper end of the frequency axis [Hz].

    Above it lines stay below 1 % of the highest; at least 12, at most 60 harmonics of a turn are shown.
    """
    top = max(float(np.max(s.amplitude)) for s in spectra)
    wanted = max((float(s.frequency[s.amplitude >= 0.01 * top][-1]) for s in spectra if top > 0.0), default=0.0)
    end = min(float(s.frequency[-1]) for s in spectra)
    if shaft > 0.0:
        wanted = min(max(1.1 * wanted, 12.5 * shaft), 60.5 * shaft)
    return min(max(wanted, end / 50.0), end)


def _unresolved(ball_pass: float, shaft: float, resolution: float, crank: str) -> str:
    """A warning where the record is too short to tell ball pass and its nearest crank harmonic apart."""
    order = max(round(ball_pass / shaft), 1)
    distance = abs(ball_pass - order * shaft)
    if distance >= resolution:
        return ""
    needed = f"; telling them apart takes {int(np.ceil(shaft / distance))} turns" if distance > 1e-6 * shaft else ""
    return f" Ball pass and {crank} harmonic {order} are {distance:.3g} Hz apart, within one line{needed}."


@styled
def phase_portrait(record: Record) -> Figure:
    """Velocity over displacement along x, with the stroboscopic point of each turn."""
    _, x, v = _path(record, slice(0, record.t.size), "x")
    figure = new_figure(5.2, layout=None)
    axes = figure.add_subplot()
    axes.plot(1e6 * x, 1e3 * v, color=INK, linewidth=0.8, alpha=0.85, label="steady turns" if record.turns else "path")
    text = "There is no period: no stroboscopic points."
    if record.cycle_length is not None:
        points = stroboscopic_points(
            record.t, record.values("inner.x"), record.values("inner.vx"), cycle_length=record.cycle_length
        )
        look: dict[str, Any] = {"color": SAND, "markeredgecolor": "black", "markeredgewidth": 0.9, "markersize": 7.5}
        label = "stroboscopic points, once a turn"
        axes.plot(1e6 * points.position, 1e3 * points.velocity, "o", label=label, zorder=5, **look)
        count, mechanism = points.time.size, record.manifest.mechanism
        angle = np.degrees(record.parameter(mechanism.start_angle)) if mechanism else 0.0
        what = "crank" if mechanism else "shaft"
        text = f"{count} stroboscopic point{'' if count == 1 else 's'}, at {what} angle {angle % 360.0:g}°."
    axes.axhline(0.0, color=GREY, linewidth=0.6)
    axes.set_xlabel("x of the inner ring's centre [µm]")
    axes.set_ylabel("velocity along x [mm/s]")
    legend_above(figure)
    frame(figure, record.title("Phase portrait along x"), f"{text} {record.settings()}.", left=0.9)
    return figure
