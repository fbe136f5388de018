"""Claims about ``ballpass new``, generated folders in place of scenes, completion and the groups of ``--help``."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from ballpass.derive import read_scene
from ballpass.runtime import Model, load_solution
from ballpass.runtime.app.cli import ASK, DESCRIBE, SIMULATE, app

ROOT = Path(__file__).resolve().parent.parent
SHORT = ("--cycles", "2", "--transient", "1", "--no-figures")

#: The command line in a process without these packages.
WITHOUT = """
import sys

class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.startswith(tuple(missing)):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

missing = sys.argv.pop(1).split(",")
find_spec = __import__("importlib.util").util.find_spec
__import__("importlib.util").util.find_spec = lambda name: None if name in missing else find_spec(name)
sys.meta_path.insert(0, Missing())
from ballpass.runtime.app.entry import main
main()
"""


def call(*words: str | Path) -> Result:
    return CliRunner().invoke(app, list(map(str, words)))


def call_without(missing: str, folder: Path, *words: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        (sys.executable, "-c", WITHOUT, missing, *map(str, words)),
        cwd=folder, capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip


def test_new_copies_each_shipped_scene_byte_for_byte_and_no_file_twice(tmp_path: Path) -> None:
    names = [line.split()[0] for line in call("new", "--list").stdout.splitlines()]
    assert {"press", "four-bar", "rotor", "toggle"} <= set(names)
    for name in names:
        assert call("new", name, tmp_path / "a b").exit_code == 0
    copies = sorted((tmp_path / "a b").iterdir())
    assert [copy.name for copy in copies] == sorted(path.name for path in (ROOT / "scenes").glob("*.toml"))
    assert all(copy.read_bytes() == (ROOT / "scenes" / copy.name).read_bytes() for copy in copies)
    mine = copies[0]
    mine.write_text("mine", encoding="utf-8")
    for name in names:
        refused = call("new", name, tmp_path / "a b")
        assert (refused.exit_code, "left as it is" in refused.stderr) == (2, True)
    assert mine.read_text(encoding="utf-8") == "mine"


def test_new_prints_the_command_that_runs_the_copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    done = call("new", "rotor", "my rotor")
    path, following = done.stdout.splitlines()
    assert read_scene(path).name == "rotor"
    assert following == "Next: ballpass run 'my rotor/rotor.toml'"
    assert call("new", "punching_press").exit_code == 0  # the file's name, to here
    assert Path("punching_press.toml").is_file()
    unknown = call("new", "rotr")
    assert unknown.exit_code == 2
    assert "rotor" in unknown.stderr
    assert call("new").exit_code == 2


def test_a_generated_folder_runs_where_derive_sympy_pint_and_figures_are_missing(
    make_model: Callable[..., Model], tmp_path: Path
) -> None:
    model = make_model("rotor")
    missing = "ballpass.derive,sympy,pint,matplotlib,scipy,xarray,pandas"
    asked = ("--set", "bearing.clearance=12 um", "--sample-rate", "10 kHz")
    done = call_without(missing, tmp_path, "run", model.folder, *SHORT[:4], *asked, "--json", "--out", "here")
    assert done.returncode == 0, done.stderr
    assert "matplotlib, which is not installed: pip install 'ballpass-runtime[figures]'" in done.stderr
    assert json.loads(done.stdout)["status"] == "done"
    there = load_solution(tmp_path / "here" / "solution.nc")
    here = model.simulate(cycles=2.0, transient=1.0, sample_rate=1e4, parameters={"bearing.clearance": 12e-6})
    assert np.array_equal(there.x, here.x)
    assert {path.name for path in (tmp_path / "here").glob("[!.]*")} == {"solution.nc", "summary.json"}
    for words in (("run", ROOT / "scenes" / "rotor.toml"), ("equations", "x.toml")):
        refused = call_without(missing, tmp_path, *words)
        assert refused.returncode == 2, refused.stderr
        assert "pip install ballpass" in refused.stderr


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("bearing.clearence=12 um", "bearing.clearance"),  # the nearest name
        ("bearing.clearance=12 kg", "a length"),
        ("bearing.mass=1", "bearing"),
        ("run.cycles=3", "--cycles"),
        ("bearing.inner_ring.mass=-1 kg", "bearing.inner_ring.mass"),
    ],
)
def test_wrong_numbers_of_a_generated_folder_are_refused_with_the_remedy(
    setting: str, said: str, make_model: Callable[..., Model]
) -> None:
    done = call("run", make_model("rotor").folder, "--set", setting, *SHORT)
    assert done.exit_code == 2
    assert said in done.stderr


def test_a_command_that_reads_the_scene_refuses_a_folder(make_model: Callable[..., Model]) -> None:
    done = call("explain", make_model("rotor").folder)
    assert done.exit_code == 2
    assert "scene file" in done.stderr


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_offers_the_commands(shell: str) -> None:
    words = {"bash": {"COMP_WORDS": "ballpass sen", "COMP_CWORD": "1"}}
    told = words.get(shell, {"_TYPER_COMPLETE_ARGS": "ballpass sen", "_TYPER_COMPLETE_FISH_ACTION": "get-args"})
    done = subprocess.run(
        (Path(sys.executable).parent / "ballpass",),
        env={**os.environ, **told, "_BALLPASS_COMPLETE": f"complete_{shell}"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert "sensitivity" in done.stdout
    assert "spectrum" not in done.stdout


def test_help_groups_all_commands_in_80_columns() -> None:
    done = CliRunner().invoke(app, ["-h"], env={"COLUMNS": "80", "TERMINAL_WIDTH": "80"})
    lines = done.stdout.splitlines()
    assert max(map(len, lines)) <= 80
    heads = [line.strip("╭─╮ ") for line in lines if line.startswith("╭")]
    assert heads == ["Options", DESCRIBE, SIMULATE, ASK]  # none is left over in "Commands"
