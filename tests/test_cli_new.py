"""Claims about ``ballpass new``, generated folders in place of scenes, completion and the groups of ``--help``."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from ballpass.derive import generate, read_scene
from ballpass.runtime import RequestError, load_solution
from ballpass.runtime.app.cli import app
from ballpass.runtime.app.commands.command_list import COMMANDS
from ballpass.runtime.app.commands.data_set_spec import read_spec
from ballpass.runtime.contract.extras import need

ROOT = Path(__file__).resolve().parent.parent

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
"""

#: Then: the command line, or every command with a scene that cannot be read there.
MAIN = "from ballpass.runtime.app.entry import main; main()"
EACH = """
from typer.main import get_command
from typer.testing import CliRunner
from ballpass.runtime.app.cli import app
needed = {"of": "q", "out": "o", "sample_rate": "1 kHz", "vary": "a=1:2:3", "wrt": "p", "minimize": "q"}
for name, command in get_command(app).commands.items():
    asked = [p for p in command.params if p.required or (getattr(p, "help", None) or "").endswith("Required.")]
    options = [w for p in asked if p.name in needed for w in (p.opts[0], needed[p.name])]
    options += [] if name == "bearings" else ["rotor.toml" if name != "new" else "rotor"]
    if name in ("export", "sweep"):
        options += {"export": ["--c"], "sweep": ["--vary", "a=1:2:3"]}[name]
    done = CliRunner().invoke(app, [name, *options])
    print(name, done.exit_code, "pip install ballpass" in done.stderr)
"""


def call(*words: str | Path) -> Result:
    return CliRunner().invoke(app, list(map(str, words)))


