"""Claims about ``ballpass mcp`` and ``ballpass skill``: all commands, the same answers, units, refusals in words."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import typer.main
from jsonschema import Draft202012Validator

from ballpass.runtime import Model
from ballpass.runtime.app.cli import app
from ballpass.runtime.app.commands.mcp import arguments_of, command_line, schema_of, server, tools
from ballpass.runtime.app.commands.skill import skill_text
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.questions import QUESTIONS
from ballpass.runtime.questions.question import declared
from ballpass.runtime.report.units import UNITS
from machines.quick_cases import long_but

SCENES = Path(__file__).resolve().parent.parent / "scenes"
PRESS, LOOSE, PEAK = "punching_press.toml", "bearing.clearance=10 um:20 um", "peak_ball_force"
COMMANDS = typer.main.get_command(app).commands  # type: ignore[attr-defined]

#: Arguments of each tool whose answer is JSON.
ASKED: dict[str, dict[str, Any]] = {
    "bearings": {"pattern": "6204", "shaft": "k6"},
    "bifurcation": {"vary": [f"{LOOSE}:2"], "readings": 20, "settling": 10},
    "dataset": {"spec": "bearing_faults.toml"},
    "explain": {"set": ["bearing.clearance=15 um"]},
    "fit": {"data": ["measured.csv"], "vary": [LOOSE], "cycles": 4, "starts": 1},
    "jacobian": {"of": ["load.x"], "wrt": ["bearing.clearance"]},
    "life": {"cycles": 4, "set": ["bearing.clearance=15 um"]},
    "linearize": {"at-angle": "240 deg"},
    "morris": {"vary": [LOOSE], "of": [PEAK], "base": 4, "cycles": 3},
    "optimize": {"minimize": PEAK, "vary": [LOOSE], "cycles": 3},
    "run": {"cycles": 3, "figures": False},
    "section": {"readings": 40},
    "select": {"designation": ["6204"], "cycles": 3},
    "sensitivity": {"of": [PEAK], "wrt": ["bearing.clearance"], "cycles": 3},
    "sobol": {"vary": [LOOSE], "of": [PEAK], "samples": 16, "cycles": 3, "limit": [f"{PEAK}<=5 kN"]},
    "spectrum": {"of": "inner.y", "cycles": 20},
    "steady": {},
    "sweep": {"vary": [f"{LOOSE}:3"], "of": [PEAK], "cycles": 3, "figures": False},
    "trade": {"of": [PEAK], "members": 2},
}


@pytest.fixture
def place(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A folder with the press in it, where commands run."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, sys.path)))
    shutil.copy(SCENES / PRESS, tmp_path)
    return tmp_path


def call(name: str, **arguments: Any) -> Any:
    """The answer of a tool, through the SDK's client."""
    pytest.importorskip("mcp", reason="needs the extra mcp")
    import anyio
    from mcp import Client

    async def ask() -> Any:
        async with Client(server()) as client:
            return await client.call_tool(name, arguments)

    return anyio.run(ask)


def numbers(
    plain: Any, path: str = "", unit: str = "", units: dict[str, str] | None = None
) -> Iterator[tuple[str, str]]:
    """Paths of all numbers in an answer with their units, by the rule of the page; those of ± are those of numbers."""
    if isinstance(plain, dict):
        known = {**(units or {}), **(plain.get("units") or {})}
        around = plain.get("unit", unit)
        for name, value in plain.items():
            if name in known:
                yield from ((one, known[name]) for one, _ in numbers(value, f"{path}.{name}"))
            elif name not in ("units", "uncertainty"):
                yield from numbers(value, f"{path}.{name}", around, known)
    elif isinstance(plain, list):
        for value in plain:
            yield from numbers(value, path, unit, units)
    elif isinstance(plain, int | float) and not isinstance(plain, bool):
        yield path.removeprefix("."), unit


def test_every_command_is_a_tool_and_every_tool_with_json_is_asked_here() -> None:
    assert set(tools()) == set(COMMANDS) - {"mcp", "skill"}
    assert {declared(ask).name for ask in QUESTIONS} <= set(ASKED)
    with_json = {name for name, each in COMMANDS.items() if any("--json" in option.opts for option in each.params)}
    assert set(ASKED) == with_json


