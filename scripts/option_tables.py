"""Write the tables of options in docs/reference/cli.md from the declarations of the commands.

``python -m scripts.option_tables`` writes them anew; ``tests/test_cli_reference.py`` compares.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import typer.main

from ballpass.runtime.app.cli import app

PAGE = Path(__file__).resolve().parent.parent / "docs" / "reference" / "cli.md"


def with_tables(page: str) -> str:
    """The page with the table of each command that has options, as its help has it."""
    commands: dict[str, Any] = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    for name, command in commands.items():
        options = [item for item in command.params if item.param_type_name == "option"]
        rows = [_row(item) for item in options if item.opts != ["--plugin"]]  # said once, above the tables
        if not rows:
            continue
        table = "\n".join(["| option | meaning |", "| --- | --- |", *rows, ""])
        section = re.compile(
            rf"(## `ballpass {name} (?:(?!\n## ).)*?)\| option \| meaning \|\n(?:\|[^\n]*\n)+", re.DOTALL
        )
        page, count = section.subn(lambda match, table=table: match[1] + table, page)  # type: ignore[misc]
        if count != 1:
            raise SystemExit(f"{PAGE}: no section with a table of options for `ballpass {name}`.")
    return page


def _row(option: Any) -> str:
    value = f" {option.metavar}" if option.metavar else ""
    flags = ", ".join(f"`{flag}{value}`" for flag in (*option.opts, *option.secondary_opts))
    plain = option.required or option.default is None or isinstance(option.default, bool)
    return f"| {flags} | {option.help}{'' if plain else f' Default: `{option.default}`.'} |"


if __name__ == "__main__":
    PAGE.write_text(with_tables(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
