"""``ballpass stream``: a long run into one file, in memory that does not grow with it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ballpass.runtime.app.commands import options
from ballpass.runtime.app.commands.asked import read_asked, read_duration, read_quantity
from ballpass.runtime.app.commands.shared import command, load_model, show


def stream(
    scene: options.SceneOrFolder,
    out: Annotated[Path, typer.Option(metavar="FILE", help="NetCDF-4 file to write.")],
    sample_rate: Annotated[str, typer.Option(metavar="RATE", help='Samples a second: --sample-rate "51.2 kHz".')],
    cycles: options.Cycles = None,
    duration: options.Duration = None,
    of: Annotated[
        list[str] | None,
        typer.Option("--of", metavar="OUTPUT", help="Output to keep, inner.ax; may be repeated. Default: all."),
    ] = None,
    set_: options.Settings = None,
    rtol: options.Tolerance = None,
) -> None:
    """Simulate into a file, piece by piece, however long; ballpass spectrum and ballpass run --initial read it."""
    with command(scene) as stages:
        stages("read")
        seconds = read_duration(duration, cycles)
        rate = read_quantity("--sample-rate", sample_rate, "Hz")
        asked = read_asked(scene, set_, seconds)
        model = load_model(scene, stages, asked.run.method, None, rtol, overrides=asked.overrides)
        stages("simulate")
        statistics = model.stream(
            out,
            sample_rate=rate or 0.0,
            cycles=cycles,
            duration=seconds,
            parameters=asked.overrides,
            rtol=rtol,
            outputs=of,
            progress=stages.fraction,
        )
    size = out.stat().st_size / 1e6
    show(f"{out}: {statistics.duration:g} s in {statistics.wall_time:.3g} s, {size:.3g} MB")
