"""``ballpass animate``: a run as a moving picture.

In: a scene.  Out: an HTML page that needs nothing else, an MP4 or a GIF.
"""

from __future__ import annotations

from functools import partial
from typing import Annotated

from ballpass.runtime.app.commands import options
from ballpass.runtime.app.commands.load_scene import read_asked
from ballpass.runtime.app.commands.messages import show, size_words
from ballpass.runtime.app.commands.shared import command, load_model, results_file
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.options import Cycles, Duration, Option, Rtol, Transient, options_in, refuse_unknown
from ballpass.runtime.plot import MOVING
from ballpass.runtime.questions import option_names

Shown = Annotated[
    str | None,
    Option(
        words="Of several bearings the one that a movie shows; a page opens with it.",
        shown="NAME",
        names=option_names.bearings,
    ),
]


def animate(
    scene: options.SceneOrFolder,
    format_: Annotated[
        str,
        Option(
            words="`html`, a page that needs no network and no server; `gif`; or `mp4`, which needs ffmpeg.",
            shown="KIND",
            flags=("--format",),
            choices=MOVING,
        ),
    ] = "html",
    last: Annotated[
        float,
        Option(
            words="Turns to show, the last ones of the run. Where nothing rotates, the whole run is shown.",
            shown="N",
            above=0.0,
        ),
    ] = 1.0,
    bearing: Shown = None,
    pictures: Annotated[
        int | None, Option(words="Pictures of a movie, 12 a second; 72 a turn if not given.", shown="N", least=2)
    ] = None,
    set_: options.Settings = None,
    cycles: Cycles = None,
    duration: Duration = None,
    transient: Transient = None,
    rtol: Rtol = None,
    out: options.ResultsFile = None,
) -> None:
    """Simulate a scene and write its last turn as a moving picture: linkage, bearings, forces and signals.

    The page has a slider, ball forces as colours, arrows of the reactions, and signals with a cursor.
    Open it in a browser; its address takes an angle: animation.html#angle=90.
    """
    with command(scene) as stages:
        stages("reading the scene")
        kind = "" if out is None or out.is_dir() else out.suffix.removeprefix(".")
        if kind in MOVING and format_ not in ("html", kind):
            raise RequestError(f"--format {format_} and --out {out} name two kinds of files. Omit --format.")
        format_ = kind if kind in MOVING else format_
        if pictures is not None and format_ == "html":
            raise RequestError("--pictures is of movies; a page has up to 1000 positions. Omit it, or --format gif.")
        if format_ != "html":
            from ballpass.runtime.plot.animate import count_pictures

            count_pictures(f".{format_}", last, pictures)  # impossible requests: refused before the simulation
        source, overrides = read_asked(scene, set_, cycles, duration, transient)
        path = results_file(out, scene, f"animation.{format_}", MOVING)
        unknown = partial(refuse_unknown, options_in({"bearing": Shown}), {"bearing": bearing})
        model = load_model(scene, stages, source.run.method, None, rtol, integrated=source.integrated, inspect=unknown)
        stages("simulating")
        solution = model.simulate(
            cycles=cycles,
            duration=duration,
            transient=transient,
            parameters=overrides,
            rtol=rtol,
            progress=stages.fraction,
        )
        stages("drawing figures")
        from ballpass.runtime.plot.animate import write_animation

        path.parent.mkdir(parents=True, exist_ok=True)
        write_animation(model, solution, path, turns=last, bearing=bearing, pictures=pictures, progress=stages.fraction)
    show(f"{path} ({size_words(path.stat().st_size)})")