def call_without(missing: str, folder: Path, *words: str | Path, run: str = MAIN) -> subprocess.CompletedProcess[str]:
    environment = {key: value for key, value in os.environ.items() if key not in ("CC", "PATH")}
    return subprocess.run(
        (sys.executable, "-c", WITHOUT + run, missing, *map(str, words)),
        cwd=folder, env={**environment, "PATH": ""}, capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip


def test_new_copies_each_shipped_scene_byte_for_byte_and_no_file_twice(tmp_path: Path) -> None:
    names = [line.split()[0] for line in call("new", "--list").stdout.splitlines() if "Data set: " not in line]
    assert {"press", "four-bar", "engine", "rotor", "toggle"} <= set(names)
    for name in names:
        assert call("new", name, tmp_path / "a b").exit_code == 0
    copies = sorted((tmp_path / "a b").iterdir())
    assert [copy.name for copy in copies] == sorted(path.name for path in (ROOT / "scenes").glob("*.toml"))
    assert all(copy.read_bytes() == (ROOT / "scenes" / copy.name).read_bytes() for copy in copies)
    mine = copies[0]
    mine.write_text("mine", encoding="utf-8")
    for name in names:
        refused = call("new", name, tmp_path / "a b")
        assert (refused.exit_code, "not overwritten" in refused.stderr) == (2, True)
    assert mine.read_text(encoding="utf-8") == "mine"


def test_new_prints_the_command_that_runs_the_copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    done = call("new", "rotor", "my rotor")
    path, following = done.stdout.splitlines()
    assert read_scene(path).name == "rotor"
    assert following == "Next: ballpass run 'my rotor/rotor.toml'"
    assert call("new", "punching_press").exit_code == 0  # the file's name, to here
    assert Path("punching_press.toml").is_file()
    named = call("new", "press", "mine.toml")  # taken for the name of the copy
    assert (named.exit_code, "rename the file then" in named.stderr, Path("mine.toml").exists()) == (2, True, False)
    unknown = call("new", "rotr")
    assert unknown.exit_code == 2
    assert "rotor" in unknown.stderr
    plain = call("new")
    assert (plain.exit_code, plain.stdout) == (0, call("new", "--list").stdout)
    assert all(len(line) <= 80 for line in plain.stdout.splitlines())


def test_new_copies_a_data_set_with_its_scene_and_keeps_a_scene_that_is_there(tmp_path: Path) -> None:
    assert "bearing-faults" in call("new", "--list").stdout
    done = call("new", "bearing-faults", tmp_path)
    assert done.stdout.splitlines()[-1] == f"Next: ballpass dataset {tmp_path / 'bearing_faults.toml'}"
    spec = read_spec(tmp_path / "bearing_faults.toml")
    assert {one.label for one in spec.classes} == {"healthy", "outer", "inner", "ball"}
    (tmp_path / "bearing_faults.toml").unlink()
    (tmp_path / "rotor.toml").write_text("mine", encoding="utf-8")
    done = call("new", "bearing-faults", tmp_path)
    assert (done.exit_code, "there already" in done.stdout) == (0, True)
    assert (tmp_path / "rotor.toml").read_text(encoding="utf-8") == "mine"


def test_all_scenes_are_copied_at_once_and_what_is_there_stays(tmp_path: Path) -> None:
    scenes = tmp_path / "scenes"
    scenes.mkdir()
    (scenes / "four_bar.toml").write_text("mine", encoding="utf-8")
    done = call("new", "--all", scenes)
    assert done.exit_code == 0
    assert "four_bar.toml: was there already" in done.stdout
    assert (scenes / "four_bar.toml").read_text(encoding="utf-8") == "mine"
    shipped = {path.name: path for path in (ROOT / "scenes").rglob("*.toml")}
    assert {path.name for path in scenes.iterdir()} == set(shipped)
    assert (scenes / "v_compressor.toml").read_bytes() == shipped["v_compressor.toml"].read_bytes()
    assert read_spec(scenes / "bearing_faults.toml").classes


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A generated folder whose scene is elsewhere."""
    return generate(ROOT / "scenes" / "rotor.toml", tmp_path_factory.mktemp("generated") / "rotor")


@pytest.mark.long
def test_a_generated_folder_runs_where_derive_sympy_pint_and_figures_are_missing(folder: Path, tmp_path: Path) -> None:
    # without a compiler, which takes longer; tests/test_package.py does it as users do and compares the motion
    missing = "ballpass.derive,sympy,pint,matplotlib,scipy,xarray,pandas,ziglang"
    asked = ("--set", "bearing.clearance=12 um", "--sample-rate", "10 kHz", "--method", "cvodes", "--cycles", "0.1")
    done = call_without(missing, tmp_path, "run", folder, *asked, "--transient", "0", "--json", "--out", "here")
    assert done.returncode == 0, done.stderr
    assert "matplotlib, which is not installed: pip install 'ballpass-runtime[figures]'" in done.stderr
    assert json.loads(done.stdout)["status"] == "done"
    assert load_solution(tmp_path / "here" / "solution.nc").parameters["bearing.clearance"] == 12e-6
    assert {path.name for path in (tmp_path / "here").glob("[!.]*")} == {"solution.nc", "summary.json"}
    each = call_without(missing.replace(",ziglang", ""), tmp_path, run=EACH)
    assert each.returncode == 0, each.stderr
    ends = {name: (code, said) for name, code, said in map(str.split, each.stdout.splitlines())}
    assert ends.pop("dataset")[0] == "2"  # Zarr comes first
    assert (ends.pop("skill")[0], ends.pop("mcp")[0]) == ("0", "2")  # a text; a package that may be missing
    assert ends.pop("explore")[0] == "2"  # ziglang does, where it is not installed
    for name in ("spectrum", "bifurcation", "optimize", "fit", "sobol", "morris"):
        assert ends.pop(name)[0] == "2"  # SciPy does
    assert len(ends) > 12
    assert set(ends.values()) == {("2", "True")}, ends


@pytest.mark.parametrize(("package", "extra"), [("xarray", "labelled"), ("zarr", "scale")])
def test_a_missing_package_is_named_with_the_extra_that_brings_it(
    package: str, extra: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(RequestError, match=rf"pip install 'ballpass\[{extra}\]'"):
        need(package)


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
def test_wrong_numbers_of_a_generated_folder_are_refused_with_the_remedy(setting: str, said: str, folder: Path) -> None:
    done = call("run", folder, "--set", setting)
    assert done.exit_code == 2
    assert said in done.stderr


def test_a_command_that_reads_the_scene_refuses_a_folder(folder: Path) -> None:
    done = call("explain", folder)
    assert done.exit_code == 2
    assert "scene file" in done.stderr


def test_a_sign_that_an_encoding_lacks_costs_the_sign_alone() -> None:
    main = (
        "import sys; from ballpass.runtime.app.entry import main; sys.argv = ['ballpass', 'bearings', '6204']; main()"
    )
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = subprocess.run((sys.executable, "-c", main), env=environment, capture_output=True, check=True, timeout=60)
    assert b"clearance in ?m" in done.stdout


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_offers_the_commands(shell: str) -> None:
    words = {"bash": {"COMP_WORDS": "ballpass sen", "COMP_CWORD": "1"}}
    told = words.get(shell, {"_TYPER_COMPLETE_ARGS": "ballpass sen", "_TYPER_COMPLETE_FISH_ACTION": "get-args"})
    done = CliRunner().invoke(app, env={**told, "_BALLPASS_COMPLETE": f"complete_{shell}"}, prog_name="ballpass")
    assert "sensitivity" in done.stdout
    assert "spectrum" not in done.stdout
    words = {name: text.replace("ballpass sen", "ballpass new fo").replace("1", "2") for name, text in told.items()}
    named = CliRunner().invoke(app, env={**words, "_BALLPASS_COMPLETE": f"complete_{shell}"}, prog_name="ballpass")
    assert "four-bar" in named.stdout
    assert "rotor" not in named.stdout


def test_help_groups_all_commands_in_80_columns() -> None:
    done = CliRunner().invoke(app, ["-h"], env={"COLUMNS": "80", "TERMINAL_WIDTH": "80"})
    lines = done.stdout.splitlines()
    assert max(map(len, lines)) <= 80
    heads = [line.strip("╭─╮ ") for line in lines if line.startswith("╭")]
    assert heads == ["Options", *COMMANDS, "For agents"]  # none is left over in "Commands"


def test_a_missing_scene_that_comes_with_ballpass_is_named_with_the_command_that_copies_it(tmp_path: Path) -> None:
    """A newcomer copies a command of the documentation outside the repository."""
    missing = tmp_path / "some scenes" / "punching_press.toml"
    done = call("run", missing)
    assert done.exit_code == 2
    words = done.stderr.split("`ballpass new ")[1].split("` copies it")[0]
    assert words == f"press '{missing.parent}'"
    assert call("new", *shlex.split(words)).exit_code == 0
    assert missing.exists()
    assert "`ballpass new --list`" in call("run", tmp_path / "own.toml").stderr
