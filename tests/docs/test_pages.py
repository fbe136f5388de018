"""Every command and every Python block of README and the documentation runs, page by page, and prints what it shows.

The blocks of a page run in its order in a folder with copies of shipped scenes; a scene that starts with the name of
a file, as a comment, is written there.  Lines under a command are what it prints; where one begins with "error:", what
it says on stderr as it fails.  A comment that begins with a number or a truth value is what the expression before it
gives, to the printed digits; "shape (3,)" is its shape, and "refused" a refusal.  Gallery pages print their numbers
themselves, while the site is built.
"""

from __future__ import annotations

import ast
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tomllib
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
from scripts.sizes import make_environment
from typer.testing import CliRunner

from ballpass.derive import generate
from ballpass.derive.scene.units import looked_up_size
from ballpass.runtime import BallpassError, load
from ballpass.runtime.app.cli import app
from ballpass.runtime.contract.folder import read_manifest
from ballpass.runtime.contract.units import unit_size
from ballpass.runtime.fit.measured import read_trial

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    path.relative_to(ROOT).as_posix()
    for path in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
    if not {"_build", "adr", "auto_gallery", "gallery"} & set(path.parts)
]
#: Commands that are not run here, and why.
NOT_RUN = {
    r"make (demo|test|extremes|bench|docs|lint|trade)\b": "targets of the Makefile, which .ci/run makes",
    r"\. \.venv/bin/activate": "the environment is that of the tests",
    r"\S*pip install": "installs",
    r"(python -m pip|pipx) (install|download)|python -m build|rattler-build": "installs; tests/test_package.py does it",
    r"dask (scheduler|worker)": "they do not end",
    r".* --scheduler tcp:": "needs them",
    r"(\.venv/bin/)?ballpass explore ": "needs ziglang; tests/runtime/test_explore.py runs it",
    r"python -m scripts\.validation\.": "tests/docs/test_validation.py runs it",
    r"ballpass run my_press.toml --plugin ": "a package of the reader's own; tests/test_plugins.py runs it",
    r"ballpass trade ": "measures for minutes; tests/test_cli_trade.py runs it",
    r".* --of life --cycles 6 ": "takes minutes; tests/docs/test_life_table.py holds its numbers",
}
BLOCK = re.compile(r"^( *)```(console|python|toml(?=\n# \w+\.toml\n))\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)
#: Columns of code that a page of 1280 pixels shows beside its contents.
COLUMNS = 90
FENCE = re.compile(r"^ *```([^`\n]*)\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)
#: Beginnings of blocks that are neither run nor read, and why.
NOT_READ = {
    '"6 mm"': "quantities, which a test below reads",
    "bearing.clearance\n": "names, which a test below looks up",
    "        y (up)": "a drawing",
    "quantity,value": "a table of measurements, which a test below reads",
}

#: What a shell does with a command.
SHELL = re.compile(r"[|<>;&$]")

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


def run_command(command: str, folder: Path, installed: dict[str, str] | None = None) -> tuple[int, str, str]:
    """Exit code, stdout and stderr: `ballpass` alone in this process, what needs a shell in one.

    `installed`: environment of an installed ballpass, which runs everything instead.
    """
    words = shlex.split(command.replace(".venv/bin/", ""), comments=True)
    if words[0] == "ballpass" and not SHELL.search(command) and installed is None:
        done = CliRunner().invoke(app, words[1:])
        if done.exception is not None and not isinstance(done.exception, SystemExit):
            raise done.exception
        return done.exit_code, done.stdout, done.stderr
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    called = subprocess.run(
        ("bash", "-c", command.replace(".venv/bin/", "")),
        cwd=folder, env=installed or {**os.environ, "PATH": path},
        capture_output=True, text=True, check=False, timeout=600,
    )  # fmt: skip
    return called.returncode, called.stdout, called.stderr


def run_console(text: str, folder: Path, installed: dict[str, str] | None = None) -> None:
    for command, shown in commands(text):
        if any(re.match(pattern, command) for pattern in NOT_RUN):
            continue
        code, out, err = run_command(command, folder, installed)
        fails = any(line.startswith("error: ") for line in shown)
        assert (code == 2) is fails, f"{command}\n{err[-2000:]}"
        assert fails or code == 0, f"{command}\n{err[-2000:]}"
        printed = err if fails else out
        for line in shown:
            assert line in printed, f"{command}\nprints\n{printed[-2000:]}"


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
        if comment.startswith(("True", "False")):
            assert str(value) == re.match(r"\w+", comment)[0], f"{source} gives {value}"
        if comment.startswith("shape "):
            assert str(np.shape(value)) in comment, f"{source} has the shape {np.shape(value)}"
        if re.match(r"\(\d+,", comment):
            assert str(value) == comment, f"{source} gives {value}"
        printed = re.match(r"-?\d[\d.]*(e-?\d+)?(?= |$)", comment)
        if printed:
            digits = len(printed[0].partition("e")[0].replace(".", "").lstrip("-0"))
            assert f"{value:.{digits}g}" == f"{float(printed[0]):.{digits}g}", f"{source} gives {value}"


@pytest.fixture(scope="module")
def generated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The press and the one with tangent damping, as `ballpass derive` leaves them."""
    folder = tmp_path_factory.mktemp("generated")
    for scene in ("punching_press", "punching_press_tangent"):
        generate(ROOT / "scenes" / f"{scene}.toml", folder / scene)
    return folder


@pytest.mark.long
@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page)])
def test_blocks_of_a_page_run(page: str, generated: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # pages that copy all scenes run as they are printed, anywhere
    if "$ ballpass new --all scenes" not in (ROOT / page).read_text(encoding="utf-8"):
        shutil.copytree(ROOT / "scenes", tmp_path / "scenes")
    shutil.copytree(generated, tmp_path / "generated")
    shutil.copy(ROOT / "scenes" / "punching_press.toml", tmp_path / "my_press.toml")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(plt, "show", lambda: None)
    names: dict[str, Any] = {}
    exec("import numpy as np", names)
    names["model"] = load("generated/punching_press")
    for kind, text, line in blocks(page):
        try:
            if kind == "toml":
                (tmp_path / text.partition("\n")[0].removeprefix("# ")).write_text(text, encoding="utf-8")
            elif kind == "console":
                run_console(text, tmp_path)
            else:
                run_python(text, names)
        except Exception as fault:
            fault.add_note(f"{page}, block at line {line}")
            raise
    plt.close("all")


@pytest.mark.long
def test_first_pages_run_as_they_are_printed_from_wheels(tmp_path: Path) -> None:
    """README, landing page and reader pages, outside the repository: with the wheels, and packages of this environment.

    `tests/test_package.py` installs what the wheels need.
    """
    wheels, programs = tmp_path / "wheels", make_environment(tmp_path / "environment")
    pip = (programs / "python", "-m", "pip", "--quiet", "--disable-pip-version-check")
    subprocess.run((*pip, "wheel", "--no-deps", "-w", wheels, ROOT / "runtime", ROOT), check=True)
    subprocess.run((*pip, "install", "--no-index", "--no-deps", *wheels.glob("*.whl")), check=True)
    (packages,) = programs.parent.glob("lib/python*/site-packages")
    # a path alone: what is installed there for editing is not followed
    (packages / "others.pth").write_text(sysconfig.get_path("purelib"), encoding="utf-8")
    installed = {"HOME": str(tmp_path), "PATH": f"{programs}{os.pathsep}{os.defpath}", "MPLBACKEND": "agg"}
    _, where, _ = run_command("python -c 'import ballpass; print(*ballpass.__path__)'", tmp_path, installed)
    assert where.strip() == str(packages / "ballpass")
    readers = sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "docs/readers").glob("*.md"))
    assert len(readers) == 3
    folder = tmp_path / "mine"
    folder.mkdir()
    # readers' pages make scenes/, which is there where the other two are read; one folder derives each scene once
    for page in (*readers, "README.md", "docs/index.md"):
        for kind, text, line in blocks(page):
            try:
                if kind == "toml":
                    (folder / text.partition("\n")[0].removeprefix("# ")).write_text(text, encoding="utf-8")
                elif kind == "console":
                    run_console(text, folder, installed)
                else:
                    (folder / "block.py").write_text(text, encoding="utf-8")
                    run_console("python block.py", folder, installed)
            except AssertionError as fault:
                fault.add_note(f"{page}, block at line {line}")
                raise


def test_the_index_of_how_to_s_has_a_sentence_for_each() -> None:
    """In its groups and in the contents at the side; pages of numbers are parts of others."""
    text = (ROOT / "docs/howto/index.md").read_text(encoding="utf-8")
    shown, listed = text.split("```{toctree}")
    pages = {path.stem for path in (ROOT / "docs/howto").glob("*.md")} - {"index"}
    pages = {name for name in pages if not name.endswith("_numbers")}
    assert re.findall(r"^- {doc}`(\w+)`: \w.*\.$", shown, re.MULTILINE) == listed.split()[1:-1]
    assert set(listed.split()[1:-1]) == pages


def test_pages_name_the_commands_and_options_that_there_are() -> None:
    # the cheap part of the test above, which runs each time: what is written in command blocks exists
    from typer.main import get_command

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


def test_blocks_are_of_kinds_that_are_run_or_read() -> None:
    for page in PAGES:
        for kind, text in FENCE.findall((ROOT / page).read_text(encoding="utf-8")):
            if kind == "toml":
                tomllib.loads(text)
            elif kind == "json":
                json.loads(text)
            elif kind not in ("console", "python") and not kind.startswith("{"):
                assert any(text.startswith((begin, f"  {begin}")) for begin in NOT_READ), (
                    f"{page}: nobody checks\n{text}"
                )


def test_the_table_of_quantities_of_the_page_on_fits_is_read(tmp_path: Path) -> None:
    page = (ROOT / "docs/howto/fit.md").read_text(encoding="utf-8")
    (table,) = (text for kind, text in FENCE.findall(page) if kind == "text")
    (tmp_path / "lines.csv").write_text("\n".join(line.strip() for line in table.splitlines()), encoding="utf-8")
    manifest = read_manifest(ROOT / "generated/punching_press")
    (given,) = read_trial(manifest, tmp_path / "lines.csv", {}, 1).quantities
    assert given.names == ("amplitude:inner.y@1x", "amplitude:inner.y@bpfo", "peak_ball_force")
    assert (given.values.tolist(), given.sizes.tolist()) == ([1.72e-6, 1.1e-7, 68.0], [2e-8, 1e-8, 2.0])


def test_code_of_pages_fits_its_column() -> None:
    for page in PAGES:
        if page == "README.md":
            continue
        for kind, text, at in blocks(page):
            lines = text.splitlines()
            for before, line in zip(["", *lines], lines, strict=False):
                printed = kind == "console" and text.startswith("$ ") and not (line[:2] == "$ " or before[-1:] == "\\")
                assert printed or len(line) <= COLUMNS, f"{page}:{at}: {line}"


def test_quantities_and_names_of_the_page_on_units_are_read_and_known() -> None:
    page = (ROOT / "docs/howto/units.md").read_text(encoding="utf-8")
    quantities, names = (text for kind, text in FENCE.findall(page) if kind == "text")
    for text in re.findall(r'"(.+?)"', quantities):
        number, _, unit = text.partition(" ")
        assert float(number) * unit_size(unit, looked_up_size).rounded > 0.0
    manifest = read_manifest(ROOT / "generated/punching_press")  # committed, other than what `load` reads
    assert not set(names.split()) - {parameter.name for parameter in manifest.parameters}
