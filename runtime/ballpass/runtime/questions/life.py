"""Strength and life of a scene's bearings, and their figures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from ballpass.runtime.contract.options import Cycles, Option, Rtol, Transient
from ballpass.runtime.questions import option_names
from ballpass.runtime.questions.question import AnyModel, Question
from ballpass.runtime.show.progress import Progress, shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from ballpass.runtime.contract.manifest import BearingInfo
    from ballpass.runtime.life.records import BearingStrength, FitSpread, StateStrength
    from ballpass.runtime.life.text import LifeReport
    from ballpass.runtime.many.chunks import MemberFailure
    from ballpass.runtime.point.point_model import PointModel
    from ballpass.runtime.point.run_start import Initial

StepperMethod = Annotated[
    str | None,
    Option(words="`auto`, or one of the stepper's.", shown="NAME", names=option_names.stepper_methods),
]

Reliability = Annotated[
    float | None,
    Option(
        words="Share of the bearings that reach the lives of the report: 90, 95, 96, 97, 98 or 99 %. Default: that of "
        "the scene, 90 %.",
        example='"95 %"',
        shown="SHARE",
        unit="1",
    ),
]

#: Clearances of the figure of life, and steady turns of each.
POINTS, TURNS = 17, 64

#: Columns at most of the pressure over a run, each the highest of some samples.
COLUMNS = 2000


def life_figures(model: AnyModel, report: LifeReport, parameters: Mapping[str, float]) -> Iterator[tuple[str, Figure]]:
    """Figures of every bearing in the first state of the duty cycle in which something turns."""
    from ballpass.runtime.plot import life as figures

    state, numbers = _turning(model, report, parameters)
    if state is None:
        return
    title = f"{report.title}, {state.name}" if state.name else report.title
    for info, bearing in zip(model.manifest.bearings, state.bearings, strict=True):
        ending = f"_{bearing.name}" if bearing.name else ""
        if bearing.inner.damage:
            yield f"damage{ending}", figures.damage(title, bearing)
            yield f"life_of_clearance{ending}", _clearance(model, info, bearing, numbers, title)
        if state.turns is not None:
            yield f"pressure{ending}", _pressure(model, info, bearing, numbers, title)


@Question(figures=life_figures, steady=True, requires="bearings", digits=True)
def life(
    model: PointModel,
    cycles: Cycles = None,
    *,
    transient: Transient = None,
    reliability: Reliability = None,
    parameters: Mapping[str, float] | None = None,
    rtol: Rtol = None,
    method: StepperMethod = None,
    initial: Initial = None,
    progress: Progress = None,
) -> LifeReport:
    """Strength, rating life and wear of every bearing.

    With a duty cycle in the scene one life over all its states, and the damage of each. Without a number of turns the
    run takes as many as lives and peaks need to settle.

    Parameters
    ----------
    parameters : overrides, SI; a state of the duty cycle may override them
    initial, progress : as for `simulate`

    Raises
    ------
    RequestError
        A wrong request, a reliability that is not of the table of ISO 281, a linkage that cannot be assembled, or a
        scene without bearing.
    SimulationError
        The computation failed.

    Examples
    --------
    >>> (bearing,) = model.life(cycles=4, transient=2).bearings
    >>> f"{bearing.static_safety:.1f}, {bearing.life / 1e6:.0f} million turns"
    '0.9, 225 million turns'
    """
    from ballpass.runtime.life.report import life_report
    from ballpass.runtime.point.run_start import start_of
    from ballpass.runtime.ratings.life import of_table
    from ballpass.runtime.request.request import Request

    numbers = model.numbers(parameters)
    request = Request(
        cycles=cycles,
        transient_cycles=transient,
        rtol=rtol,
        method=method,
        initial=start_of(model, numbers, initial),
    )
    with shown("simulating for life", progress) as tell:
        share = of_table(model.manifest.run.reliability if reliability is None else reliability)
        report = life_report(model, dict(parameters or {}), replace(request, progress=tell), share)
    options = {"cycles": cycles, "transient": transient, "rtol": rtol, "method": method}
    return replace(report, fits=tuple(_fits(model, report, parameters or {}, **options)))


def _turning(
    model: AnyModel, report: LifeReport, parameters: Mapping[str, float]
) -> tuple[StateStrength | None, dict[str, float]]:
    """The first state of the duty cycle in which something turns, None without one, and its overrides."""
    state = next((state for state in report.states if state.bearings), None)
    duty = {info.name: dict(info.parameters) for info in model.manifest.duty}
    return state, {**parameters, **(duty.get(state.name, {}) if state is not None else {})}


def _fits(model: AnyModel, report: LifeReport, parameters: Mapping[str, float], **options: Any) -> Iterator[FitSpread]:
    """Life and peak of every bearing with a fit by class, over its clearances."""
    from ballpass.runtime.life.records import FitSpread
    from ballpass.runtime.ratings.of_bearing import fit_clearances

    state, numbers = _turning(model, report, parameters)
    for info, bearing in zip(model.manifest.bearings, state.bearings if state is not None else (), strict=False):
        if info.fit is None or state is None:
            continue
        clearances = np.array(fit_clearances(info, model.numbers(numbers).values))
        names = [f"{info.prefix}peak_ball_force", *([] if bearing.why_no_life else [f"{info.prefix}life"])]
        found, turns, failed = _over_clearances(model, info, numbers, clearances, names, **options)
        yield FitSpread(
            name=info.name,
            state=state.name,
            fit=info.fit,
            clearance=tuple(clearances.tolist()),
            lives=tuple(found[names[1]].tolist()) if len(names) > 1 else (),
            peak_forces=tuple(found[names[0]].tolist()),
            turns=turns,
            failed=tuple(f"{1e6 * clearances[one.member]:.1f} µm of clearance: {one.message}" for one in failed),
        )


def _over_clearances(
    model: AnyModel,
    info: BearingInfo,
    overrides: Mapping[str, float],
    clearances: NDArray[np.float64],
    names: Sequence[str],
    cycles: float | None = None,
    transient: float | None = None,
    **options: Any,
) -> tuple[dict[str, NDArray[np.float64]], float | None, tuple[MemberFailure, ...]]:
    """Quantities over clearances of a bearing, NaN of runs that failed, and the steady turns of each run; None: as long
    as the scene says."""
    from ballpass.runtime.time.repetition import Repetition

    table = {key: np.full(len(clearances), value) for key, value in overrides.items()}
    table[f"{info.path}.clearance"] = clearances
    skipped = model.run_settings.transient_cycles if transient is None else transient
    repetition = Repetition.of(model.manifest, model.numbers(overrides).values)
    if cycles is None and repetition.holds(repetition.driver.after(skipped)):
        cycles = skipped + repetition.whole(TURNS)
    found = model.simulate_many(table, [*names], cycles=cycles, transient=transient, **options)
    if found.interrupted:
        raise KeyboardInterrupt
    turns = None if cycles is None else cycles - skipped
    return {name: np.asarray(found[name]) for name in names}, turns, found.failures


def _pressure(
    model: AnyModel, info: BearingInfo, bearing: BearingStrength, overrides: Mapping[str, float], title: str
) -> Figure:
    """The ring with the higher pressure, over a turn after the transient; an engine's over the turns of its cycle.

    Over the whole run where its turns are unlike each other.
    """
    from ballpass.runtime.life.wear import load_samples
    from ballpass.runtime.plot import life as figures
    from ballpass.runtime.ratings.of_bearing import contacts_of
    from ballpass.runtime.request.request import Request
    from ballpass.runtime.request.resolve import resolve
    from ballpass.runtime.time.repetition import Repetition

    numbers = model.numbers(overrides)
    whole = resolve(model, numbers, Request())
    repetition = Repetition.of(model.manifest, numbers.values)
    turns = repetition.turns if repetition.holds(whole.start) else None
    cycles = None if turns is None else model.run_settings.transient_cycles + turns
    run = resolve(model, numbers, Request(cycles=cycles))
    samples = load_samples(run)[info.prefix]
    inner, outer = contacts_of(info, numbers.values)
    ring, contact = ("inner", inner) if bearing.inner.peak_pressure > bearing.outer.peak_pressure else ("outer", outer)
    found = contact.peak_pressure(samples.force)
    if turns is None:
        begins = np.arange(0, len(found), -(-len(found) // COLUMNS))
        return figures.pressure(title, bearing, samples.time[begins], np.maximum.reduceat(found, begins), ring, None)
    crank = np.unwrap(samples.crank) + 2.0 * np.pi * (model.run_settings.transient_cycles % turns)
    return figures.pressure(title, bearing, crank, found, ring, turns)


def _clearance(
    model: AnyModel, info: BearingInfo, bearing: BearingStrength, overrides: Mapping[str, float], title: str
) -> Figure:
    """Life over the bearing's group of clearance and half its width on both sides; else up to twice the clearance."""
    from ballpass.runtime.plot import life as figures

    present = model.numbers(overrides).values[f"{info.path}.clearance"]
    taken, group = info.catalogue, None
    least, most = (0.0, 2.0 * present) if present > 0.0 else (present - 10e-6, present + 20e-6)
    if taken is not None and taken.clearance_least is not None and taken.clearance_most is not None:
        group = (taken.clearance_group, taken.clearance_least, taken.clearance_most)
        half = (taken.clearance_most - taken.clearance_least) / 2.0
        least, most = min(present, taken.clearance_least - half), max(present, taken.clearance_most + half)
    clearances = np.linspace(least, most, POINTS)
    name = f"{info.prefix}life"
    found, turns, _ = _over_clearances(model, info, overrides, clearances, [name])
    return figures.life_of_clearance(title, bearing, clearances, found[name], present, group, turns)
