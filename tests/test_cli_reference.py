"""Claims about the pages of the command line: they have every command and option, and none that is not there."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from rich.emoji import Emoji
from scripts.option_tables import COMMANDS, FOLDER, with_table

OPTION = re.compile(r"--[a-z][a-z-]*")


def page(command: str) -> str:
    return (FOLDER / f"{command}.md").read_text(encoding="utf-8")


def accepted(command: str) -> Iterator[tuple[str, str]]:
    """Ways to write each option, and what it is: an option or what it does anyway."""
    for parameter in COMMANDS[command].params:
        if parameter.param_type_name != "option" or parameter.opts == ["--plugin"]:  # said once, above them
            continue
        on_anyway = bool(parameter.secondary_opts) and parameter.default is True
        yield from ((text, "anyway" if on_anyway else "option") for text in parameter.opts)
        yield from ((text, "option") for text in parameter.secondary_opts)


def test_every_command_has_a_page_a_row_of_the_index_and_nothing_else_has() -> None:
    assert len(COMMANDS) >= 10
    pages = {path.stem for path in FOLDER.glob("*.md")} - {"index"}
    assert pages == set(COMMANDS)
    assert all(page(command).startswith(f"# `ballpass {command}") for command in pages)
    shown, listed = page("index").split("```{toctree}")
    rows = re.findall(r"^\| \[`ballpass (\w+)`\]\((\w+)\.md\) \| \w", shown, re.MULTILINE)
    assert all(command == path for command, path in rows)
    assert [command for command, _ in rows] == listed.partition("```")[0].split()[1:]
    assert sorted(command for command, _ in rows) == sorted(COMMANDS)


@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_tables_of_options_are_those_of_their_declarations(command: str) -> None:
    """Where this fails: python -m scripts.option_tables."""
    assert page(command) == with_table(command, page(command))


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
    rows = [line.split("|")[1] for line in page(command).splitlines() if line.startswith("| `--")]
    told = set(OPTION.findall(" ".join(rows)))
    known = dict(accepted(command))
    assert told <= set(known)
    assert {text for text, kind in known.items() if kind == "option"} <= told
