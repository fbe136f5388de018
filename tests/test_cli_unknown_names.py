"""Claims about names that there are not: every command refuses them before it computes, with the words of Python."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NoReturn

import pytest
from typer.main import get_command
from typer.testing import CliRunner

from ballpass.derive import read_scene
from ballpass.derive.emit import folder as emitted
from ballpass.derive.emit import generate as generating
from ballpass.runtime import Model, RequestError
from ballpass.runtime.app.cli import app
from ballpass.runtime.app.commands.animate import animate
from ballpass.runtime.app.commands.run import run
from ballpass.runtime.app.commands.select import select
from ballpass.runtime.app.commands.stream import stream
from ballpass.runtime.app.commands.sweep import sweep
from ballpass.runtime.app.commands.trade import trade
from ballpass.runtime.certify.trade import measure_trade
from ballpass.runtime.contract.options import Option, options_of
from ballpass.runtime.questions import QUESTIONS
from ballpass.runtime.questions.question import declared

SCENE = Path(__file__).resolve().parent.parent / "scenes" / "varying_compliance.toml"
RANGE = "bearing.clearance=1 um:2 um"

#: What each command must have beside the option in question, by parameter.
NEEDED: Mapping[str, Mapping[str, str]] = {
    "bifurcation": {"vary": f"{RANGE}:2"},
    "fit": {"data": "signal.csv", "vary": RANGE},
    "jacobian": {"of": "rhs", "wrt": "states"},
    "morris": {"vary": RANGE, "of": "rms:inner.y"},
    "optimize": {"minimize": "rms:inner.y", "vary": RANGE},
    "sobol": {"vary": RANGE, "of": "rms:inner.y"},
    "spectrum": {"of": "inner.y"},
    "stream": {"sample_rate": "1 kHz", "out": "long.nc"},
    "sweep": {"vary": f"{RANGE}:2"},
}

#: Measured data by the name of their file.
DATA = {
    "signal.csv": "time,inner.y\n0,1\n",
    "max.csv": "quantity,value\nmax:inner.q,1\n",
    "mx.csv": "quantity,value\nmx:inner.y,1\n",
}

#: A name that the scene has not, as an option of this placeholder is written; then what no scene has.
UNKNOWN: Mapping[str | None, tuple[str, ...]] = {
    "Q": ("max:inner.q", "mx:inner.y", "value:inner.y@2x"),
    "DATA": ("max.csv", "mx.csv"),
    '"Q <= VALUE"': ("max:inner.q <= 1 um", "mx:inner.y <= 1 um"),
    "P": ("bearing.clearanc",),
    "PATH=A:B": ("bearing.clearanc=1 um:2 um",),
    "PATH=A:B:N": ("bearing.clearanc=1 um:2 um:2",),
    "PATH=DISTRIBUTION": ("bearing.clearanc=1 um:2 um",),
    "OUTPUT": ("inner.q",),
    "OUTPUT=COLUMN": ("inner.q=a",),
    "STATE": ("inner.q",),
    "NAME": ("left",),
    "CHOICE": ("locate",),
    None: ("inner.q",),
}

#: What names no quantity of any scene begins with.
NOWHERE = ("mx", "value:inner.y@2x")

QUESTIONED = {declared(question).name: question for question in (*QUESTIONS, select, trade)}
COMMANDS: Mapping[str, Callable[..., Any]] = {
    **QUESTIONED,
    **{command.__name__: command for command in (animate, run, stream, sweep)},
}


CASES = [
    pytest.param(command, name, option, text, id=f"{command}-{name}-{text}")
    for command, function in COMMANDS.items()
    for name, (_, option) in options_of(function).items()
    if option.names is not None
    for text in UNKNOWN[option.shown]
]


@pytest.fixture(scope="module")
def model(make_model: Callable[..., Model]) -> Model:
    return make_model("varying_compliance")


@pytest.fixture
def alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A scene that nothing was derived of, in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    for name, text in DATA.items():
        Path(name).write_text(text)
    return Path(shutil.copy(SCENE, tmp_path / "alone.toml"))


@pytest.fixture(scope="module")
def derived() -> tuple[Any, Any]:
    return generating._derive_and_lower(read_scene(SCENE, name="alone"), lambda _: None)


def never(*_: Any, **__: Any) -> NoReturn:
    raise AssertionError("this was to be refused before")


def said(command: str, scene: Path, given: Mapping[str, str]) -> str:
    """The message of a command."""
    words, options = [], {name: option for name, (_, option) in options_of(COMMANDS[command]).items()}
    for name, text in given.items():
        option = options.get(name, Option(words=""))
        words += [text] if option.positional else [option.flag(name), text]
    done = CliRunner().invoke(app, [command, str(scene), *words])
    assert done.exit_code == 2, (done.output, done.exception)
    return " ".join(done.output.partition("error: ")[2].split())


def in_python(model: Model, command: str, given: Mapping[str, str]) -> str | None:
    """The message of the same request; None where it is for the command line alone."""
    named: dict[str, Any] = {{"of": "observables"}.get(name, name): text for name, text in given.items()}
    named.pop("vary", None)
    calls: dict[str, Callable[[], Any]] = {
        "run": lambda: model.quantities(given["of"]) if "of" in given else model.simulate(**given),
        "sweep": lambda: model.simulate_many({"bearing.clearance": [1e-6]}, **{"observables": "rms:inner.y", **named}),
        "stream": lambda: model.stream("long.nc", sample_rate=1e3, outputs=[given["of"]]),
        "select": lambda: model.quantities(given["of"]),
        "trade": lambda: measure_trade(model, [given["of"]]),
    }
    if command == "animate":
        return None
    function = COMMANDS[command]
    with pytest.raises(RequestError) as refused:
        calls.get(command, lambda: getattr(model, function.__name__)(**given))()
    return " ".join(str(refused.value).split())


@pytest.mark.parametrize(("command", "name", "option", "text"), CASES)
def test_a_name_that_there_is_not_is_refused_before_c_is_generated_in_the_words_of_python(
    model: Model,
    alone: Path,
    derived: tuple[Any, Any],
    monkeypatch: pytest.MonkeyPatch,
    command: str,
    name: str,
    option: Option,
    text: str,
) -> None:
    alike_in_every_scene = text.startswith(NOWHERE) or name == "method"
    monkeypatch.setattr(generating, "_derive_and_lower", never if alike_in_every_scene else lambda *_: derived)
    monkeypatch.setattr(emitted, "write_folder", never)
    monkeypatch.setattr("ballpass.runtime.model.compile_model", never)
    given = {**NEEDED.get(command, {}), name: text}
    words = said(command, alone, given)
    expected = in_python(model, command, given)
    assert expected is None or words == expected
    assert not (alone.parent / "generated").exists()


def test_every_option_that_names_something_of_a_model_is_among_these_cases() -> None:
    """But ranges of a sweep, which are compared with the scene as it is read."""
    covered = {(case.values[0], case.values[1]) for case in CASES} | {("sweep", "vary")}
    for command, made in get_command(app).commands.items():  # type: ignore[attr-defined]
        for item in made.params:
            named = item.metavar is not None and item.metavar != "NAME" and item.metavar in UNKNOWN
            assert not named or (command, item.name) in covered


@pytest.mark.parametrize(
    "words", [("run", "--set", "bearing.clearanc=1 um"), ("sweep", "--vary", f"{RANGE[:16]}=1:2:2")]
)
def test_numbers_of_a_scene_are_refused_as_it_is_read(
    alone: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...]
) -> None:
    monkeypatch.setattr(generating, "_derive_and_lower", never)
    done = CliRunner().invoke(app, [words[0], str(alone), *words[1:]])
    assert done.exit_code == 2, (done.output, done.exception)
    assert "bearing.clearance" in done.output


def test_several_wrong_names_have_one_message_for_each_stage(
    model: Model, alone: Path, derived: tuple[Any, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(generating, "_derive_and_lower", lambda *_: derived)
    monkeypatch.setattr(emitted, "write_folder", never)
    for of, count in (("mx:inner.y", 1), ("max:inner.q", 2)):
        given = {"of": of, "wrt": "bearing.clearanc"}
        expected = in_python(model, "sensitivity", given)
        assert expected is not None
        assert said("sensitivity", alone, given) == expected
        assert expected.count("There is no") == count


@pytest.mark.parametrize("text", UNKNOWN["Q"])
def test_a_data_set_refuses_unknown_quantities_before_c_is_generated(
    alone: Path, monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    if text.startswith(NOWHERE):
        monkeypatch.setattr(generating, "_derive_and_lower", never)
    monkeypatch.setattr(emitted, "write_folder", never)
    spec = alone.with_name("set.toml")
    numbers = (
        'seed = 1\nmembers = 2\nsample_rate = "10 kHz"\nduration = "50 ms"\noutputs = ["inner.ax"]\n[classes.one]\n'
    )
    spec.write_text(f'scene = "{alone.name}"\nquantities = ["{text}"]\n{numbers}')
    done = CliRunner().invoke(app, ["dataset", str(spec)])
    assert done.exit_code == 2, (done.output, done.exception)
    expected = {"mx:": "no kind of quantity 'mx'", "max": "'inner.q'", "val": "is expected, not '2x'"}
    assert expected[text[:3]] in " ".join(done.output.split())


def test_a_generated_folder_is_not_compiled_for_an_unknown_name(model: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ballpass.runtime.model.compile_model", never)
    done = CliRunner().invoke(app, ["run", str(model.folder), "--of", "max:inner.q"])
    assert done.exit_code == 2, (done.output, done.exception)
    assert "There is no output 'inner.q'" in done.output


def test_a_command_that_is_called_otherwise_elsewhere_is_named() -> None:
    done = CliRunner().invoke(app, ["simulate", "press.toml"])
    assert done.exit_code == 2
    assert "`ballpass run SCENE`" in done.stderr
