"""``ballpass schema``: a JSON Schema of scene files, for editors."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from ballpass.runtime.app.commands.shared import command
from ballpass.runtime.contract.options import Option


def schema(
    file: Annotated[
        Path | None, Option(shown="FILE", words="File to write; stdout without one.", positional=True)
    ] = None,
) -> None:
    """Print a JSON Schema of scene files, by which editors complete and check them."""
    with command():
        from ballpass.derive.reading.json_schema import json_schema

        text = json.dumps(json_schema(), indent=1, ensure_ascii=False)
        if file is None:
            typer.echo(text)
            return
        file.write_text(f"{text}\n", encoding="utf-8")
