"""Commands from functions whose parameters are options declared in `ballpass.runtime.contract.options`.

In: a function, or a question.  Out: a function as typer takes it, whose options are read with their units and checked
before it is called.
"""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperArgument, TyperCommand

from ballpass.runtime.app.commands import options
from ballpass.runtime.app.commands.load_scene import read_asked, read_value
from ballpass.runtime.app.commands.messages import complain, note, show_files, show_json, warn
from ballpass.runtime.app.commands.shared import Stages, check_folder, command, figure_formats, load_model, name_of
from ballpass.runtime.app.repeated import repeated
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.folders import replace_file
from ballpass.runtime.contract.options import Option, is_of, options_in, options_of, refuse_faults, refuse_unknown
from ballpass.runtime.contract.plugins import use
from ballpass.runtime.contract.version import __version__
from ballpass.runtime.plot import on_paper
from ballpass.runtime.questions.question import Question, declared, summary_of
from ballpass.runtime.report.digits import uncertainties
from ballpass.runtime.report.plain import json_text, to_plain
from ballpass.runtime.report.report import Report
from ballpass.runtime.report.text import show as show_report

#: Parameters of a question that say how long to run.
LENGTH = ("cycles", "duration", "transient")


def _use(names: list[str] | None) -> None:
    """Import plugins before anything else is read."""
    with command():
        use(names or ())


#: Modules with laws, quantities and more, before or after the name of a command.
Plugins = Annotated[
    list[str] | None,
    typer.Option(
        "--plugin",
        metavar="MODULE",
        callback=_use,
        is_eager=True,
        help="Module, or file of one, with laws, quantities, questions or methods of your own; may be repeated.",
    ),
]


