"""``ballpass trade``: what accuracy costs on a user's own scene."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer

from ballpass.runtime.app.commands import options
from ballpass.runtime.app.commands.asked import read_asked, read_formats
from ballpass.runtime.app.commands.shared import (
    Stages,
    can_draw,
    command,
    load_model,
    results_folder,
    show,
    show_json,
    show_parts,
)
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.report.report import ReportTable
from ballpass.runtime.report.text import show as show_report

if TYPE_CHECKING:
    from ballpass.derive.reading.recouple import Coupling
    from ballpass.runtime.certify.simplification import Simplification
    from ballpass.runtime.certify.trade_report import Trade
    from ballpass.runtime.model import Model


def trade(
    scene: options.SceneOrFolder,
    of: Annotated[
        list[str] | None,
        typer.Option(
            "--of",
            metavar="Q",
            help="Quantity whose error counts: peak_ball_force, rms:inner.y, range:inner.x, mean:, min:. May be "
            "repeated.",
        ),
    ] = None,
    against: Annotated[
        str | None,
        typer.Option(
            metavar="WHAT",
            help="Measure another model of the machine instead of methods: one-way or two-way, the same scene with "
            "its bearings coupled so, or another scene file.",
        ),
    ] = None,
    set_: options.Settings = None,
    members: Annotated[
        int | None, typer.Option(metavar="N", help="Parameter sets around the scene's; 40 if not given.")
    ] = None,
    out: options.ResultsFolder = None,
    json_: options.Json = False,
    figures: options.Figures = True,
    format_: options.FigureFormats = None,
) -> None:
    """Measure error against time on a scene: of methods and tolerances, or of a simpler model (--against)."""
    from ballpass.runtime.certify.simplification import measure_simplification
    from ballpass.runtime.certify.trade import MEMBERS, measure_trade

    with command(scene) as stages:
        stages("read")
        overrides = read_asked(scene, set_).overrides
        folder = results_folder(out, scene)
        figures, formats = figures and can_draw(), read_formats(format_)
        model = load_model(scene, stages, "stepper", overrides=overrides)
        count = MEMBERS if members is None else members
        if against is not None:
            simpler = _simpler(scene, against, stages)
            stages("measuring")
            compared = measure_simplification(
                model, simpler, of, parameters=overrides, members=count, progress=stages.fraction
            )
            _show_simplification(compared, json_=json_)
            return
        stages("measuring")
        measured = measure_trade(model, of, parameters=overrides, members=count, progress=stages.fraction)
        files = _draw(measured, folder, formats, stages) if figures else []
    if json_:
        show_json(measured.to_json())
        return
    show_report(measured.report())
    if files:
        show(f"in {folder}: {', '.join(files)}")


def _simpler(scene: Path, against: str, stages: Stages) -> Model:
    """Model of a scene's variant, or of another scene file."""
    from ballpass.derive import generate, read_scene
    from ballpass.runtime.model import load

    if against in ("one-way", "two-way"):
        return load(generate(read_scene(scene, coupling=cast("Coupling", against)), progress=stages))
    return load_model(Path(against), stages, "stepper", overrides={})


def _show_simplification(found: Simplification, *, json_: bool) -> None:
    from ballpass.runtime.certify.simplification import rows, to_plain

    if json_:
        show_json(to_plain(found))
        return
    heads, lines = rows(found)
    title = f"{found.title}; other: {found.simpler_title}"
    show_parts(ReportTable(title=title, heads=heads, rows=lines, right=heads[2:]), found.words)


def read_error(text: str | None, of: list[str] | None, method: str | None, rtol: float | None) -> float | None:
    """A relative error as people write it: 1%, 1 %, 0.01.

    Raises
    ------
    RequestError
        It is no such thing, or asked for together with a method or a tolerance.
    """
    if text is None:
        if of:
            raise RequestError("--of names what --error is about, and no --error was given. Add --error 1%.")
        return None
    if method is not None or rtol is not None:
        raise RequestError(
            "--error chooses method and tolerance, and --method or --rtol was given as well. Give one or the other."
        )
    number, mark = text.strip().removesuffix("%").strip(), text.strip().endswith("%")
    try:
        value = float(number) / (100.0 if mark else 1.0)
    except ValueError:
        value = math.nan
    if not 0.0 < value < math.inf:
        raise RequestError(f"--error: {text!r} is no relative error. Allowed: a number above 0 as 1% or 0.01.")
    return value


def _draw(measured: Trade, folder: Path, formats: Sequence[str], stages: Stages) -> list[str]:
    from ballpass.runtime.plot.style import write_figures
    from ballpass.runtime.plot.trade import draw_trade

    stages("draw")
    folder.mkdir(parents=True, exist_ok=True)
    named = (
        (f"trade_{re.sub(r'[^a-z0-9]+', '_', quantity)}", draw_trade(measured, quantity))
        for quantity in measured.quantities
    )
    return [path.name for path in write_figures(named, folder, formats, "trade.md")]
