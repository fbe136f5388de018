"""``ballpass skill``: a page about all commands and their options for agents that use a shell, as a skill file.

In: the declared options of the commands.  Out: Markdown with a header of name and purpose.
"""

from __future__ import annotations

from collections.abc import Callable
from inspect import Parameter
from pathlib import Path
from typing import Annotated

import typer

from ballpass.runtime.app.commands.command_list import with_plugins
from ballpass.runtime.app.commands.declared import parameters_of
from ballpass.runtime.app.commands.shared import command
from ballpass.runtime.contract.folders import replace_file
from ballpass.runtime.contract.options import Option
from ballpass.runtime.questions.question import summary_of

_HEADER = """---
name: ballpass
description: Forces, motion, vibration and life of planar mechanisms and their ball and roller bearings, from a \
scene file (TOML). Use it for slider-cranks, four-bars, presses, pumps, rotors, bearing clearance, spall \
frequencies, rating life.
---
"""

#: What an agent must know besides the commands; also the instructions of ``ballpass mcp``.
RULES = """\
Begin with `new` for a scene file to edit, or `schema` for all keys of one. `explain` says what a scene models and
leaves out, `run` simulates it; each other command asks one question of it.

- Give quantities as texts with units: `20 um`, `500 rpm`, `0.5 s`. A number of a scene is named by its path, as
  `bearing.clearance`; quantities of a run are written `peak_ball_force`, `rms:inner.y`.
- Answers in JSON are SI. `units` of an object has the unit of a field in it, by its name; any other number has the
  `unit` of the object around it. SI: each value has the SI unit of its state or parameter.
- `null` is a number that is not finite. `uncertainty` has the \u00b1 of numbers, in their shape.
- A refusal says what was given, what is allowed and what to do. Warnings say where the numbers are not to be relied on:
  pass them on.
- Files go to `results/` and `generated/` of the working directory. The first command on a scene derives and
  compiles it.
"""


def skill(
    file: Annotated[
        Path | None, Option(shown="FILE", words="File to write; stdout without one.", positional=True)
    ] = None,
) -> None:
    """Print a page about all commands and options for agents: a skill file."""
    with command():
        if file is None:
            typer.echo(skill_text(), nl=False)
        else:
            replace_file(file, skill_text().encode())


def skill_text() -> str:
    """The page."""
    parts = [_HEADER, "# ballpass\n", RULES, "Exit codes: 0 done, 1 the computation failed, 2 the request was wrong.\n"]
    for group, functions in with_plugins().items():
        parts += [f"## {group}\n", *(_section(name, function) for name, function in functions.items())]
    return "\n".join(parts)


def _section(name: str, function: Callable[..., None]) -> str:
    own, kinds = parameters_of(function)
    places = "".join(f" {option.flag(each)}" for each, (_, option) in kinds.items() if option.positional)
    lines = [f"### `ballpass {name}{places}`\n", f"{summary_of(function)}\n"]
    for each, (_, option) in kinds.items():
        flag = option.flag(each) + ("" if option.positional or option.shown is None else f" {option.shown}")
        default = own[each].default
        more = " Required." if default is Parameter.empty else ""
        if not isinstance(default, bool | Path) and default not in (None, Parameter.empty, ""):
            more = f" Default: `{default}`."
        lines.append(f"- `{flag}`: {option.help(each)}{more}")
    return "\n".join(lines) + "\n"
