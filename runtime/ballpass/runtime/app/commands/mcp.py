"""``ballpass mcp``: the commands as tools of an agent, by the Model Context Protocol over stdin and stdout.

In: the declared options of the commands.  Out: a tool for each command, whose arguments have the names of the options.

A tool runs its command in a process of its own.  The answer is the JSON that ``--json`` prints, or text where a command
has none.  What the command says on stderr is a second text: warnings, or the refusal where the answer is an error.
"""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from inspect import Parameter
from subprocess import DEVNULL
from typing import Any, get_args

from ballpass.runtime.app.commands.command_list import with_plugins
from ballpass.runtime.app.commands.declared import parameters_of
from ballpass.runtime.app.commands.shared import command
from ballpass.runtime.app.commands.skill import RULES
from ballpass.runtime.contract.arguments import brief
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.extras import need
from ballpass.runtime.contract.options import Option, is_of, literals
from ballpass.runtime.contract.parameters import unknown_name
from ballpass.runtime.contract.plugins import used
from ballpass.runtime.contract.version import __version__
from ballpass.runtime.questions.question import summary_of

#: Lines of progress on stderr.
_STAGE = re.compile(r"^ *\d+\.\d s  .*\n", re.MULTILINE)


def mcp() -> None:
    """Serve all commands as tools of an agent, over stdin and stdout (Model Context Protocol)."""
    with command():
        need("mcp")
    import anyio  # of the same extra

    anyio.run(_serve)


def tools() -> dict[str, Callable[..., None]]:
    """Commands by the names of their tools, with questions of plugins."""
    return {name: function for group in with_plugins().values() for name, function in group.items()}


async def _serve() -> None:
    from mcp.server.stdio import stdio_server

    running = server()
    async with stdio_server() as streams:
        await running.run(*streams, running.create_initialization_options())


def server() -> Any:
    """The server, for any transport of the SDK."""
    from mcp import types
    from mcp.server import Server

    known = [
        types.Tool(name=name, description=summary_of(function), input_schema=schema_of(function))
        for name, function in tools().items()
    ]

    async def listed(*_: Any) -> types.ListToolsResult:
        return types.ListToolsResult(tools=known)

    async def called(_: Any, asked: types.CallToolRequestParams) -> types.CallToolResult:
        words, answer, failed = await _answer(asked.name, asked.arguments or {})
        return types.CallToolResult(
            content=[types.TextContent(text=text) for text in words if text],
            structured_content=answer,
            is_error=failed,
        )

    return Server("ballpass", version=__version__, instructions=RULES, on_list_tools=listed, on_call_tool=called)


async def _answer(name: str, given: Mapping[str, Any]) -> tuple[tuple[str, ...], Any, bool]:
    """Texts of an answer, its JSON if it has any, and whether it is an error."""
    import anyio

    try:
        if name not in (known := tools()):
            raise RequestError(unknown_name("tool", name, known))
        words = command_line(name, given)
    except RequestError as fault:
        return (f"error: {fault}",), None, True
    program = [sys.executable, "-c", "from ballpass.runtime.app.entry import main; main()"]
    program += [*(f"--plugin={plugin}" for plugin in used()), *words]
    plain = {**os.environ, "FORCE_COLOR": "", "NO_COLOR": "1", "PYTHONIOENCODING": "utf-8"}
    done = await anyio.run_process(program, stdin=DEVNULL, check=False, env=plain)
    result, said = done.stdout.decode(), _STAGE.sub("", done.stderr.decode())
    answer = json.loads(result) if result.startswith("{") else None
    # the refusal first: it says what to do
    return ((said, result) if done.returncode else (result, said)), answer, done.returncode != 0


def arguments_of(function: Callable[..., None]) -> dict[str, tuple[Any, Option, Any, list[str]]]:
    """Type, option, default and flags of a command's arguments, by the names of their flags; without ``--json``."""
    own, kinds = parameters_of(function)
    found = {}
    for name, (kind, option) in kinds.items():
        flags = [] if option.positional else option.flag(name).split("/")  # the second turns it off
        known = flags[0].removeprefix("--") if flags else name
        if known != "json":  # which a tool always asks for
            found[known] = (kind, option, own[name].default, flags)
    return found


def schema_of(function: Callable[..., None]) -> dict[str, Any]:
    """JSON Schema of a command's arguments."""
    arguments = arguments_of(function)
    return {
        "type": "object",
        "properties": {
            name: _property(kind, option, default) for name, (kind, option, default, _) in arguments.items()
        },
        "required": [name for name, (_, _, default, _) in arguments.items() if default is Parameter.empty],
        "additionalProperties": False,
    }


def _property(kind: Any, option: Option, default: Any) -> dict[str, Any]:
    example = option.example.replace('"', "")  # which a shell takes away
    words = [option.words, example and f"Example: {example}.", option.unit and f"A text with its unit [{option.unit}]."]
    choices = option.choices or literals(kind)
    kinds = {kind, *get_args(kind)}
    if bool in kinds:
        found: dict[str, Any] = {"type": "boolean"}
    elif option.unit or option.reader or not kinds & {int, float}:
        found = {"type": "string"} | ({"enum": list(choices)} if choices else {})
    else:
        found = {"type": "integer" if int in kinds else "number"}
    if is_of(kind, Sequence):
        found = {"type": "array", "items": found}
    if isinstance(default, bool | int | float | str) and default != "":
        found["default"] = default
    return {**found, "description": " ".join(filter(None, words))}


def command_line(name: str, given: Mapping[str, Any]) -> list[str]:
    """Words of the command line that has a tool's arguments.

    Raises
    ------
    RequestError
        An argument that the command does not have, or a value that is no text, number or list of these.
    """
    function = tools()[name]
    known = arguments_of(function)
    words, places, faults = [name], {}, []
    words += ["--json"] if "json_" in parameters_of(function)[1] else []
    for argument, value in given.items():
        if argument not in known:
            faults.append(f"{name}: {unknown_name('argument', argument, known)}")
            continue
        kind, _, _, flags = known[argument]
        values = value if isinstance(value, list) and is_of(kind, Sequence) else [] if value is None else [value]
        wanted = bool if kind is bool else (str, int, float)
        if not all(isinstance(one, wanted) and isinstance(one, bool) is (kind is bool) for one in values):
            allowed = (
                "true or false"
                if kind is bool
                else "a text or a number" + is_of(kind, Sequence) * ", or a list of these"
            )
            faults.append(f"{name}: {argument}: {brief(value)} was given. Allowed: {allowed}.")
        elif kind is bool:
            words += [flag for flag, chosen in zip(flags, (True, False), strict=False) if value is chosen]
        elif flags:
            words += [f"{flags[0]}={one}" for one in values]
        else:
            places[argument] = [str(one) for one in values]
    if faults:
        raise RequestError("\n".join(faults))
    return [*words, "--", *(one for argument in known for one in places.get(argument, ()))]  # in the command's order
