"""Commands from functions whose parameters are options declared in `ballpass.runtime.contract.options`.

In: a function, or a question.  Out: a function as typer takes it, whose options are read with their units and checked
before it is called.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, get_args

import typer

from ballpass.runtime.app.commands import options
from ballpass.runtime.app.commands.asked import read_asked, read_formats, read_value
from ballpass.runtime.app.commands.shared import (
    Stages,
    can_draw,
    check_folder,
    command,
    complain,
    load_model,
    name_of,
    show,
    show_json,
    warn,
)
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.options import Option, faults_of, is_of, option_of, options_of
from ballpass.runtime.questions.question import Question, summary_of
from ballpass.runtime.report.plain import json_text, to_plain
from ballpass.runtime.report.text import show as show_report


def as_command(function: Callable[..., None]) -> Callable[..., None]:
    """The command of a function; typer's own options among its parameters stay as they are."""
    kinds = options_of(function)
    parameters = [
        item.replace(annotation=_typer_type(item.name, kinds[item.name], item.default)) if item.name in kinds else item
        for item in inspect.signature(function, eval_str=True).parameters.values()
    ]

    def call(**given: Any) -> None:
        with command(given.get("scene")):
            values = read_options(function, given)
        function(**{**given, **values})

    return _typed(call, function.__name__, function.__doc__ or "", parameters)


def question_command(question: Question) -> Callable[..., None]:
    """The command of a question: a scene, the question's options, and what becomes of the report."""
    defaults = inspect.signature(question.ask).parameters
    own = [
        _parameter(name, _typer_type(name, kind, defaults[name].default), defaults[name].default)
        for name, kind in options_of(question.ask).items()
    ]
    files: list[inspect.Parameter] = []
    if question.figures is not None:
        files = [_parameter("format_", options.FigureFormats, None)]
        if question.files == "always":
            files += [_parameter("out", options.ResultsFolder, None), _parameter("figures", options.Figures, True)]
        else:
            files += [_parameter("out", options.ReportFolder, None)]
    source = options.SceneFolderOrRun if question.of_run is not None else options.SceneOrFolder
    parameters = [
        _parameter("scene", source, inspect.Parameter.empty),
        *own,
        _parameter("set_", options.Settings, None),
        *files,
        _parameter("json_", options.Json, False),
    ]

    def call(**given: Any) -> None:
        _ask(question, **given)

    return _typed(call, question.name, summary_of(question.ask), parameters)