class Command(TyperCommand):
    """A command that asks for what is missing as for everything else: what, what is allowed, what to write."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        try:
            return super().parse_args(ctx, args)
        except typer.BadParameter as fault:
            missing = fault.param
            # what is missing has no message yet
            if not isinstance(missing, TyperArgument) or fault.message:
                raise
            name = missing.metavar
            words = missing.help or ""
            wanted = " ".join(str(each.metavar) for each in self.params if isinstance(each, TyperArgument))
            complain(
                f"{self.name}: {name} is missing. It takes: {words[:1].lower()}{words[1:]} "
                f"Write: ballpass {self.name} {wanted}, then options; --help lists them."
            )
            raise typer.Exit(2) from None


def parameters_of(
    function: Callable[..., None],
) -> tuple[Mapping[str, inspect.Parameter], dict[str, tuple[Any, Option]]]:
    """The parameters of a command, and the type and the option of each."""
    own = inspect.signature(function, eval_str=True).parameters
    return own, options_in({name: item.annotation for name, item in own.items()})


def as_command(function: Callable[..., None]) -> Callable[..., None]:
    """The command of a function whose parameters are options."""
    own, kinds = parameters_of(function)
    required = [name for name in kinds if own[name].default is inspect.Parameter.empty]

    def call(plugin: object = None, **given: Any) -> None:
        with command(given.get("scene")):
            _refuse_missing({name: kinds[name][1] for name in required if not given[name]})
            values = _read(kinds, given)
        function(**{**given, **values})

    parameters = [_typer_option(item, *kinds[name]) for name, item in own.items()]
    parameters.append(_parameter("plugin", Plugins, None))
    return _with_signature(call, function.__name__, function.__doc__ or "", parameters)


def question_command(ask: Callable[..., Any]) -> Callable[..., None]:
    """The function of a question's command: a scene, the question's options, and the options of the report."""
    question, kinds = declared(ask), options_of(ask)
    own = inspect.signature(ask).parameters
    parameters = [
        _parameter("scene", options.SceneFolderOrRun if question.takes_runs else options.SceneOrFolder),
        *(own[name].replace(annotation=Annotated[kind]) for name, kind in kinds.items()),
        _parameter("set_", options.Settings, None),
        _parameter("json_", options.Json, False),
    ]
    if question.figures is not None:
        parameters.append(_parameter("out", options.ResultsFolder if question.always else options.ReportFolder, None))
        parameters.append(_parameter("format_", options.FigureFormats, None))
        parameters.append(_parameter("width_", options.FigureWidth, None))
        parameters.append(_parameter("titles_", options.FigureTitles, True))
    if question.always:
        parameters.append(_parameter("figures", options.Figures, True))

    def call(**given: Any) -> None:
        values = {name: given.pop(name) for name in kinds}
        _ask(ask, question, values, **given)

    return _with_signature(call, question.name, summary_of(ask), parameters)


def _refuse_missing(missing: Mapping[str, Option]) -> None:
    """RequestError with the words of the options that were not given: those that say what to write."""
    if missing:
        helps = {option.flag(name): option.help(name) for name, option in missing.items()}
        raise RequestError(
            "\n".join(f"{flag} is missing. It takes: {words[:1].lower()}{words[1:]}" for flag, words in helps.items())
        )


def _read(kinds: Mapping[str, tuple[Any, Option]], given: Mapping[str, Any]) -> dict[str, Any]:
    """Values of options from the texts of the command line.

    Raises
    ------
    RequestError
        Texts that are no quantities, values out of their bounds, or two ways to say one thing.
    """
    values: dict[str, Any] = {}
    for name, (kind, option) in kinds.items():
        text, flag = given[name], option.flag(name)
        if text is not None and option.reader is not None:
            try:
                values[name] = option.reader(text)
            except RequestError as fault:
                raise RequestError(f"{flag}: {fault}") from None
        elif text is None or not option.unit:
            values[name] = (text or None) if is_of(kind, Sequence) else text
        elif is_of(kind, tuple):
            values[name] = _band(flag, text, option)
        else:
            value = read_value(flag, text, option.unit)
            values[name] = _within_two_turns(value) if option.unit == "rad" else value
    for pair in (("cycles", "duration"), ("turns", "cycles"), ("turns", "duration"), ("crank_angle", "t")):
        if all(values.get(name) is not None for name in pair):
            both = " and ".join(kinds[name][1].flag(name) for name in pair)
            raise RequestError(f"{both} were both given. Allowed: one of them. Omit one.")
    flags = {option.flag(name): (kind, option) for name, (kind, option) in kinds.items()}
    refuse_faults(flags, {option.flag(name): values[name] for name, (_, option) in kinds.items()})
    refuse_unknown(kinds, values)
    return values


def _band(flag: str, text: str, option: Option) -> tuple[float, float]:
    """Two quantities with a colon between, as 2kHz:8kHz."""
    edges = text.split(":")
    if len(edges) != 2:
        raise RequestError(f"{flag}: {text!r} is no band. Allowed: {option.shown}, as {option.example}.")
    low, high = (read_value(flag, edge.strip(), option.unit) for edge in edges)
    return low, high


def _typer_option(parameter: inspect.Parameter, kind: Any, option: Option) -> inspect.Parameter:
    """The parameter as typer takes it: quantities are texts, and repeated options are lists."""
    required = parameter.default is inspect.Parameter.empty
    if is_of(kind, Sequence):
        kind = list[str] if required else list[str] | None
    elif option.unit or option.reader:
        kind = str if required else str | None
    if option.positional:
        argument = typer.Argument(
            metavar=option.shown, help=option.words, show_default=False, autocompletion=option.complete
        )
        return parameter.replace(annotation=Annotated[kind, argument])
    flags = option.flags or (option.flag(parameter.name),)
    words = option.help(parameter.name)
    if required:  # asked for by `_refuse_missing`, which says what to write
        kind, parameter, words = kind | None, parameter.replace(default=None), f"{words} Required."
    info = typer.Option(*flags, metavar=option.shown, help=words)
    return parameter.replace(annotation=Annotated[kind, info])


def _parameter(name: str, annotation: Any, default: Any = inspect.Parameter.empty) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=annotation, default=default)


def _with_signature(
    call: Callable[..., None], name: str, words: str, parameters: Sequence[inspect.Parameter]
) -> Callable[..., None]:
    call.__name__, call.__doc__ = name, words
    keywords = [item.replace(kind=inspect.Parameter.KEYWORD_ONLY) for item in parameters]
    call.__signature__ = inspect.Signature(keywords)  # type: ignore[attr-defined]
    call.__annotations__ = {item.name: item.annotation for item in parameters}
    return call


def _ask(
    ask: Callable[..., Any],
    question: Question,
    values: dict[str, Any],
    *,
    scene: Path,
    set_: list[str] | None,
    json_: bool,
    out: Path | None = None,
    figures: bool = True,
    format_: list[str] | None = None,
    width_: float | None = None,
    titles_: bool = True,
) -> None:
    """Run the question, write and print."""
    with command(scene) as stages, on_paper(width_, titles=titles_):
        question.refuse(values)
        folder, formats = _place(question, scene, out, format_, figures=figures)
        stages("reading the scene")
        model, overrides = _source(ask, scene, set_, values, stages)
        stages(question.stage)
        if "progress" in ask.__annotations__:
            values["progress"] = _progress(stages)
        if "scene" in ask.__annotations__:
            values["scene"] = scene
        asked = _request(ask, model, values, overrides)
        if "keep" in ask.__annotations__ and folder is not None:
            values["keep"] = folder / f"{question.name}.parts"
        answer, report, apart = _answered(ask, question, model, values, overrides)
        plain = to_plain(report) | ({} if apart is None else {"uncertainty": apart}) | {"request": asked}
        written: list[Path] = []
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
            if not question.always:
                written = [folder / f"{question.name}.json"]
                replace_file(written[0], json_text(plain).encode())
            for name, content in (question.files(answer) if question.files else {}).items():
                written.append(folder / name)
                replace_file(written[-1], content)
            if formats and question.figures is not None:
                from ballpass.runtime.plot.style import write_figures

                stages("drawing figures")
                drawn = question.figures(model, answer, overrides)
                written += write_figures(drawn, folder, formats, f"{question.name}.md")
        for words in (*report.warnings, *_transient(question, model, values, overrides, answer)):
            warn(words)
    if json_:
        show_json(plain | ({"figure": str(written[0])} if "figure" in plain and written else {}))
    else:
        show_report(report)
        if question.figures is not None and not question.always and out is None:
            note("figures and the report as JSON: --out DIR writes them.")
        if folder is not None and written:
            show_files(folder, [path.name for path in written])
    if report.fault:
        complain(report.fault)
        raise typer.Exit(1)


def _answered(
    ask: Callable[..., Any], question: Question, model: Any, values: Mapping[str, Any], overrides: Mapping[str, float]
) -> tuple[Any, Report, Any]:
    """The answer, its report with the digits that hold, and the uncertainty of its numbers as plain data."""
    from ballpass.runtime.native.loaded_model import LoadedModel

    def at(rtol: float | None) -> Any:
        return ask(model, **{**values, **({} if rtol is None else {"rtol": rtol})}, parameters=overrides)

    runs = question.digits and isinstance(model, LoadedModel) and model.manifest.integrated
    if not runs or values.get("recording") is not None:
        answer = at(None)
        return answer, answer.report(), None
    given = values.get("rtol")
    rtol = model.run_settings.rtol if given is None else given
    answers, report = repeated(at, lambda answer: answer.report(), rtol)
    return answers[0], report, uncertainties([to_plain(answer.report()) for answer in answers], rtol)


def _request(
    ask: Callable[..., Any], model: Any, values: Mapping[str, Any], overrides: Mapping[str, float]
) -> dict[str, Any]:
    """What repeats an answer: command, scene, version, options and overrides, SI."""
    given = {name: value for name, value in values.items() if value is not None and not callable(value)}
    return {
        "command": declared(ask).name,
        "scene": model.manifest.scene,
        "source": model.manifest.source,
        "signature": model.manifest.signature,
        "version": __version__,
        "options": json.loads(json.dumps(given, default=str)),
        "parameters": dict(overrides),
        "units": {info.name: info.unit for info in model.manifest.parameters if info.name in overrides}
        | {name: option.unit or "1" for name, (_, option) in options_of(ask).items() if name in given},
    }


def _transient(
    question: Question, model: Any, values: Mapping[str, Any], overrides: Mapping[str, float], answer: Any
) -> list[str]:
    """Warnings that the numbers of an answer are not those of the steady machine."""
    if not question.steady:
        return []
    from ballpass.runtime.app.transient_words import warnings_of_transient

    found = {} if question.steady is True else question.steady(answer)
    length = {name: values.get(name) for name in LENGTH}
    return warnings_of_transient(model, {**overrides, **found}, **length)


def _place(
    question: Question, scene: Path, out: Path | None, format_: list[str] | None, *, figures: bool
) -> tuple[Path | None, tuple[str, ...]]:
    """Folder of the files, None where none are written, and formats of the figures."""
    folder = Path("results") / name_of(scene) if out is None and question.always else out
    formats = figure_formats(format_, wanted=figures and folder is not None)
    if folder is None or (question.always and not formats):
        return None, ()
    kinds = (*formats, *(("nc", "csv") if question.files else ()))
    check_folder(folder, f"{question.name}.json", f"{question.name}.md", *(f"*.{kind}" for kind in kinds))
    return folder, formats


def _source(
    ask: Callable[..., Any], scene: Path, set_: list[str] | None, values: Mapping[str, Any], stages: Stages
) -> tuple[Any, dict[str, float]]:
    """The scene's model or the run in a file, and numbers of ``--set``."""
    question = declared(ask)
    if question.takes_runs and scene.suffix == ".nc":
        from ballpass.runtime.solution.solution_file import load_solution

        if set_:
            raise RequestError(f"--set: {scene} holds a finished run. Allowed: a scene. Omit --set.")
        return load_solution(scene), {}
    source, overrides = read_asked(scene, set_, *(values.get(name) for name in LENGTH if LENGTH[0] in values))
    question.refuse_scene(integrated=source.integrated, bearings=bool(source.bearings))
    method = (values.get("method") or source.run.method) if question.runs else ""
    needs = "" if question.samples or not question.runs else f"ballpass {question.name}"
    model = load_model(
        scene,
        stages,
        method,
        None,
        values.get("rtol"),
        integrated=source.integrated,
        needs=needs,
        inspect=partial(refuse_unknown, options_of(ask), values),
    )
    return model, overrides


def _progress(stages: Stages) -> Callable[..., None]:
    """Called with the finished fraction, after words by calls with several stages."""
    begun: list[str] = []

    def tell(*report: Any) -> None:
        *words, fraction = report
        for stage in words:
            if stage not in begun:
                begun.append(stage)
                stages(stage)
        stages.fraction(fraction)

    return tell


def _within_two_turns(angle: float) -> float:
    """An angle whose unit was written, so that a number of many turns is meant [rad]."""
    from ballpass.runtime.time.turning import TURN, past

    return angle if abs(angle) <= 2.0 * TURN else float(past(angle, turns=2))