@pytest.mark.parametrize("name", long_but(sorted(ASKED), "bearings", "life"))
def test_a_tool_gives_the_json_of_its_command_with_the_unit_of_every_number(
    name: str, place: Path, make_model: Callable[..., Model], request: pytest.FixtureRequest
) -> None:
    arguments = dict(ASKED[name])
    if "scene" in schema_of(tools()[name])["properties"]:
        arguments["scene"] = PRESS
    if name == "dataset":
        _small_data_set(place)
    if name == "fit":
        solution = make_model("punching_press").simulate(4)
        rows = zip(solution.t.tolist(), solution["inner.y"].tolist(), strict=True)
        lines = ["time [s],inner.y [m]", *(f"{t!r},{y!r}" for t, y in rows)]
        (place / "measured.csv").write_text("\n".join(lines), encoding="utf-8")
    Draft202012Validator(schema_of(tools()[name])).validate(arguments)
    answer = call(name, **arguments)
    assert not answer.is_error, answer.content[0].text
    found = answer.structured_content
    assert json.loads(answer.content[0].text) == found
    named = dict(numbers(found))
    assert named
    assert [path for path, unit in named.items() if not unit] == []
    # the command's own words, in a process of its own; times of computing differ
    words = [
        sys.executable,
        "-c",
        "from ballpass.runtime.app.entry import main; main()",
        *command_line(name, arguments),
    ]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    if name not in ("trade", "sweep", "run", "dataset"):
        assert json.loads(done.stdout) == found


def _small_data_set(place: Path) -> None:
    text = (SCENES / "data_sets" / "bearing_faults.toml").read_text(encoding="utf-8")
    (place / "bearing_faults.toml").write_text(
        re.sub(r"members = \d+", "members = 1", text).replace("../", ""), encoding="utf-8"
    )
    shutil.copy(SCENES / "rotor.toml", place)


@pytest.mark.parametrize(
    ("name", "arguments", "words"),
    [
        ("life", {"scene": PRESS, "cycles": -1}, ["--cycles", "-1", "Allowed: a number above 0"]),
        ("life", {"scene": PRESS, "set": ["bearing.clearence=5 um"]}, ["bearing.clearence", "bearing.clearance"]),
        ("life", {"scene": "no.toml"}, ["no.toml"]),
        ("life", {}, ["SCENE is missing", "Write:"]),
        ("life", {"scene": PRESS, "cycle": 3}, ["no argument 'cycle'", "Did you mean 'cycles'"]),
        ("run", {"scene": PRESS, "figures": "no"}, ["figures", "'no'", "Allowed: true or false"]),
        ("lives", {"scene": PRESS}, ["no tool 'lives'", "Did you mean 'life'"]),
    ],
)
def test_a_refusal_is_an_error_of_the_tool_in_words(
    name: str, arguments: dict[str, Any], words: list[str], place: Path
) -> None:
    answer = call(name, **arguments)
    assert answer.is_error
    text = answer.content[0].text
    assert text.startswith("error: ")
    assert all(word in text for word in words), text
    assert "Traceback" not in text
    assert not re.search(r"^ *\d+\.\d s ", text, re.MULTILINE)  # no progress in it


def test_warnings_stand_behind_the_answer(place: Path) -> None:
    _, said = call("life", scene=PRESS, cycles=4).content
    assert said.text.startswith("warning: ")


def test_arguments_of_tools_are_the_options_of_the_command_line() -> None:
    for name, function in tools().items():
        schema = schema_of(function)
        Draft202012Validator.check_schema(schema)
        flags = {
            flag.removeprefix("--")
            for option in COMMANDS[name].params
            if option.name != "plugin"
            for flag in (option.opts[:1] if option.param_type_name == "option" else [option.name])
        }
        assert set(schema["properties"]) == flags - {"json"}
        for argument, (_, option, _, _) in arguments_of(function).items():
            described = schema["properties"][argument]["description"]
            assert not option.unit or f"[{option.unit}]" in described


def test_values_reach_the_command_as_they_are_written() -> None:
    given = {"scene": "-odd name.toml", "of": ["rms:inner.y", "-life"], "cycles": 3, "figures": False, "rtol": None}
    words = command_line("run", given)
    assert words == [
        "run",
        "--json",
        "--of=rms:inner.y",
        "--of=-life",
        "--cycles=3",
        "--no-figures",
        "--",
        given["scene"],
    ]
    with pytest.raises(RequestError, match="Allowed: a text or a number"):
        command_line("run", {"scene": {"path": PRESS}})


def test_skill_names_every_command_and_every_option() -> None:
    """By the first of names that mean the same."""
    text = skill_text()
    sections = {part.split(maxsplit=2)[1].rstrip("`"): part for part in text.split("\n### ")[1:]}
    assert set(sections) == set(tools())
    for name, section in sections.items():
        for option in COMMANDS[name].params:
            if option.name == "plugin":  # of the machine's user, for all commands
                continue
            words = (
                [*option.opts[:1], *option.secondary_opts[:1]]
                if option.param_type_name == "option"
                else [option.metavar]
            )
            words = [word.removesuffix("...") for word in words]
            assert all(word in section for word in words)
            assert option.help.removesuffix(" Required.") in section
    assert re.match(r"---\nname: ballpass\ndescription: \S.*\n---\n", text)


def test_names_of_fields_have_one_unit() -> None:
    from ballpass.runtime.report import units

    assert sum(len(names.split()) for names in units._NAMES.values()) == len(UNITS)
