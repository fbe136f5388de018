"""Every command and every Python block of README and the documentation runs, page by page, and prints what it shows.

The blocks of a page run in its order in a folder with copies of the shipped scenes.  A comment behind an expression
that begins with a number is what the expression gives, to the printed digits; "refused" is a refusal.
"""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import pytest

from ballpass.derive import generate
from ballpass.runtime import BallpassError, load

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    path.relative_to(ROOT).as_posix()
    for path in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
    if "_build" not in path.parts and "adr" not in path.parts
]
#: Commands that are not run here, and why.
NOT_RUN = {
    r"make (demo|test|extremes|bench|docs|lint|trade)\b": "targets of the Makefile, which .ci/run makes",
    r"\. \.venv/bin/activate": "the environment is that of the tests",
    r"\S*pip install": "installs",
    r"(python -m pip|pipx) (install|download)|python -m build|rattler-build": "installs; tests/test_package.py does it",
    r"CC=clang ": "another compiler",
    r"dask (scheduler|worker)": "they do not end",
    r".* --scheduler tcp:": "needs them",
    r"ballpass trade ": "measures for minutes; tests/test_cli_trade.py runs it",
}
BLOCK = re.compile(r"^( *)```(console|python)\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)

Block = tuple[str, str, int]


def blocks(page: str) -> list[Block]:
    """Kind, text and line of the blocks of a page."""
    text = (ROOT / page).read_text(encoding="utf-8")
    return [
        (match[2], re.sub(rf"^{match[1]}", "", match[3], flags=re.MULTILINE), text.count("\n", 0, match.start()) + 1)
        for match in BLOCK.finditer(text)
    ]


def commands(text: str) -> list[tuple[str, list[str]]]:
    """Commands of a console block, each with the lines that it is shown to print."""
    found: list[tuple[str, list[str]]] = []
    dollars = text.startswith("$ ")
    for line in text.replace("\\\n", " ").splitlines():
        if not dollars or line.startswith("$ "):
            found.append((line.removeprefix("$ "), []))
        else:
            found[-1][1].append(line)
    return found


def run_console(text: str, folder: Path) -> None:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    for command, shown in commands(text):
        if any(re.match(pattern, command) for pattern in NOT_RUN):
            continue
        done = subprocess.run(
            ("bash", "-c", command.replace(".venv/bin/", "")),
            cwd=folder, env={**os.environ, "PATH": path}, capture_output=True, text=True, check=False, timeout=600,
        )  # fmt: skip
        assert done.returncode == 0, f"{command}\n{done.stderr[-2000:]}"
        for line in shown:
            assert line in done.stdout, f"{command}\nprints\n{done.stdout[-2000:]}"


def run_python(text: str, names: dict[str, Any]) -> None:
    lines = text.splitlines()
    for statement in ast.parse(text).body:
        source = ast.unparse(statement)
        if not isinstance(statement, ast.Expr):
            exec(source, names)
            continue
        comment = lines[(statement.end_lineno or 1) - 1].partition("  # ")[2]
        if comment.startswith("refused"):
            with pytest.raises(BallpassError):
                eval(source, names)
            continue
        value = eval(source, names)
        printed = re.match(r"-?\d[\d.]*(e-?\d+)?(?= |$)", comment)
        if printed:
            digits = len(printed[0].partition("e")[0].replace(".", "").lstrip("-0"))
            assert f"{value:.{digits}g}" == f"{float(printed[0]):.{digits}g}", f"{source} gives {value}"


@pytest.mark.long
@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page)])
def test_blocks_of_a_page_run(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(ROOT / "scenes", tmp_path / "scenes")
    shutil.copy(ROOT / "scenes" / "punching_press.toml", tmp_path / "my_press.toml")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(plt, "show", lambda: None)
    for scene in ("punching_press", "punching_press_tangent"):
        generate(tmp_path / "scenes" / f"{scene}.toml")
    names: dict[str, Any] = {}
    exec("import numpy as np", names)
    names["model"] = load("generated/punching_press")
    for kind, text, line in blocks(page):
        try:
            if kind == "console":
                run_console(text, tmp_path)
            elif "compiler=" not in text:
                run_python(text, names)
        except Exception as fault:
            fault.add_note(f"{page}, block at line {line}")
            raise
    plt.close("all")


def test_pages_name_the_commands_and_options_that_there_are() -> None:
    # the cheap part of the test above, which runs each time: what is written in command blocks exists
    from typer.main import get_command

    from ballpass.runtime.app.cli import app

    known = get_command(app).commands  # type: ignore[attr-defined]
    for page in PAGES:
        for kind, text, line in blocks(page):
            for command, _ in commands(text) if kind == "console" else ():
                words = re.findall(r"(?:^|/| )ballpass (\w+)(.*)", command.partition(" #")[0])
                for name, rest in words:
                    assert name in known, f"{page}:{line}: {command}"
                    options = {o for item in known[name].params for o in (*item.opts, *item.secondary_opts)}
                    for option in re.findall(r" (--[\w-]+)", rest):
                        assert option in options, f"{page}:{line}: {command} has no {option}"


def test_python_blocks_import_names_that_there_are() -> None:
    for page in PAGES:
        for kind, text, _ in blocks(page):
            if kind == "python":
                for node in ast.walk(ast.parse(text)):
                    if isinstance(node, ast.ImportFrom):
                        exec(ast.unparse(node), {})
