"""Write the tables of options in docs/reference/cli/ from the declarations of the commands.

``python -m scripts.option_tables`` writes them anew; ``tests/test_cli_reference.py`` compares.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import typer.main

from ballpass.runtime.app.cli import app

FOLDER = Path(__file__).resolve().parent.parent / "docs" / "reference" / "cli"
COMMANDS: dict[str, Any] = typer.main.get_command(app).commands  # type: ignore[attr-defined]

_TABLE = re.compile(r"\| option \| meaning \|\n(?:\|[^\n]*\n)+")


def with_table(command: str, page: str) -> str:
    """The page of a command with the table of its options, as its help has them."""
    options = [item for item in COMMANDS[command].params if item.param_type_name == "option"]
    rows = [_row(item) for item in options if item.opts != ["--plugin"]]  # the index says it once for all
    table = "\n".join(["| option | meaning |", "| --- | --- |", *rows, ""]) if rows else ""
    page, count = _TABLE.subn(lambda _: table, page)
    if count != bool(rows):
        raise SystemExit(f"{FOLDER / command}.md: {count} tables of options, {int(bool(rows))} wanted.")
    return page


def _row(option: Any) -> str:
    value = f" {option.metavar}" if option.metavar else ""
    flags = ", ".join(f"`{flag}{value}`" for flag in (*option.opts, *option.secondary_opts))
    plain = option.required or option.default is None or isinstance(option.default, bool)
    return f"| {flags} | {option.help}{'' if plain else f' Default: `{option.default}`.'} |"


if __name__ == "__main__":
    for name in COMMANDS:
        path = FOLDER / f"{name}.md"
        path.write_text(with_table(name, path.read_text(encoding="utf-8")), encoding="utf-8")
