"""``ballpass sensitivity``: which parameters move what, with a certificate for each number."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ballpass.runtime.app.commands import options
from ballpass.runtime.app.commands.asked import read_asked, read_formats
from ballpass.runtime.app.commands.shared import (
    can_draw,
    check_folder,
    command,
    complain,
    json_text,
    load_model,
    show,
    show_json,
)
from ballpass.runtime.run.tables import show_tables

#: Rows of a table on the terminal.
ROWS = 15


def sensitivity(
    scene: options.SceneOrFolder,
    of: Annotated[
        list[str] | None,
        typer.Option(
            metavar="Q",
            help="Quantity: max:ball.force (or peak_ball_force), rms:inner.y, value:inner.y@240deg, "
            "amplitude:inner.y@bpfo, drive_work, static_deflection@240deg ... May be repeated. Peak ball force and "
            "motion of the rings if none is given.",
        ),
    ] = None,
    wrt: Annotated[
        list[str] | None,
        typer.Option(
            metavar="P",
            help='Parameter by its path in the scene, or a pattern, as "bearing.*". May be repeated. All if none is '
            "given.",
        ),
    ] = None,
    set_: options.Settings = None,
    cycles: options.Cycles = None,
    transient: options.Transient = None,
    rtol: Annotated[
        float | None, typer.Option(metavar="R", help="Tolerance of the states; tight if not given.")
    ] = None,
    sensitivity_rtol: Annotated[
        float | None, typer.Option(metavar="R", help="Tolerance of the derivatives; tight if not given.")
    ] = None,
    method: Annotated[
        str, typer.Option(metavar="NAME", help="Of the derivatives: auto, or a stepper's name.")
    ] = "auto",
    no_check: Annotated[bool, typer.Option("--no-check", help="Give derivatives without certificates.")] = False,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for report and charts; none are written if not given.")
    ] = None,
    json_: options.Json = False,
    format_: options.FigureFormats = None,
) -> None:
    """Differentiate quantities of interest by parameters, and check every derivative by a second route.

    Exit code 1 where the two routes disagree; both numbers are told. Charts rank what moves a quantity most.
    """
    with command(scene) as stages:
        stages("read")
        formats = read_formats(format_)
        overrides = read_asked(scene, set_).overrides
        if out is not None:
            check_folder(out)
        model = load_model(scene, stages, method, overrides=overrides)
        begun: list[str] = []

        def progress(words: str, fraction: float) -> None:
            if words not in begun:
                begun.append(words)
                stages(words)
            stages.fraction(fraction)

        report = model.sensitivity(
            of or None,
            wrt or None,
            cycles,
            transient=transient,
            parameters=overrides,
            method=method,
            check=not no_check,
            rtol=rtol,
            sensitivity_rtol=sensitivity_rtol,
            progress=progress,
        )
        written: list[Path] = []
        if out is not None:
            stages("draw")
            out.mkdir(parents=True, exist_ok=True)
            place = out / "sensitivity.json"
            place.write_text(json_text(report.to_json()), encoding="utf-8")
            written = [place]
            if can_draw():
                from ballpass.runtime.plot.tornado import draw_tornados

                written += draw_tornados(report, out, formats)
    if json_:
        show_json(report.to_json())
    else:
        from ballpass.runtime.certify.sensitivity_report import render_report

        show_tables(render_report(report, top=ROWS))
        if written:
            charts = [path for path in written if path.name.startswith("tornado_")]
            told = [path.name for path in written if path not in charts]
            told += [f"{len(charts)} chart{'s' if len(charts) > 1 else ''}"] if charts else []
            show(f"results in {out}: {', '.join(told)}")
    if report.disagreements:
        first = report.disagreements[0]
        complain(
            f"{len(report.disagreements)} of {len(report.pairs)} derivatives disagree with their second route, "
            f"{first.check.route}, first d({first.quantity})/d({first.parameter}): {first.derivative:.9g} and "
            f"{'no number' if first.check.value is None else format(first.check.value, '.9g')} {first.unit}. "
            "Do not rely on them; take a tighter --rtol and --sensitivity-rtol, or fewer turns."
        )
        raise typer.Exit(1)
