"""``ballpass life``: is the bearing strong enough, how long does it last, and what wears it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ballpass.runtime.app.commands import options
from ballpass.runtime.app.commands.asked import read_asked, read_formats
from ballpass.runtime.app.commands.shared import (
    can_draw,
    check_folder,
    command,
    json_text,
    load_model,
    show,
    show_json,
    warn,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ballpass.runtime.ask.life_records import BearingStrength
    from ballpass.runtime.ask.life_text import LifeReport
    from ballpass.runtime.contract import BearingInfo
    from ballpass.runtime.model import Model

#: Clearances of the figure of life, and steady turns of each.
POINTS, TURNS = 17, 64


def life(
    scene: options.SceneOrFolder,
    set_: options.Settings = None,
    cycles: options.Cycles = None,
    transient: options.Transient = None,
    rtol: options.Tolerance = None,
    method: Annotated[str | None, typer.Option(metavar="NAME", help="auto, or one of the stepper's.")] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for report and figures; none are written if not given.")
    ] = None,
    json_: options.Json = False,
    format_: options.FigureFormats = None,
) -> None:
    """Judge the bearings of a scene: static safety, peak pressure, rating life by three readings, wear.

    With [duty] in the scene one life over all its states, and the damage of each. Without --cycles the run takes as
    many turns as lives and peaks need to settle.
    """
    with command(scene) as stages:
        stages("read")
        formats = read_formats(format_)
        overrides = read_asked(scene, set_, transient=transient).overrides
        if out is not None:
            check_folder(out)
        model = load_model(scene, stages, method or "auto", rtol=rtol, overrides=overrides)
        stages("simulate")
        report = model.life(
            cycles, transient=transient, parameters=overrides, rtol=rtol, method=method, progress=stages.fraction
        )
        written: list[Path] = []
        if out is not None:
            stages("draw")
            out.mkdir(parents=True, exist_ok=True)
            written = [out / "life.json", *(draw_life(model, report, overrides, out, formats) if can_draw() else ())]
            written[0].write_text(json_text(report.to_json()), encoding="utf-8")
        for words in (*report.unsettled, *_swinging(report)):
            warn(words)
    if json_:
        show_json(report.to_json())
        return
    show(str(report))
    if written:
        show(f"results in {out}: {', '.join(path.name for path in written)}")


def _swinging(report: LifeReport) -> list[str]:
    """Why bearings have no life, each once."""
    words = [bearing.why_no_life for state in report.states for bearing in state.bearings if bearing.why_no_life]
    return list(dict.fromkeys(words))


def draw_life(
    model: Model, report: LifeReport, overrides: Mapping[str, float], folder: Path, formats: Sequence[str] = ("png",)
) -> list[Path]:
    """Write figures of every bearing in the first state of the duty cycle in which something turns; their paths."""
    from ballpass.runtime.plot.style import write_figures

    return write_figures(_figures(model, report, overrides), folder, formats, "life.md")


def _figures(model: Model, report: LifeReport, overrides: Mapping[str, float]) -> Iterator[tuple[str, Figure]]:
    from ballpass.runtime.plot import life as figures

    state = next((state for state in report.states if state.bearings), None)
    if state is None:
        return
    title = f"{report.title}, {state.name}" if state.name else report.title
    duty = {info.name: dict(info.parameters) for info in model.manifest.duty}
    numbers = {**overrides, **duty.get(state.name, {})}
    for info, bearing in zip(model.manifest.bearings, state.bearings, strict=True):
        ending = f"_{bearing.name}" if bearing.name else ""
        if bearing.inner.damage:
            yield f"damage{ending}", figures.damage(title, bearing)
            yield f"life_of_clearance{ending}", _clearance(model, info, bearing, numbers, title)
        if state.turns is not None:
            yield f"pressure{ending}", _pressure(model, info, bearing, numbers, title)


def _pressure(
    model: Model, info: BearingInfo, bearing: BearingStrength, overrides: Mapping[str, float], title: str
) -> Figure:
    """The ring with the higher pressure, over a turn behind the transient."""
    import numpy as np

    from ballpass.runtime.ask.wear import load_samples
    from ballpass.runtime.plot import life as figures
    from ballpass.runtime.ratings.of_bearing import contacts_of
    from ballpass.runtime.run.request import Request

    numbers = model.numbers(overrides)
    samples = load_samples(model, numbers, Request(cycles=model.manifest.run.transient_cycles + 1.0))[info.prefix]
    inner, outer = contacts_of(info, numbers.values)
    ring, contact = ("inner", inner) if bearing.inner.peak_pressure > bearing.outer.peak_pressure else ("outer", outer)
    crank = np.unwrap(samples.crank)
    found = contact.peak_pressure(samples.force)
    return figures.pressure(title, bearing, crank, found, ring)


def _clearance(
    model: Model, info: BearingInfo, bearing: BearingStrength, overrides: Mapping[str, float], title: str
) -> Figure:
    """Life over the bearing's group of clearance and half its width on both sides; else up to twice the clearance."""
    import numpy as np

    from ballpass.runtime.plot import life as figures
    from ballpass.runtime.ratings.readings import READINGS

    name = f"{info.path}.clearance"
    present = model.numbers(overrides).values[name]
    taken, group = info.catalogue, None
    least, most = (0.0, 2.0 * present) if present > 0.0 else (present - 10e-6, present + 20e-6)
    if taken is not None and taken.clearance_least is not None and taken.clearance_most is not None:
        group = (taken.clearance_group, taken.clearance_least, taken.clearance_most)
        half = (taken.clearance_most - taken.clearance_least) / 2.0
        least, most = min(present, taken.clearance_least - half), max(present, taken.clearance_most + half)
    clearances = np.linspace(least, most, POINTS)
    table = {**{key: np.full(POINTS, value) for key, value in overrides.items()}, name: clearances}
    transient = model.manifest.run.transient_cycles
    asked = {reading: f"{info.prefix}life_{reading}" for reading in READINGS}
    found = model.simulate_many(table, list(asked.values()), cycles=transient + TURNS)
    if found.interrupted:
        raise KeyboardInterrupt
    lives = {reading: found[observable] for reading, observable in asked.items()}
    return figures.life_of_clearance(title, bearing, clearances, lives, present, group, TURNS)
