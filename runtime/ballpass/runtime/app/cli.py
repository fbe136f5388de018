"""The list of all commands of ``ballpass``.

Commands import `ballpass.derive` where they need it.  Messages and progress go to stderr, results to stdout.  Exit
codes: 0 done, 1 the computation failed, 2 the request was wrong, 130 interrupted.
"""

from __future__ import annotations

from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from ballpass.runtime.app.commands.command_list import ASK, COMMANDS, with_plugins
from ballpass.runtime.app.commands.declared import Command, Plugins, as_command
from ballpass.runtime.app.commands.mcp import mcp
from ballpass.runtime.app.commands.messages import complain
from ballpass.runtime.app.commands.shared import command
from ballpass.runtime.app.commands.skill import skill
from ballpass.runtime.contract.version import __version__

#: Names that are looked for, and the commands that do it.
MEANT = {"simulate": "run", "solve": "run", "fmu": "export --fmu"}


class Commands(TyperGroup):
    """The commands, and questions of plugins; one that is called otherwise elsewhere is named."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """As typer does it."""
        if args and args[0] in MEANT:
            complain(f"There is no command '{args[0]}'. `ballpass {MEANT[args[0]]} SCENE` does it.")
            raise typer.Exit(2)
        return super().resolve_command(ctx, args)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """One of ballpass, or of a question of a plugin."""
        own = super().get_command(ctx, cmd_name)
        if own is not None or cmd_name in MEANT:
            return own
        with command():
            found = with_plugins()[ASK]
        if cmd_name not in found:
            return None
        extra = typer.Typer(add_completion=False)
        extra.command(cmd_name, cls=Command, rich_help_panel=ASK)(as_command(found[cmd_name]))
        return typer.main.get_command(extra)

    def list_commands(self, ctx: Any) -> list[str]:
        """Those of ballpass, and questions of plugins."""
        with command():
            return list(dict.fromkeys((*super().list_commands(ctx), *with_plugins()[ASK])))


app = typer.Typer(
    cls=Commands,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["--help", "-h"]},
    help="Planar mechanisms and the ball bearings they load: from a scene file to derived equations, generated C, a "
    "simulation and figures. Start with: ballpass new press, then ballpass run punching_press.toml",
    epilog="Results go to stdout, messages and progress to stderr. Exit codes: 0 done, 1 the computation failed, 2 the "
    "request was wrong.",
)


def _print_version(asked: bool) -> None:
    if asked:
        typer.echo(f"ballpass {__version__}")
        raise typer.Exit


@app.callback()
def _common(
    _version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
    _plugin: Plugins = None,
) -> None:
    """Options of `ballpass` itself; the commands have their own."""


for _panel, _commands in {**COMMANDS, "For agents": {"mcp": mcp, "skill": skill}}.items():
    for _command in _commands.values():
        app.command(cls=Command, rich_help_panel=_panel)(as_command(_command))
