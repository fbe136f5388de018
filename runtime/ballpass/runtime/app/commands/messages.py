"""What commands print: errors, warnings and remarks on stderr, results on stdout."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import typer
from rich.console import Console
from rich.markup import escape

from ballpass.runtime.contract.errors import printable
from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.report.plain import json_text
from ballpass.runtime.report.report import Report, ReportTable, Words
from ballpass.runtime.report.text import WIDTH
from ballpass.runtime.report.text import show as show_report

errors_console = Console(stderr=True, emoji=False)  # A:B:N is not an emoji


def complain(message: str) -> None:
    """Print an error on stderr."""
    _say("[bold red]error[/]", message)


def warn(message: Warning | str) -> None:
    """Print a warning on stderr."""
    _say("[bold yellow]warning[/]", str(message))


def note(message: str) -> None:
    """Print a remark on stderr."""
    _say("[bold]note[/]", message)


def warn_of_scene(manifest: Manifest) -> None:
    """Warn of a scene's unusual numbers, for commands that compute nothing."""
    from ballpass.runtime.contract.plausible_ranges import warn_unusual

    warn_unusual(manifest, {info.name: info.default for info in manifest.parameters})


def _say(kind: str, message: str) -> None:
    """Print on stderr: on a terminal in lines broken between words, elsewhere a sentence is a line."""
    marked = f"{kind}: {escape(printable(message))}"
    errors_console.print(marked, soft_wrap=not errors_console.is_terminal, highlight=False)


def show(text: str) -> None:
    """Print a line of results on stdout."""
    Console(emoji=False).print(printable(text), highlight=False, soft_wrap=True, markup=False)


def show_files(folder: Path, files: Sequence[str], more: str = "") -> None:
    """Print the names of the files that were written, in lines of 80 columns at most where names allow it."""
    words = f"results in {folder}: {', '.join(files)}{more}"
    show(textwrap.fill(words, WIDTH, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False))


def show_json(result: Any) -> None:
    """Print results as one JSON object on stdout."""
    typer.echo(json_text(result), nl=False)


def show_parts(*parts: Words | ReportTable) -> None:
    """Print tables and sentences on stdout."""
    show_report(Report(parts=parts))


def size_words(count: int) -> str:
    """Bytes for people."""
    return f"{count / 1e6:.0f} MB" if count >= 1e6 else f"{math.ceil(count / 1e3)} kB"
