"""The commands that do something with a scene, by group: for the command line, and for agents."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ballpass.runtime.app.commands.animate import animate
from ballpass.runtime.app.commands.bearings import bearings
from ballpass.runtime.app.commands.dataset import dataset
from ballpass.runtime.app.commands.declared import question_command
from ballpass.runtime.app.commands.derive import derive, equations
from ballpass.runtime.app.commands.explain import explain
from ballpass.runtime.app.commands.explore import explore
from ballpass.runtime.app.commands.export import export
from ballpass.runtime.app.commands.new import new
from ballpass.runtime.app.commands.run import run
from ballpass.runtime.app.commands.schema import schema
from ballpass.runtime.app.commands.select import select
from ballpass.runtime.app.commands.stream import stream
from ballpass.runtime.app.commands.sweep import sweep
from ballpass.runtime.app.commands.trade import trade
from ballpass.runtime.questions import QUESTIONS, added_questions


def _named(*functions: Callable[..., None]) -> dict[str, Callable[..., None]]:
    return {function.__name__: function for function in functions}


_ASKED: tuple[Callable[..., Any], ...] = (*QUESTIONS, select, trade)

#: Group of the questions, also those of plugins.
ASK = "Ask of a scene"

#: By the groups of ``ballpass --help``, in this order; all parameters are options.
COMMANDS = {
    "From scene to equations": _named(new, derive, equations, bearings, explain, schema),
    "Simulate and export": _named(run, export, animate, explore, dataset, stream, sweep),
    ASK: _named(*map(question_command, _ASKED)),
}


def with_plugins() -> dict[str, dict[str, Callable[..., None]]]:
    """The same with the questions of plugins, looked up now."""
    return COMMANDS | {ASK: COMMANDS[ASK] | _named(*map(question_command, added_questions().values()))}
