"""A moving picture as GIF or MP4, by matplotlib's writers: linkage, bearing, and a signal with a cursor.

In: the frames of `animation`.  Out: a file.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from subprocess import CalledProcessError
from typing import Any

import numpy as np
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from PIL import Image

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.folders import replaced
from ballpass.runtime.plot.animation import Frames
from ballpass.runtime.plot.bearing import LOAD_COLOURS, RING, draw_bearing
from ballpass.runtime.plot.mechanism import BAR, MechanismView, draw_mechanism, view
from ballpass.runtime.plot.record import Record
from ballpass.runtime.plot.style import INK, SAND, SIGNAL, TITLE, new_figure, settings, shade_windows
from ballpass.runtime.time.turning import past

#: Pictures of a movie, and of these a second.
PICTURES, RATE = 72, 12

#: Dots an inch: 720 pixels wide.
DPI = 90


def write_movie(frames: Frames, path: Path, *, progress: Callable[[float], None] = lambda done: None) -> Path:
    """Write a movie whose kind is that of the file's ending, ``.gif`` or ``.mp4``.

    Raises
    ------
    RequestError
        An MP4 needs the program ffmpeg, which is not on PATH or fails.
    """
    writer = writer_of(path.suffix)
    record = frames.records[0]
    shown = frames.samples.tolist()
    seen = view(record, shown) if record.manifest.mechanism is not None else None
    with settings(), replaced(path) as made:
        figure = new_figure(5.8, layout=None)
        FigureCanvasAgg(figure)  # the writers draw with the figure's canvas
        try:
            with writer.saving(figure, str(made), DPI):
                for number, sample in enumerate(shown):
                    figure.clear()
                    _draw(figure, record, sample, shown, seen, turning=frames.turning)
                    writer.grab_frame()
                    progress((number + 1) / len(shown))
        except CalledProcessError as fault:
            if isinstance(fault.__context__, KeyboardInterrupt):  # an interrupt ends ffmpeg too
                raise KeyboardInterrupt from None
            said = fault.stderr.strip().splitlines()
            raise RequestError(
                f"The program ffmpeg ended with code {fault.returncode}: {said[-1] if said else 'no message'}. An "
                "MP4 takes one with the encoder libx264: ffmpeg -encoders lists them. Or take --format gif or html."
            ) from None
    return path


class _GifWriter(PillowWriter):
    """Pictures with one palette and no dither, which takes a third of the bytes."""

    _frames: list[Image.Image]

    def finish(self) -> None:
        if not self._frames:
            return  # interrupted before the first one
        palette = Image.new("P", (1, 1))
        palette.putpalette(_palette())
        self._frames = [
            picture.convert("RGB").quantize(palette=palette, dither=Image.Dither.NONE) for picture in self._frames
        ]
        super().finish()


def _palette() -> list[int]:
    """Colours of loads, greys, and the colours of lines as they fade into paper and raceways; 256 times three."""
    shades = [LOAD_COLOURS(np.linspace(0.0, 1.0, 96))[:, :3], np.linspace([0.0] * 3, [1.0] * 3, 48)]
    for colour, ground in ((INK, "white"), (SIGNAL, "white"), (BAR, "white"), (SAND, "white"), (INK, RING), (INK, BAR)):
        shades.append(np.linspace(to_rgb(colour), to_rgb(ground), 18))
    found = np.vstack(shades)
    found = found[np.min(found, axis=1) < 0.95]  # nearly white becomes white
    return [int(part) for part in np.rint(255.0 * np.vstack((np.ones((1, 3)), found))[:256]).ravel()]


def writer_of(kind: str) -> AbstractMovieWriter:
    """Matplotlib's writer of files with this ending; errors as for `write_movie`."""
    if kind == ".gif":
        return _GifWriter(fps=RATE)
    if not FFMpegWriter.isAvailable():
        raise RequestError(
            "An MP4 is made by the program ffmpeg, which is not on PATH. Install it (apt install ffmpeg, conda install "
            "ffmpeg, brew install ffmpeg), or take --format gif or html, which need nothing."
        )
    # all players need even numbers of pixels and this layout of colours
    return FFMpegWriter(fps=RATE, codec="libx264", extra_args=["-pix_fmt", "yuv420p", "-crf", "20"])


def _draw(
    figure: Figure, record: Record, sample: int, shown: list[int], seen: MechanismView | None, *, turning: bool
) -> None:
    grid = figure.add_gridspec(2, 2, height_ratios=(3.4, 1.0), width_ratios=(0.8, 1.0))
    upper: Any = [grid[0, 0], grid[0, 1]] if seen is not None and record.can_draw_bearing else [grid[0, :]]
    if seen is not None:
        draw_mechanism(figure.add_subplot(upper[0]), record, sample, seen)
    if record.can_draw_bearing:
        draw_bearing(figure.add_subplot(upper[-1]), record, sample, shown)
    axes = figure.add_subplot(grid[1, :])
    degrees = np.degrees(record.crank_angle())
    turned = degrees - 360.0 * np.floor(min(degrees[shown[0]], degrees[shown[-1]]) / 360.0 + 1e-9)
    across = turned if turning else 1e3 * record.t
    part = slice(shown[0], shown[-1] + 1)
    if record.can_draw_bearing:
        axes.plot(across[part], record.highest_ball_force()[part], color=INK, linewidth=1.1)
        axes.set_ylabel(f"highest\n{record.noun} force [N]")
    elif record.has("drive_torque"):
        axes.plot(across[part], record.values("drive_torque")[part], color=INK, linewidth=1.1)
        axes.set_ylabel("drive\ntorque [N·m]")
    low, high = sorted((float(across[shown[0]]), float(across[shown[-1]])))
    axes.set_xlim(low, high)
    if turning:
        shade_windows(axes, record.load_windows(), range(int(low // 360.0) - 1, int(high // 360.0) + 1))
        axes.set_xticks(np.arange(np.ceil(low / 90.0 - 1e-6) * 90.0, high + 1e-6, 90.0))
    driver = "crank" if record.manifest.mechanism is not None else "shaft"
    axes.set_xlabel(f"{driver} angle [°]" if turning else "time [ms]")
    axes.axvline(across[sample], color=SIGNAL, linewidth=1.8)
    now = (
        f"{driver} angle {np.degrees(past(np.radians(degrees[sample]))):.0f}°"
        if turning
        else f"t = {1e3 * record.t[sample]:.4g} ms"
    )
    figure.suptitle(record.title(record.manifest.title), x=0.02, y=0.985, **TITLE)
    figure.text(0.98, 0.945, now, ha="right", va="top", fontsize=9)
    figure.subplots_adjust(left=0.11, right=0.97, bottom=0.1, top=0.9, hspace=0.06, wspace=0.05)
