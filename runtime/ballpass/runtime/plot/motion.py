"""Motion of the inner ring: orbit (Fig. 5 of the paper), spectra (Fig. 6), phase portrait (Fig. 7)."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import StrMethodFormatter

from ballpass.runtime.ask.observables import hermite, orbits, stroboscopic_points
from ballpass.runtime.plot import PAPER
from ballpass.runtime.plot.record import Array, Record
from ballpass.runtime.plot.style import (
    APPLIED,
    FAINT,
    FIRST,
    GREY,
    INK,
    SAND,
    SECOND,
    SIGNAL,
    frame,
    legend_above,
    mark_angles,
    new_figure,
    shade_windows,
    styled,
)
from ballpass.runtime.time.turning import past
from ballpass.runtime.vibration.spectrum import AmplitudeSpectrum, Window, amplitude_spectrum

#: Points drawn between two samples where velocities are known: a resonance has only ten samples a period.
_FINER = 8

#: How crank harmonics and multiples of the ball-pass frequency are marked.
_HARMONICS: dict[str, Any] = {"color": GREY, "linestyle": (0, (1, 1.5)), "linewidth": 0.8}

#: Both axes in one panel, in styles that no mark has.
_BOTH: tuple[dict[str, Any], ...] = (FIRST | {"linewidth": 1.2}, {"color": SAND, "linestyle": "-", "linewidth": 2.4})
_BALL_PASS: dict[str, Any] = {"color": SIGNAL, "linestyle": (0, (6, 2)), "linewidth": 1.0}

#: Ratio of the extents above which equal scales would squeeze the path.
_SLIVER = 4.0

#: Lines of a spectrum that are drawn as such; more make a curve.
_STEMS = 400


def _path(record: Record, window: slice, axis: str, *, relative: bool = False) -> tuple[Array, Array, Array]:
    """Times [s], positions [m] and velocities [m/s] of the inner ring, between samples by the Hermite cubic.

    Without the velocity among the outputs: the samples, and no velocities.

    Parameters
    ----------
    relative : to the outer ring
    """
    t, x = record.t[window], record.values(f"inner.{axis}")[window]
    if relative:
        x = x - record.values(f"outer.{axis}")[window]
    speeds = [f"{ring}.v{axis}" for ring in ("inner", *(["outer"] if relative else []))]
    if not record.has(*speeds):
        return t, x, np.zeros(0)
    v = record.values(speeds[0])[window] - (record.values(speeds[1])[window] if relative else 0.0)
    fine = np.append((t[:-1, None] + np.diff(t)[:, None] * np.arange(_FINER) / _FINER).ravel(), t[-1])
    return fine, *hermite(t, x, v, fine)


@styled
def orbit(record: Record) -> Figure:
    """Path of the inner ring's centre: the last turn dark, the steady turns before it light and wide under it.

    With an elastic outer ring beside it the path relative to that ring, which loads the balls.
    """
    both = record.has("outer.x", "outer.y")
    figure = new_figure(5.0, layout=None)
    panels = figure.subplots(1, 2 if both else 1, squeeze=False)[0]
    equal = [draw_orbit(axes, record, relative=k == 1) for k, axes in enumerate(panels)]
    text = "Equal scales." if all(equal) else "Each axis has a scale of its own."
    if both:
        for axes, title in zip(panels, ("in the frame's axes", "relative to the outer ring"), strict=True):
            axes.set_title(title)
        text += f" The second path is what the {record.noun}s feel; dotted: the radial gap."
    if record.cycle_length is not None and record.turns:
        path = orbits(record.t, record.values("inner.x"), record.values("inner.y"), cycle_length=record.cycle_length)
        text += f" Start and end of the last turn are {1e6 * path[-1].gap:.3g} µm apart."
    title = record.title("Orbit of the inner ring's centre")
    if both:
        figure.legend(*panels[0].get_legend_handles_labels(), loc="lower center", ncols=3)
        frame(figure, title, f"{text} {record.settings()}.", left=0.9, below=1.2, wspace=0.3)
    else:
        panels[0].legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
        frame(figure, title, f"{text} {record.settings()}.", left=0.9, right=2.1)
    return figure


def draw_orbit(axes: Axes, record: Record, *, relative: bool = False) -> bool:
    """The path, with labels for a legend; whether both axes have one scale.

    Parameters
    ----------
    relative : to the outer ring, with a circle of the clearance
    """
    turns = record.cycle_turns
    name = "last turn" if turns == 1 else f"last {turns} turns"
    last = record.last_turns(turns)
    if last.start > 0:
        x, y = (1e6 * _path(record, slice(0, last.start + 1), axis, relative=relative)[1] for axis in "xy")
        # wide, to be seen where the last turn covers it
        axes.plot(x, y, color=FAINT, linestyle="-", linewidth=2.4, label="steady turns before it")
    (t, x, _), (_, y, _) = (_path(record, last, axis, relative=relative) for axis in "xy")
    x, y = 1e6 * x, 1e6 * y
    axes.plot(x, y, color=INK, linestyle="-", linewidth=1.1, label=name if record.turns else "path")
    _highlight_windows(axes, record, t, x, y)
    look: dict[str, Any] = {"color": "white", "markeredgecolor": "black", "linestyle": "none"}  # seen on any colour
    axes.plot(x[0], y[0], marker="o", markersize=9, label=f"start of the {name}", zorder=4, **look)
    axes.plot(x[-1], y[-1], marker="s", markersize=4.5, label=f"end of the {name}", zorder=5, **look)
    wide, high = (max(float(np.ptp(values)), 1e-9) for values in (x, y))
    equal = max(wide, high) < _SLIVER * min(wide, high)
    if equal:
        axes.set_aspect("equal", adjustable="datalim")
    else:
        words = f"not to one scale: the path is\n{wide:.3g} µm wide and {high:.3g} µm high"
        axes.text(0.98, 0.98, words, transform=axes.transAxes, ha="right", va="top", fontsize=8, color=GREY)
    if relative:
        around, radius = np.linspace(0.0, 2.0 * np.pi, 181), 1e6 * record.radial_gap
        if radius > 0.0:
            axes.plot(radius * np.cos(around), radius * np.sin(around), color=GREY, linestyle=(0, (1, 1.5)), zorder=1)
    if not equal:  # room for the words above the path
        bottom, top = axes.get_ylim()
        axes.set_ylim(bottom, top + (0.2 if PAPER.get()[0] is None else 0.45) * (top - bottom))  # two lines, or three
    against = " against the outer one" if relative else "'s centre"
    axes.set_xlabel(f"x of the inner ring{against} [µm]")
    axes.set_ylabel(f"y of the inner ring{against} [µm]")
    return equal


def _highlight_windows(axes: Axes, record: Record, t: Array, x: Array, y: Array) -> None:
    """The part of the path on which an applied load acts, thick."""
    angle = record.crank_angle(t)
    label = "an applied load acts"
    for start, end in record.load_windows():
        inside = past(angle, start) < end - start
        look: dict[str, Any] = {"color": APPLIED, "linestyle": "-", "linewidth": 1.9}
        axes.plot(np.where(inside, x, np.nan), np.where(inside, y, np.nan), label=label, **look)
        label = "_nolegend_"


@styled
def displacements(record: Record) -> Figure:
    """Positions of the ring's centre along x and y over the last two turns, those of an elastic outer ring beside."""
    window = record.last_turns(2)
    along, label = record.along(window)
    figure = new_figure(4.6, layout=None)
    panels = figure.subplots(2, 1, sharex=True)
    windows = record.load_windows() if record.turns else ()
    for axes, axis in zip(panels, "xy", strict=True):
        for ring, look in (("inner", FIRST), ("outer", SECOND)):
            if record.has(f"{ring}.{axis}"):
                axes.plot(along, 1e6 * record.values(f"{ring}.{axis}")[window], label=f"{ring} ring", **look)
        shade_windows(axes, windows, range(-1, int(along.max() // 360.0) + 1))
        axes.set_ylabel(f"{axis} [µm]")
    panels[1].set_xlim(float(along.min()), float(along.max()))
    if record.turns:
        mark_angles(panels[1], along, 12)
    panels[1].set_xlabel(label)
    if record.has("outer.x"):
        legend_above(figure, *panels[0].get_legend_handles_labels())
    shown = "Last two turns" if len(record.turns) >= 2 else "Last turn" if record.turns else "The whole record"
    text = f"{shown}; x and y have their own scales.{' Shaded: an applied load acts.' if windows else ''}"
    frame(figure, record.title("Displacements of the inner ring's centre"), f"{text} {record.settings()}.", hspace=0.12)
    return figure


@styled
def spectra(record: Record) -> Figure:
    """Displacement amplitude spectra along x and y, with crank harmonics and ball-pass frequency marked.

    With a longer run a third panel shows ball pass beside the nearest harmonic of the crank.
    """
    source = record.longer or record
    # few turns of a mechanism: its harmonics fall on lines.  Else a window keeps the leakage low
    exact = record.manifest.mechanism is not None and record.longer is None
    window: Window = "boxcar" if exact else "hann"
    lines = {
        axis: amplitude_spectrum(
            source.t, source.values(f"inner.{axis}") * 1e6, cycle_length=record.cycle_length, window=window
        )
        for axis in "xy"
    }
    marks = source.frequencies()
    shaft, ball_pass = (marks.shaft, marks.ball_pass_outer) if marks is not None else (0.0, 0.0)
    peak = max(float(np.max(s.amplitude)) for s in lines.values())
    floor = max(peak * 1e-4, 1e-12)
    limit = shown_range(list(lines.values()), shaft=shaft)
    apart = _apart(ball_pass, shaft) if shaft > 0.0 else 0.0
    closer = record.longer is not None and apart > 2.0 * lines["x"].resolution
    figure = new_figure(7.4 if closer else 5.6, layout=None)
    panels = figure.subplots(3 if closer else 2, 1)
    for axes, (axis, spectrum), letter in zip(panels, lines.items(), "ab", strict=False):
        _mark(axes, limit, shaft, ball_pass)
        shown = (spectrum.frequency > 0.0) & (spectrum.frequency <= limit)
        tops = np.maximum(spectrum.amplitude[shown], floor)
        if np.count_nonzero(shown) > _STEMS:
            axes.plot(spectrum.frequency[shown], tops, color=INK, linewidth=0.9)
        else:
            axes.vlines(spectrum.frequency[shown], floor, tops, color=INK, linewidth=1.2)
            dots = shown & (spectrum.amplitude > floor)
            axes.plot(spectrum.frequency[dots], spectrum.amplitude[dots], "o", color=INK, markersize=2.2)
        axes.set_title(f"{letter}) {axis} direction")
        axes.set_xlim(0.0, limit)
    crank = "crank" if record.manifest.mechanism is not None else "shaft"
    if closer:
        _draw_closer(panels[2], lines, shaft, ball_pass, (record.noun, crank), floor)
    for axes in panels:
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))  # not by mathtext, which is slow
        axes.minorticks_off()
        axes.set_ylim(floor, 4.0 * peak)
        axes.grid(visible=False, axis="x")
        axes.set_ylabel("amplitude [µm]")
    if not closer:
        panels[0].tick_params(labelbottom=False)
    panels[-1].set_xlabel("frequency [Hz]")
    spectrum = lines["x"]
    whole = f"{spectrum.cycles} whole turn{'s' if spectrum.cycles != 1 else ''}"
    cycles = "the whole record" if spectrum.cycles is None else whole
    weighting = "no window" if window == "boxcar" else "Hann window"
    text = f"Amplitude, mean removed, {cycles}, {weighting}, lines {spectrum.resolution:.3g} Hz apart."
    if shaft > 0.0:
        words = f"{crank} harmonics, {shaft:.4g} Hz", f"{record.noun} pass (BPFO) and multiples, {ball_pass:.4g} Hz"
        legend_above(figure, [Line2D([], [], **look | {"linewidth": 1.4}) for look in (_HARMONICS, _BALL_PASS)], words)
        text += _unresolved(ball_pass, shaft, spectrum.resolution, (record.noun, crank))
    title = record.title("Displacement spectra")
    frame(figure, title, f"{text} {source.settings()}.", hspace=0.45 if closer else 0.25)
    return figure


def _mark(axes: Axes, limit: float, shaft: float, ball_pass: float) -> None:
    for frequency, look in ((shaft, _HARMONICS), (ball_pass, _BALL_PASS)):
        if shaft > 0.0 and frequency > 0.0:
            every = frequency * np.arange(1, int(limit / frequency) + 1)
            axes.vlines(every, 0.0, 1.0, transform=axes.get_xaxis_transform(), zorder=0.5, **look)


def _draw_closer(
    axes: Axes,
    lines: dict[str, AmplitudeSpectrum],
    shaft: float,
    ball_pass: float,
    words: tuple[str, str],
    floor: float,
) -> None:
    """Ball pass and the nearest harmonic, x thin and dark over y, wide and light."""
    order = round(ball_pass / shaft)
    low, high = sorted((order * shaft, ball_pass))
    margin = max(3.0 * (high - low), 10.0 * lines["x"].resolution)
    low, high = low - margin, high + margin
    _mark(axes, high, shaft, ball_pass)
    for (axis, spectrum), look in zip(lines.items(), _BOTH, strict=True):
        shown = (spectrum.frequency >= low) & (spectrum.frequency <= high)
        tops = np.maximum(spectrum.amplitude[shown], floor)
        axes.plot(spectrum.frequency[shown], tops, label=axis, zorder=3 if axis == "x" else 2, **look)
    axes.set_xlim(low, high)
    noun, crank = words
    axes.set_title(f"c) {noun} pass beside harmonic {order} of the {crank}: x thin and dark, y wide and light")


def _apart(ball_pass: float, shaft: float) -> float:
    """Distance of ball pass from the nearest harmonic [Hz]."""
    return abs(ball_pass - max(round(ball_pass / shaft), 1) * shaft)


def shown_range(spectra: list[AmplitudeSpectrum], *, shaft: float) -> float:
    """Upper end of the frequency axis [Hz].

    Above it lines stay below 1 % of the highest; at least 12, at most 60 harmonics of a turn are shown.
    """
    top = max(float(np.max(s.amplitude)) for s in spectra)
    seen = (float(f) for s in spectra if top > 0.0 for f in s.frequency[s.amplitude >= 0.01 * top][-1:])
    wanted = max(seen, default=0.0)
    end = min(float(s.frequency[-1]) for s in spectra)
    if shaft > 0.0:
        wanted = min(max(1.1 * wanted, 12.5 * shaft), 60.5 * shaft)
    return min(max(wanted, end / 50.0), end)


def _unresolved(ball_pass: float, shaft: float, resolution: float, words: tuple[str, str]) -> str:
    """A warning where the record is too short to separate ball pass from its nearest crank harmonic."""
    order, distance = max(round(ball_pass / shaft), 1), _apart(ball_pass, shaft)
    if distance >= resolution:
        return ""
    needed = f"; separating them takes {int(np.ceil(shaft / distance))} turns" if distance > 1e-6 * shaft else ""
    noun, crank = words
    return (
        f" {noun.capitalize()} pass and {crank} harmonic {order} are {distance:.3g} Hz apart, within one line{needed}."
    )


@styled
def phase_portrait(record: Record) -> Figure:
    """Velocity over displacement along x, with the stroboscopic point of each turn; many points also by themselves."""
    _, x, v = _path(record, slice(0, record.t.size), "x")
    figure = new_figure(5.2, layout=None)
    text = "There is no period: no stroboscopic points."
    many = record.longer is not None and record.cycle_length is not None
    panels = figure.subplots(1, 2 if many else 1, squeeze=False, width_ratios=(1.7, 1.0) if many else None)[0]
    axes = panels[0]
    axes.plot(1e6 * x, 1e3 * v, color=INK, linewidth=0.8, alpha=0.85, label="steady turns" if record.turns else "path")
    if record.cycle_length is not None:
        source = record.longer or record
        points = stroboscopic_points(
            source.t,
            source.values("inner.x"),
            source.values("inner.vx"),
            cycle_length=record.cycle_length,
            offset=source.start_passed,
        )
        look: dict[str, Any] = {"color": SAND, "markeredgecolor": "black", "markeredgewidth": 0.7, "linestyle": "none"}
        for panel in panels:
            size = 7.5 if not many else 4.0
            panel.plot(
                1e6 * points.position,
                1e3 * points.velocity,
                marker="o",
                markersize=size,
                label="stroboscopic points, once a turn",
                zorder=5,
                **look,
            )
        count, mechanism = points.time.size, record.manifest.mechanism
        angle = record.parameter(mechanism.start_angle) if mechanism else 0.0
        what = "crank" if mechanism else "shaft"
        text = f"{count} stroboscopic point{'' if count == 1 else 's'}, at {what} angle {np.degrees(past(angle)):g}°."
        if many:
            panels[1].set_title("stroboscopic points alone")
            panels[1].set_ylabel("velocity along x [mm/s]")
            panels[1].ticklabel_format(useOffset=False)
            panels[1].locator_params(axis="x", nbins=4)
            dropped = source.solution.transient_cycles
            text += f" They are those of a longer run, {dropped:g} turns dropped; right: on scales of their own."
    axes.axhline(0.0, color=GREY, linewidth=0.6)
    for panel in panels:
        panel.set_xlabel("x of the inner ring's centre [µm]")
    axes.set_ylabel("velocity along x [mm/s]")
    axes.ticklabel_format(useOffset=False)
    handles, labels = axes.get_legend_handles_labels()
    legend_above(figure, handles, labels)
    title = record.title("Phase portrait along x")
    frame(figure, title, f"{text} {record.settings()}.", left=0.9, **({"wspace": 0.36} if many else {}))
    return figure
