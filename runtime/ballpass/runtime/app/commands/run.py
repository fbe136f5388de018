"""``ballpass run``: simulate a scene; write solution, summary and figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, cast

from ballpass.runtime.app.commands import options
from ballpass.runtime.app.commands.load_scene import read_asked
from ballpass.runtime.app.commands.messages import note, show_files, show_json, show_parts, size_words, warn
from ballpass.runtime.app.commands.shared import Stages, command, figure_formats, load_model, results_folder
from ballpass.runtime.app.repeated import repeated
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.method_registry import CHOICE, OWN, STEPPERS
from ballpass.runtime.contract.options import Cycles, Duration, Option, Rtol, SampleRate, options_in, refuse_unknown
from ballpass.runtime.contract.refused_scenes import refuse_still, refuse_without_bearings
from ballpass.runtime.plot import on_paper
from ballpass.runtime.questions import option_names
from ballpass.runtime.report.digits import uncertainties

if TYPE_CHECKING:
    from ballpass.runtime.app.summary import Turned
    from ballpass.runtime.model import Model
    from ballpass.runtime.report.report import Report, ReportTable, Words
    from ballpass.runtime.request.locating import Kinks
    from ballpass.runtime.request.start import RunEnd
    from ballpass.runtime.solution.settle import Settled
    from ballpass.runtime.solution.solution import Solution

Of = Annotated[
    Sequence[str] | None,
    option_names.quantity(
        "Quantity to report, and to which `--error` applies: `peak_ball_force`, `drive_work`. May be repeated."
    ),
]

Method = Annotated[
    str | None,
    Option(
        words=f"Integrator: `auto`, `{CHOICE}`, {', '.join(f'`{CHOICE}-{name}`' for name in OWN)}, `cvodes`.",
        shown="NAME",
        names=option_names.methods,
    ),
]

AtKinks = Annotated[
    str | None,
    Option(
        words="What the stepper does where a law has a kink or jump: `stepped-over`, left to error control, or "
        "`located`, so that its steps end there. Default: `located` at tight tolerances of `auto` and `stepper`.",
        shown="CHOICE",
        names=option_names.kinks,
    ),
]

#: Entries of the summary about the computation, which differ between tolerances.
OF_RUN = ("rtol", "steps", "located_kinks", "wall_time", "versions", "accuracy")

#: Bytes of samples that are written without a remark.
LARGE = 200_000_000


def relative_error(text: str) -> float:
    """A relative error from a text: 1%, 1 %, 0.01; RequestError for another."""
    from ballpass.runtime.certify.error_target import checked_target

    number, mark = text.strip().removesuffix("%").strip(), text.strip().endswith("%")
    try:
        value = float(number) / (100.0 if mark else 1.0)
    except ValueError:
        raise RequestError(f"{text!r} is not a relative error. Allowed: a number above 0 as 1% or 0.01.") from None
    return checked_target(value)


def run(
    scene: options.SceneOrFolder,
    cycles: Cycles = None,
    turns: Annotated[
        str | None,
        Option(
            words="Peaks and rms of the summary are those of as many turns as they take to settle.",
            shown="settle",
            choices=("settle",),
        ),
    ] = None,
    duration: Duration = None,
    transient: Annotated[
        float | None, Option(words="Turns at the start that summary and figures leave out.", shown="N", least=0.0)
    ] = None,
    sample_rate: SampleRate = None,
    initial: Annotated[
        str | None,
        Option(
            shown="START",
            words="`equilibrium`: the rings start at rest under the load of t = 0; or the solution.nc of another run, "
            "which continues, and its transient counts from that one's start. Default: as in the scene.",
        ),
    ] = None,
    set_: options.Settings = None,
    rtol: Rtol = None,
    method: Method = None,
    kinks: AtKinks = None,
    error: Annotated[
        float | None,
        Option(
            words="Relative error wanted, `1%` or `0.01`, instead of method and tolerance: both are chosen, and the "
            "error of the run is estimated.",
            shown="E",
            reader=relative_error,
        ),
    ] = None,
    of: Of = None,
    all_: Annotated[bool, Option(words="All rows of the summary, with the names of the numbers.")] = False,
    out: options.ResultsFolder = None,
    json_: options.Json = False,
    figures: options.Figures = True,
    format_: options.FigureFormats = None,
    width_: options.FigureWidth = None,
    titles_: options.FigureTitles = True,
) -> None:
    """Simulate a scene; write solution, summary and figures.

    Derives and compiles what is stale in generated/<scene>. Options not given are those of the scene's run table.
    A generated folder may stand in place of the scene. It is a program: load only folders you trust.
    """
    with command(scene) as stages, on_paper(width_, titles=titles_):
        # within: an interrupt while they are imported is one of the command
        from ballpass.runtime.app.results import SOLUTION, SUMMARY
        from ballpass.runtime.app.summary_table import render_accuracy, render_summary
        from ballpass.runtime.app.transient_words import tables_left_out
        from ballpass.runtime.plot import CAPTIONS
        from ballpass.runtime.report.text import show as show_report
        from ballpass.runtime.request.locating import LOCATED, refuse_with_error

        stages("reading the scene")
        refuse_with_error(error, method=method, rtol=rtol, kinks=kinks)
        start = _read_start(initial)
        # the transient of a run that goes on counts from the start of the first
        counted = transient if initial in (None, "equilibrium") else 0.0
        source, overrides = read_asked(scene, set_, cycles, duration, counted)
        for flag in (flag for flag, value in (("--error", error), ("--turns", turns)) if value is not None):
            refuse_still(flag, integrated=source.integrated)
        if initial == "equilibrium":
            refuse_without_bearings("--initial equilibrium", bearings=bool(source.bearings))
        formats = figure_formats(format_, wanted=figures)
        names = (SOLUTION, SUMMARY, CAPTIONS, *(f"*.{kind}" for kind in formats))
        folder = results_folder(out, scene, *names)
        needs = next((flag for flag, given in (("--error", error), ("--of", of), ("--turns", turns)) if given), "")
        model = load_model(
            scene,
            stages,
            method or source.run.method,
            kinks,
            rtol,
            integrated=source.integrated,
            needs=needs and f"ballpass run {needs}",
            inspect=partial(refuse_unknown, options_in({"of": Of}), {"of": of}),
        )
        stages("simulating")
        length: dict[str, Any] = {"cycles": cycles, "duration": duration, "transient": transient}
        given: dict[str, Any] = {"parameters": overrides, "initial": start, "sample_rate": sample_rate}
        first: dict[str, Any] = {"method": method, "rtol": rtol, "kinks": kinks}
        if error is not None:
            first |= {"error": error, "of": of}
        solution = model.simulate(**length, **given, **first, progress=stages.fraction)
        # nobody asked for the turns of a transient that ballpass chose: they are most of such a file
        chosen = not model.manifest.run.stated and not _said(length)
        if solution.nbytes > LARGE and not chosen:
            size = size_words(solution.nbytes)
            note(f"{len(solution)} samples, about {size}; fewer with samples_per_cycle, none with Model.reduce.")
        taken = solution.statistics
        turned: list[Turned] = []  # of the first answer

        def ask(tighter: float | None) -> tuple[dict[str, Any], Report]:
            found, at = solution, taken.kinks
            if tighter is not None:
                at = LOCATED if taken.method in STEPPERS else None
                found = model.simulate(**length, **given, method=taken.method, rtol=tighter, kinks=at)
            return _answer(model, found, length, given, at, of, stages, turned, settle=turns is not None, every=all_)

        def judged(answer: tuple[dict[str, Any], Report]) -> Report:
            of_more = {**answer[0], **answer[0].get("longer", {})}
            every = render_summary(of_more, model.manifest, every=True)[0]
            return replace(answer[1], parts=(*answer[1].parts, every))

        integrated = bool(model.states)
        answers, report = repeated(ask, lambda answer: answer[1], taken.rtol, judged=judged, integrated=integrated)
        summary = answers[0][0]
        numbers = [{**each, **dict.fromkeys(OF_RUN)} for each, _ in answers]
        summary["uncertainty"] = uncertainties(numbers, taken.rtol) or {}
        for words in report.warnings:
            warn(words)
        if chosen:
            for words in tables_left_out(model, model.numbers(overrides).values):
                warn(words)
        stages("writing results")
        kept = solution.steady() if chosen else solution
        summary, files = _write_results(model, solution, summary, folder, stages, formats=formats, stored=kept)
    if json_:
        show_json(summary)
        return
    show_report(report)
    if solution.accuracy is not None:
        show_parts(render_accuracy(model, solution.accuracy))
        show_parts(solution.accuracy.words)
    size = size_words((folder / "solution.nc").stat().st_size)
    show_files(folder, files, f" (solution.nc: {size})")


def _said(length: Mapping[str, float | None]) -> bool:
    """Whether length or transient of a run was asked for."""
    return any(value is not None for value in length.values())


def _answer(
    model: Model,
    solution: Solution,
    length: Mapping[str, Any],
    given: Mapping[str, Any],
    kinks: str | None,
    of: Sequence[str] | None,
    stages: Stages,
    turned: list[Turned],
    *,
    settle: bool,
    every: bool,
) -> tuple[dict[str, Any], Report]:
    """The summary of a run, with what more turns change, and its report.

    Parameters
    ----------
    turned : what is said of more turns, filled by the first of the answers that are compared
    """
    from ballpass.runtime.app.summary import add_turns, summarize
    from ballpass.runtime.app.summary_table import render_quantities, render_summary
    from ballpass.runtime.app.summary_words import stands_out
    from ballpass.runtime.app.transient_words import transient_words
    from ballpass.runtime.ask.peaks import steady_run
    from ballpass.runtime.report.report import Report
    from ballpass.runtime.solution.settle import look_beyond

    taken, said = solution.statistics, list[str]()
    numbers = model.numbers(given["parameters"])
    same: dict[str, Any] = {"method": taken.method, "rtol": taken.rtol, "kinks": cast("Kinks | None", kinks)}
    start: dict[str, Any] = {"parameters": given["parameters"], "initial": given["initial"]}
    longer: Settled | None
    if settle:
        longer = model.settle(**start, **same, transient=length["transient"], progress=stages.fraction)
        said += [] if longer.settled else [longer.words]
    else:
        own = steady_run(model, numbers, solution)
        longer = None if own is None else look_beyond(own, solution.steady_reductions, *(one.turns for one in turned))
        if own is not None and longer is not None:
            said += transient_words(model, own, longer, asked=_said(length))
    summary = summarize(model, solution)
    parts: list[Words | ReportTable] = []
    if of and solution.accuracy is None:
        found = model.quantities(of, **length, **start, **same)
        summary["quantities"] = {name: asdict(one) for name, one in found.items()}
        parts.append(render_quantities(model.manifest, summary["quantities"]))
    if solution.accuracy is not None:
        summary["accuracy"] = asdict(solution.accuracy)
    if longer is not None:
        words, found_turned = add_turns(summary, longer, model.manifest, *turned, instead=settle)
        parts, turned[:] = [*parts, words], [found_turned]
    table, left_out = render_summary(summary, model.manifest, every=every)
    more = [f"{left_out} more rows with --all; every number with its name in summary.json."] if left_out else []
    heads = stands_out(model.manifest, {**solution.parameters, **solution.constants}, summary)
    return summary, Report(title=summary["title"], parts=(*heads, table, *more, *parts), warnings=said)


def _read_start(text: str | None) -> RunEnd | Literal["equilibrium"] | None:
    """Where a run starts, as an option: equilibrium, or a file of a run that continues."""
    if text is None:
        return None
    if text == "equilibrium":
        return "equilibrium"
    from ballpass.runtime.solution.solution_file import load_solution

    return load_solution(text).end


def _write_results(
    model: Model,
    solution: Solution,
    summary: dict[str, Any],
    folder: Path,
    stages: Stages,
    *,
    formats: Sequence[str],
    stored: Solution,
) -> tuple[dict[str, Any], list[str]]:
    """Write solution, summary and figures in the place of those of an earlier run.

    Parameters
    ----------
    formats : of the figures; none are drawn without any
    stored : samples of the file

    Returns
    -------
    The summary, and the names of the files.
    """
    from ballpass.runtime.app.results import SOLUTION, write_results
    from ballpass.runtime.plot import CAPTIONS, FORMATS
    from ballpass.runtime.plot import NAMES as FIGURES

    def write(made: Path) -> dict[str, Any]:
        stored.save(made / SOLUTION)
        if formats:
            from ballpass.runtime.app.figure_run import run_for_figures
            from ballpass.runtime.plot.gallery import draw_all

            stages("drawing figures")
            draw_all(model, solution, made, formats, run_for_figures(model, solution))
        return summary

    endings = ["", *(f"_{bearing.name}" for bearing in model.manifest.bearings if bearing.name)]
    names = [f"{name}{ending}.{kind}" for name in FIGURES for ending in endings for kind in FORMATS]
    return write_results(folder, write, figures=[*names, CAPTIONS])
