"""``ballpass schema``: a JSON Schema of scene files, for editors."""

from __future__ import annotations

import json

import typer

from ballpass.runtime.app.commands.shared import command


def schema() -> None:
    """Print a JSON Schema of scene files, by which editors complete and check them."""
    with command():
        from ballpass.derive.reading.json_schema import json_schema

        typer.echo(json.dumps(json_schema(), indent=1, ensure_ascii=False))
