"""``ballpass stream``: a long run into one file, in memory that does not grow with it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated

from ballpass.runtime.app.commands import options
from ballpass.runtime.app.commands.load_scene import read_asked
from ballpass.runtime.app.commands.messages import show
from ballpass.runtime.app.commands.shared import command, load_model
from ballpass.runtime.contract.options import Cycles, Duration, Option, Rtol, options_in, refuse_unknown
from ballpass.runtime.questions import option_names

Of = Annotated[
    Sequence[str] | None,
    Option(
        words="Output to keep, `inner.ax`. May be repeated. All of the scene if none is given.",
        shown="OUTPUT",
        names=option_names.outputs,
    ),
]


def stream(
    scene: options.SceneOrFolder,
    out: Annotated[Path, Option(shown="FILE", words="File to write, NetCDF-4.")],
    sample_rate: Annotated[float, Option(words="Samples a second.", example='"51.2 kHz"', shown="RATE", unit="Hz")],
    cycles: Cycles = None,
    duration: Duration = None,
    of: Of = None,
    set_: options.Settings = None,
    rtol: Rtol = None,
) -> None:
    """Simulate into a file, piece by piece, for any length; ballpass spectrum and ballpass run --initial read it."""
    with command(scene) as stages:
        stages("reading the scene")
        source, overrides = read_asked(scene, set_, cycles, duration, 0.0)
        unknown = partial(refuse_unknown, options_in({"of": Of}), {"of": of})
        model = load_model(scene, stages, source.run.method, None, rtol, integrated=source.integrated, inspect=unknown)
        stages("simulating")
        statistics = model.stream(
            out,
            sample_rate=sample_rate,
            cycles=cycles,
            duration=duration,
            parameters=overrides,
            rtol=rtol,
            outputs=of,
            progress=stages.fraction,
        )
    size = out.stat().st_size / 1e6
    show(f"{out}: {statistics.duration:g} s in {statistics.wall_time:.3g} s, {size:.3g} MB")
