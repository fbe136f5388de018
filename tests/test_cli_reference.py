"""Claims about the page of the command line: it has every command and option, and none that is not there."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer.main
from rich.emoji import Emoji
from scripts.option_tables import with_tables

from ballpass.runtime.app.cli import app

PAGE = Path(__file__).resolve().parent.parent / "docs" / "reference" / "cli.md"
COMMANDS = typer.main.get_command(app).commands  # type: ignore[attr-defined]

OPTION = re.compile(r"--[a-z][a-z-]*")


def sections() -> dict[str, str]:
    """Text of the page's sections by command."""
    _, *parts = re.split(r"^## ", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    named = {match[1]: part for part in parts if (match := re.match(r"`ballpass ([a-z]+)[ `]", part))}
    assert len(named) == sum(part.startswith("`ballpass ") for part in parts)
    return named


def accepted(command: str) -> Iterator[tuple[str, str]]:
    """Ways to write each option, and what it is: an option or what it does anyway."""
    for parameter in COMMANDS[command].params:
        if parameter.param_type_name != "option" or parameter.opts == ["--plugin"]:  # said once, above them
            continue
        on_anyway = bool(parameter.secondary_opts) and parameter.default is True
        yield from ((text, "anyway" if on_anyway else "option") for text in parameter.opts)
        yield from ((text, "option") for text in parameter.secondary_opts)


def test_page_has_a_section_for_every_command_and_for_nothing_else() -> None:
    assert len(COMMANDS) >= 10
    assert sorted(sections()) == sorted(COMMANDS)


def test_tables_of_questions_are_those_of_their_declarations() -> None:
    """Where this fails: python -m scripts.option_tables."""
    page = PAGE.read_text(encoding="utf-8")
    assert page == with_tables(page)


@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_help_is_printed_as_it_is_written(command: str) -> None:
    """No word between colons is taken for a picture, as the B of A:B:N is."""
    assert Emoji.replace("A:B:N") != "A:B:N"
    for parameter in COMMANDS[command].params:
        told = parameter.help
        assert told
        assert Emoji.replace(told) == told


@pytest.mark.parametrize("option", ["--set", "--json", "--cycles", "--duration", "--figures"])
def test_an_option_means_the_same_to_every_command_that_has_it(option: str) -> None:
    found = [p.help for command in COMMANDS.values() for p in command.params if option in p.opts]
    assert len(found) > 1
    assert len(set(found)) == 1


@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_page_names_every_option_of_a_command_and_no_other(command: str) -> None:
    section = sections()[command]
    rows = [line.split("|")[1] for line in section.splitlines() if line.startswith("| `--")]
    told = set(OPTION.findall(" ".join(rows)))
    known = dict(accepted(command))
    assert told <= set(known)
    assert {text for text, kind in known.items() if kind == "option"} <= told
