"""``ballpass trade``: what accuracy costs on a user's own scene."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table

from ballpass.runtime.app.commands.options import Figures, Json, ResultsFolder, SceneFile, Settings
from ballpass.runtime.app.commands.shared import (
    Stages,
    check_folder,
    faults_of,
    load_model,
    read_asked,
    reported,
    warnings_shown,
)
from ballpass.runtime.contract.errors import RequestError

if TYPE_CHECKING:
    from ballpass.runtime.certify.trade import Trade


def trade(
    scene: SceneFile,
    of: Annotated[
        list[str] | None,
        typer.Option(
            "--of",
            metavar="Q",
            help="Quantity whose error counts: peak_ball_force, rms:inner.y, range:inner.x, mean:, min:. May be "
            "repeated.",
        ),
    ] = None,
    set_: Settings = None,
    members: Annotated[
        int | None, typer.Option(metavar="N", help="Parameter sets around the scene's; 40 if not given.")
    ] = None,
    out: ResultsFolder = None,
    json_: Json = False,
    figures: Figures = True,
) -> None:
    """Measure error against time for methods and tolerances on a scene, with kinks located or not."""
    from ballpass.runtime.certify.trade import MEMBERS, measure_trade
    from ballpass.runtime.certify.trade_report import to_plain, words

    with reported(), warnings_shown(), Stages() as stages, faults_of(scene):
        stages("read")
        asked = read_asked(scene, set_ or [])
        folder = out if out is not None else Path("results") / asked.name
        check_folder(folder)
        model = load_model(scene, stages, "stepper", overrides=asked.overrides)
        stages("measuring")
        count = MEMBERS if members is None else members
        measured = measure_trade(model, of, parameters=asked.overrides, members=count, progress=stages.fraction)
        files = _draw(measured, folder, stages) if figures else []
    if json_:
        typer.echo(json.dumps(to_plain(measured), indent=2, allow_nan=False))
        return
    console = Console()
    console.print(_table(measured))
    for line in words(measured):
        console.print(line, highlight=False, soft_wrap=True)
    if files:
        console.print(f"in {folder}: {', '.join(files)}", highlight=False, soft_wrap=True, markup=False)


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


def _draw(measured: Trade, folder: Path, stages: Stages) -> list[str]:
    from ballpass.runtime.app.figures.canvas import save
    from ballpass.runtime.app.figures.trade import draw_trade

    stages("draw")
    folder.mkdir(parents=True, exist_ok=True)
    names = []
    for quantity in measured.quantities:
        name = f"trade_{re.sub(r'[^a-z0-9]+', '_', quantity)}.png"
        save(draw_trade(measured, quantity), folder / name)
        names.append(name)
    return names


def _table(measured: Trade) -> Table:
    from ballpass.runtime.certify.trade_report import table

    quantity = measured.quantities[0]
    head, rows = table(measured, quantity)
    shown = Table(title=f"{measured.title}: {quantity}, what no other way beats", title_justify="left")
    for name in head:
        shown.add_column(name)
    for row in rows:
        shown.add_row(*row)
    return shown
