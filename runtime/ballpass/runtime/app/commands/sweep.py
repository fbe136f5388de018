"""``ballpass sweep``: a quantity over a grid of parameters, all members of the grid in lanes and threads.

In: a scene, ranges of some of its numbers, names of observables.  Out: a table (CSV), the grid (NetCDF), figures, and
what ran (JSON).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Annotated, cast

import typer

from ballpass.runtime.app.commands import options
from ballpass.runtime.app.commands.load_scene import read_asked, read_with_settings
from ballpass.runtime.app.commands.messages import complain, note, show, show_files, show_json, show_parts, warn
from ballpass.runtime.app.commands.shared import command, figure_formats, load_model, results_folder
from ballpass.runtime.app.interrupted import say_interrupted
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.options import Cycles, Duration, Option, Rtol, Transient, options_in, refuse_unknown
from ballpass.runtime.plot import on_paper
from ballpass.runtime.questions import option_names

if TYPE_CHECKING:
    from ballpass.runtime.app.commands.sweep_results import Sweep
    from ballpass.runtime.request.locating import Kinks

Of = Annotated[
    Sequence[str] | None,
    option_names.quantity(
        "Quantity: `peak_ball_force` (or `max:ball.force`), `rms:inner.y`, `range:inner.x`, `mean:`, `min:` … "
        "May be repeated. Peak ball force and motion of the inner ring if none is given."
    ),
]

Method = Annotated[
    str | None,
    Option(words="`auto`, or a stepper's name as in `ballpass run`.", shown="NAME", names=option_names.stepper_methods),
]

AtKinks = Annotated[
    str | None,
    Option(
        words="What steps do where a law has a kink or jump: `stepped-over`, in lanes, or `located`, one member at a "
        "time. If not given, as in `ballpass run`.",
        shown="CHOICE",
        names=option_names.kinks,
    ),
]

#: Most members that the terminal shows one by one; of more only the extremes.
ROWS = 24

#: Failures that the terminal names; all are in the files.
NAMED = 5

#: Up to so many members each is run twice by default, to see how many digits its numbers have.
TWINS = 1000


def sweep(
    scene: options.SceneOrFolder,
    vary: Annotated[
        Sequence[str] | None,
        Option(
            shown="PATH=A:B:N",
            words='N values of a number of the scene from A to B: `--vary bearing.clearance="5 um:40 um:8"`. With '
            "`:log` after N they are spaced by a factor; `bearing.clearance=CN:8` goes through a group of clearance. "
            "May be repeated: all combinations run, the last one varying fastest.",
        ),
    ] = None,
    of: Of = None,
    set_: options.Settings = None,
    cycles: Cycles = None,
    duration: Duration = None,
    transient: Transient = None,
    rtol: Rtol = None,
    method: Method = None,
    kinks: AtKinks = None,
    digits: Annotated[
        bool | None,
        Option(
            words="Run each member at a tighter tolerance as well, and print the digits that both share, or ±. If not "
            f"given: up to {TWINS} members.",
            flags=("--digits/--no-digits", "--growth/--no-growth"),
        ),
    ] = None,
    threads: Annotated[
        int | None,
        Option(
            words="Threads; as many as processors if not given. The results are the same to the bit for any number.",
            shown="N",
            least=1,
        ),
    ] = None,
    scheduler: options.Scheduler = None,
    workers: options.Workers = None,
    out: options.ResultsFolder = None,
    json_: options.Json = False,
    figures: options.Figures = True,
    format_: options.FigureFormats = None,
    width_: options.FigureWidth = None,
    titles_: options.FigureTitles = True,
) -> None:
    """Run a scene for all values of one or more of its numbers; write table, grid and figures.

    A member that fails is named and has no number in its place; the others are kept. Exit code 1 if all fail.
    """
    import numpy as np

    from ballpass.runtime.app.commands.ranges import grid, read_ranges
    from ballpass.runtime.app.commands.sweep_results import TABLE, Sweep
    from ballpass.runtime.app.transient_words import warnings_of_transient
    from ballpass.runtime.certify.method_choice import default_compared
    from ballpass.runtime.many.cluster import connected
    from ballpass.runtime.quantity.grammar import default_quantities

    with command(scene) as stages, on_paper(width_, titles=titles_):
        stages("reading the scene")
        # how many turns a duration is, members with other speeds decide
        length = (cycles, None, transient) if duration is None else ()
        if scene.is_dir():
            source, overrides = read_asked(scene, set_)
        else:
            _, source, overrides = read_with_settings(scene, set_, *length)
        ranges = read_ranges(source, vary or [], overrides)
        folder = results_folder(out, scene, "sweep.*", "sweep_*")
        formats = figure_formats(format_, wanted=figures)
        varied = grid(ranges)
        count = math.prod(one.count for one in ranges)
        fixed = {path: np.full(count, value) for path, value in overrides.items()}
        with connected(scheduler, workers) as client:
            model = load_model(
                scene,
                stages,
                "",
                integrated=source.integrated,
                needs="ballpass sweep",
                inspect=partial(refuse_unknown, options_in({"of": Of}), {"of": of}),
            )
            if model.states:
                _ = model.ensemble_driver  # compiled here, where it is announced
            stages("simulating")
            result = model.simulate_many(
                {**varied, **fixed},
                of or default_compared(model.manifest) or default_quantities(model.manifest),
                cycles=cycles,
                duration=duration,
                transient=transient,
                rtol=rtol,
                method=method,
                kinks=cast("Kinks | None", kinks),
                threads=threads,
                uncertainty=count <= TWINS if digits is None else digits,
                client=client,
                progress=stages.fraction,
            )
        refused = [failure for failure in result.failures if failure.status == "REFUSED"]
        if len(refused) == count:
            raise RequestError(f"--vary: none of the {count} members can be simulated. The first: {refused[0].message}")
        stages("writing results")
        swept = Sweep(result=result, ranges=ranges, fixed=overrides)
        for member in dict.fromkeys((0, count - 1)):
            at = {name: float(values[member]) for name, values in varied.items()}
            if member not in {failure.member for failure in result.failures}:
                for words in warnings_of_transient(
                    model, {**overrides, **at}, cycles=cycles, duration=duration, transient=transient
                ):
                    warn(f"{swept.place(member)}: {words}")
        files = swept.write(folder, formats)
    if formats and len(ranges) > 2:
        note(f"no figure: a figure shows one or two varied parameters, and {len(ranges)} vary. Numbers are in {TABLE}.")
    if digits is None and count > TWINS:
        note(f"{count} members: none was run twice, and how many digits hold is not known; --digits does.")
    if json_:
        show_json(swept.report())
    else:
        table = swept.all_members() if count <= ROWS else swept.extremes()
        show_parts(table)
        show(f"{count} members, {len(result.failures)} without results.")
        show_files(folder, files)
    _warn_of_members(swept, count)
    if result.interrupted:
        say_interrupted()
        raise typer.Exit(130)
    if len(result.failures) == count:
        complain(f"none of the {count} members has results: {result.failures[0].message}")
        raise typer.Exit(1)


def _warn_of_members(swept: Sweep, count: int) -> None:
    """Warnings about members without results, and those whose numbers have no digits."""
    from ballpass.runtime.app.commands.sweep_results import TABLE

    failures = swept.result.failures
    for failure in failures[:NAMED]:
        warn(f"{swept.place(failure.member)}: {failure.status}: {failure.message}")
    if len(failures) > NAMED:
        warn(f"and {len(failures) - NAMED} more members without results; {TABLE} names all.")
    scattering = swept.scattering
    if len(scattering):
        warn(
            f"{len(scattering)} of {count} members amplify small errors: another tolerance gives other numbers, within "
            f"about their ±. First: {swept.place(scattering[0])}. Take statistics over more turns (--cycles), and "
            "compare no single extremes of them."
        )