def read_options(function: Callable[..., Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Values of a function's options from the texts of the command line.

    Raises
    ------
    RequestError
        Texts that are no quantities, values out of their bounds, or both ways to say how long a run is.
    """
    values: dict[str, Any] = {}
    for name, kind in options_of(function).items():
        option, text = option_of(kind), given[name]
        assert option is not None
        if text is None or not option.unit:
            values[name] = (text or None) if is_of(kind, Sequence) else text
        elif is_of(kind, tuple):
            values[name] = _band(option.flag(name), text, option)
        else:
            value = read_value(option.flag(name), text, option.unit)
            # the unit was written out, so that many turns are meant as such
            values[name] = math.fmod(value, math.tau) if option.unit == "rad" else value
    for one, other in (("cycles", "duration"), ("crank_angle", "t")):
        if values.get(one) is not None and values.get(other) is not None:
            flags = " and ".join(_flag(function, name) for name in (one, other))
            raise RequestError(f"{flags} were both given. Allowed: one of them. Leave one away.")
    faults = faults_of(function, values)
    if faults:
        raise RequestError("\n".join(faults))
    return values


def _flag(function: Callable[..., Any], name: str) -> str:
    option = option_of(options_of(function)[name])
    assert option is not None
    return option.flag(name)


def _band(flag: str, text: str, option: Option) -> tuple[float, float]:
    """Two quantities with a colon between, as 2kHz:8kHz."""
    edges = text.split(":")
    if len(edges) != 2:
        raise RequestError(f"{flag}: {text!r} is no band. Allowed: {option.shown}, as {option.example}.")
    digits = [edge.strip().rstrip("kMHz ") for edge in edges]
    low, high = (
        read_value(flag, f"{number} {edge.strip()[len(number) :].strip()}", option.unit)
        for number, edge in zip(digits, edges, strict=True)
    )
    return low, high


def _typer_type(name: str, kind: Any, default: Any) -> Any:
    option = option_of(kind)
    assert option is not None
    plain = get_args(kind)[0]
    if is_of(kind, Sequence):
        plain = list[str] if default is inspect.Parameter.empty else list[str] | None
    elif option.unit:
        plain = str if default is inspect.Parameter.empty else str | None
    info = typer.Option(*(option.flags or (option.flag(name),)), metavar=option.shown, help=option.help(name))
    return Annotated[plain, info]


def _parameter(name: str, annotation: Any, default: Any) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=annotation, default=default)


def _typed(
    call: Callable[..., None], name: str, words: str, parameters: Sequence[inspect.Parameter]
) -> Callable[..., None]:
    """A function with a signature that is found when the program runs."""
    call.__name__, call.__doc__ = name, words
    signature = inspect.Signature([item.replace(kind=inspect.Parameter.KEYWORD_ONLY) for item in parameters])
    call.__signature__ = signature  # type: ignore[attr-defined]
    call.__annotations__ = {item.name: item.annotation for item in parameters}
    return call


def _ask(
    question: Question,
    *,
    scene: Path,
    set_: list[str] | None,
    json_: bool,
    out: Path | None = None,
    figures: bool = True,
    format_: list[str] | None = None,
    **given: Any,
) -> None:
    """Ask, write and print."""
    with command(scene) as stages:
        values = read_options(question.ask, given)
        if question.check is not None:
            question.check(values)
        folder, formats = _place(question, scene, out, format_, figures=figures)
        model, overrides = None, {}
        if question.of_run is not None and scene.suffix == ".nc":
            answer = _answer_of_run(question.of_run, scene, set_, values, stages, question.stage)
        else:
            stages("read")
            asked = read_asked(scene, set_, values.get("duration"), values.get("transient"))
            overrides = asked.overrides
            method = (values.get("method") or asked.run.method) if question.runs else "none"
            model = load_model(scene, stages, method, None, values.get("rtol"), overrides=overrides)
            stages(question.stage)
            if "progress" in inspect.signature(question.ask).parameters:
                values["progress"] = _progress(stages)
            answer = question.ask(model, **values, parameters=overrides)
        report = question.report(answer)
        written: list[Path] = []
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
            if question.files == "where asked":
                written = [folder / f"{question.name}.json"]
                written[0].write_text(json_text(to_plain(report)), encoding="utf-8")
            if formats and question.figures is not None:
                from ballpass.runtime.plot.style import write_figures

                stages("draw")
                drawn = question.figures(model, answer, overrides)
                written += write_figures(drawn, folder, formats, f"{question.name}.md")
        for words in report.warnings:
            warn(words)
    if json_:
        plain = to_plain(report)
        show_json(plain | ({"figure": str(written[0])} if "figure" in plain and written else {}))
    else:
        show_report(report)
        if written:
            show(f"results in {folder}: {', '.join(path.name for path in written)}")
    if report.fault:
        complain(report.fault)
        raise typer.Exit(1)


def _place(
    question: Question, scene: Path, out: Path | None, format_: list[str] | None, *, figures: bool
) -> tuple[Path | None, tuple[str, ...]]:
    """Folder of the files, None where none are written, and formats of the figures."""
    formats = read_formats(format_)
    always = question.files == "always"
    folder = Path("results") / name_of(scene) if out is None and always else out
    if folder is None or not figures or not can_draw():
        formats = ()
    if folder is None or (always and not formats):
        return None, ()
    check_folder(folder)
    return folder, formats


def _answer_of_run(
    ask: Callable[..., Any],
    file: Path,
    set_: list[str] | None,
    values: Mapping[str, Any],
    stages: Stages,
    stage: str,
) -> Any:
    """The answer of a run in a file; options of a simulation are refused."""
    from ballpass.runtime.run.solution_file import load_solution

    kinds = options_of(ask)
    if set_ or any(value is not None for name, value in values.items() if name not in kinds):
        raise RequestError(
            f"{file} holds a run that is done: options of a simulation have no place. Allowed: "
            f"{', '.join(_flag(ask, name) for name in kinds)}."
        )
    stages("read")
    solution = load_solution(file)
    stages(stage)
    return ask(solution, **{name: values[name] for name in kinds})


def _progress(stages: Stages) -> Callable[..., None]:
    """Told a finished fraction, and words in front of it by calls with several stages."""
    begun: list[str] = []

    def tell(*told: Any) -> None:
        *words, fraction = told
        for stage in words:
            if stage not in begun:
                begun.append(stage)
                stages(stage)
        stages.fraction(fraction)

    return tell
