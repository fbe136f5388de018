"""Claims about the command ``ballpass``: what it prints where, what it leaves behind, and how it says no.

The shipped scenes run once, in processes of their own, in one folder with a cache of its own.  The compiler of these
tests is a wrapper that can be told to refuse: what works then has compiled nothing.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sysconfig
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from ballpass.runtime import NoCompilerWarning, load_solution
from ballpass.runtime import plot as figures
from ballpass.runtime.app.cli import app
from ballpass.runtime.contract.extras import WITHOUT_COMPILER
from ballpass.runtime.questions import QUESTIONS
from ballpass.runtime.questions.question import declared

ROOT = Path(__file__).resolve().parent.parent
SCENES = ROOT / "scenes"
NAMES = ("punching_press", "varying_compliance")
PRESS = (SCENES / "punching_press.toml").read_text(encoding="utf-8")

#: A compiler that does its work, in a hurry, unless the file beside it says no; its version stays the same, hence the
#: cache's keys.
WRAPPER = """#!/bin/sh
for word in "$@"; do
  if [ "$word" = -shared ] && [ -e "{refuse}" ]; then echo "no compiling today" >&2; exit 1; fi
done
exec {compiler} "$@" -O0
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Site:
    """A folder in which the shipped scenes have run.

    Attributes
    ----------
    folder : with ``generated/`` and ``results/``
    cache : folder of the compiled models
    refuse : while this file is there, compiling fails
    runs : what each scene's process gave
    """

    folder: Path
    cache: Path
    refuse: Path
    runs: dict[str, subprocess.CompletedProcess[str]]

    def summary(self, name: str) -> dict[str, Any]:
        return json.loads(self.runs[name].stdout)


def command(*words: str | Path) -> list[str]:
    return [str(Path(sysconfig.get_path("scripts")) / "ballpass"), *map(str, words)]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    compiler = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    if compiler is None:
        pytest.skip("needs a C compiler: the tests are about when it is called")
    base = tmp_path_factory.mktemp("cli")
    folder, cache, refuse, wrapper = (base / name for name in ("site", "cache", "refuse", "cc"))
    folder.mkdir()
    wrapper.write_text(WRAPPER.format(refuse=refuse, compiler=compiler), encoding="utf-8")
    wrapper.chmod(0o755)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CC", str(wrapper))
        patch.setenv("BALLPASS_CACHE_DIR", str(cache))

        def start(name: str) -> subprocess.CompletedProcess[str]:
            figures = "--figures" if name == "punching_press" else "--no-figures"
            words = command("run", SCENES / f"{name}.toml", "--json", figures)
            return subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=300, check=False)

        with ThreadPoolExecutor(2) as pool:
            runs = dict(zip(NAMES, pool.map(start, NAMES), strict=True))
        yield Site(folder=folder, cache=cache, refuse=refuse, runs=runs)


@pytest.fixture
def refusing(site: Site) -> Iterator[None]:
    site.refuse.touch()
    yield
    site.refuse.unlink()


@pytest.fixture
def ballpass(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Result]:
    """The command in this process, called in a folder."""

    def call(folder: Path, *words: str | Path) -> Result:
        monkeypatch.chdir(folder)
        return CliRunner().invoke(app, [str(word) for word in words])

    return call


def contents(*folders: Path) -> dict[Path, tuple[int, str]]:
    """Every file and folder below: time of the last change and digest."""
    found = {}
    for folder in folders:
        for path in sorted(folder.rglob("*")):
            digest = hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
            found[path] = (path.stat().st_mtime_ns if path.is_file() else 0, digest)
    return found


def says_no(result: Result, *words: str, code: int = 2) -> None:
    """Refused on purpose: the exit code, words on stderr, nothing on stdout, no traceback."""
    assert result.exit_code == code, result.output
    assert result.exception is None or isinstance(result.exception, SystemExit)
    assert result.stdout == ""
    assert "Traceback" not in result.stderr
    for word in words:
        assert word in result.stderr


# ------------------------------------------------------------------------------------------------------ shipped scenes


@pytest.mark.parametrize("name", NAMES)
def test_shipped_scene_gives_one_json_object_on_stdout_and_nothing_else(site: Site, name: str) -> None:
    run = site.runs[name]
    assert run.returncode == 0, run.stderr
    summary = json.loads(run.stdout)  # fails on anything before or behind the object
    assert summary["scene"] == name
    assert summary["status"] == "done"
    assert summary["peak_ball_force"]["total"] > 0.0
    assert json.loads((site.folder / "results" / name / "summary.json").read_text(encoding="utf-8")) == summary


@pytest.mark.parametrize("name", NAMES)
def test_progress_is_one_plain_line_a_stage_where_stderr_is_a_file(site: Site, name: str) -> None:
    lines = [line for line in site.runs[name].stderr.splitlines() if not line.startswith("note: ")]
    stages = [re.fullmatch(r" *[0-9]+\.[0-9] s  ([a-zA-Z ]+)", line) for line in lines]
    assert all(stages), lines
    words = [stage.group(1) for stage in stages if stage]
    assert len(set(words)) == len(words)
    assert "\x1b" not in site.runs[name].stderr
    assert words[0] == "reading the scene"
    assert "deriving equations" in words
    assert "simulating" in words


def test_results_are_the_files_that_were_promised(site: Site) -> None:
    pictures = {f"{name}.png" for name in figures.NAMES if name != "shaft_loads"}  # bearings have no places
    folder = site.folder / "results" / "punching_press"
    assert {path.name for path in folder.glob("[!.]*")} == {"solution.nc", "summary.json", figures.CAPTIONS} | pictures
    assert sorted(path.name for path in (site.folder / "results").iterdir()) == sorted(NAMES)
    solution = load_solution(folder / "solution.nc")
    summary = site.summary("punching_press")
    steady = solution.steady()  # the summary's extremes are those of every step
    assert summary["inner.y"]["max"] == steady.reductions["inner.y"].maximum >= steady["inner.y"].max()
    assert summary["reaction.A.y"]["max"] >= solution.steady()["reaction.A.y"].max()


@pytest.mark.long
def test_a_second_run_gives_the_same_numbers(site: Site, ballpass: Callable[..., Result], tmp_path: Path) -> None:
    result = ballpass(
        site.folder, "run", SCENES / "varying_compliance.toml", "--json", "--no-figures", "--out", tmp_path
    )
    again, first = json.loads(result.stdout), site.summary("varying_compliance")
    for summary in (again, first):
        del summary["wall_time"], summary["files"]  # the digest of a solution, which tells its wall time
    assert again == first


def test_numbers_that_are_not_finite_are_null(site: Site, ballpass: Callable[..., Result], tmp_path: Path) -> None:
    """No ball carries a load: the life has no end, and a traceback of JSON was all that came of it."""
    free = ("--set", "load.force.x=0 N", "--set", "bearing.clearance=40 um", "--cycles", "2", "--transient", "1")
    scene = SCENES / "varying_compliance.toml"
    result = ballpass(tmp_path, "run", scene, *free, "--of", "life", "--json", "--no-figures")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["quantities"]["life"]["value"] is None


def test_without_json_a_table_and_the_place_of_the_results_are_printed(
    site: Site, ballpass: Callable[..., Result], tmp_path: Path
) -> None:
    out = tmp_path / "deep" / "folder"
    words = ("run", SCENES / "varying_compliance.toml", "--out", out, "--no-figures", "--cycles", "3")
    before = contents(site.folder)
    result = ballpass(site.folder, *words, "--transient", "1")
    assert result.exit_code == 0, result.stderr
    assert "Highest ball force: " in result.stdout
    assert f"results in {out}: solution.nc, summary.json" in " ".join(result.stdout.split())
    assert sorted(path.name for path in out.glob("[!.]*")) == ["solution.nc", "summary.json"]
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert summary["steady_cycles"]["value"] == pytest.approx(2.0)
    assert contents(site.folder) == before


# ---------------------------------------------------------------------------------- numbers change, structure does not


@pytest.mark.usefixtures("refusing")
def test_other_numbers_derive_nothing_and_compile_nothing(
    site: Site, ballpass: Callable[..., Result], tmp_path: Path
) -> None:
    numbers = (
        "bearing.clearance=20 um",
        "mechanism.bodies.rod.mass=3 kg",
        "mechanism.bodies.crank.points.B=7 mm",
        "mechanism.forces.punch.window.start=230 deg",
        "mechanism.driver.speed=600 rpm",
    )
    before = contents(site.folder, site.cache)
    words = ("run", SCENES / "punching_press.toml", "--json", "--no-figures", "--out", tmp_path)
    result = ballpass(site.folder, *words, *(word for number in numbers for word in ("--set", number)))
    assert result.exit_code == 0, result.stderr
    assert "deriving" not in result.stderr
    # not even rewritten with the same bytes: the times of the last change are compared as well
    assert contents(site.folder, site.cache) == before
    changed, printed = json.loads(result.stdout), site.summary("punching_press")
    assert changed["peak_ball_force"]["total"] != pytest.approx(printed["peak_ball_force"]["total"], rel=1e-4)


def test_the_refusing_compiler_would_have_been_noticed(
    site: Site, ballpass: Callable[..., Result], tmp_path: Path, refusing: None
) -> None:
    nine = tmp_path / "nine.toml"
    nine.write_text(PRESS.replace("balls = 8 ", "balls = 9 "), encoding="utf-8")
    result = ballpass(tmp_path, "run", nine)
    says_no(result, "The C compiler failed with exit code 1", "no compiling today", "set CC", code=1)
    assert not (tmp_path / "results").exists()


@pytest.mark.long
@pytest.mark.usefixtures("refusing")
def test_set_equals_the_same_value_in_the_file(site: Site, ballpass: Callable[..., Result], tmp_path: Path) -> None:
    plain = ("--json", "--no-figures", "--out", tmp_path / "results")
    by_set = ballpass(site.folder, "run", SCENES / "punching_press.toml", *plain, "--set", "bearing.clearance=20e-6 m")
    edited = tmp_path / "punching_press.toml"
    edited.write_text(PRESS.replace('clearance = "10 um"', 'clearance = "20 um"'), encoding="utf-8")
    # derived anew in an empty folder; the same structure gives the same C, which is in the cache
    by_file = ballpass(tmp_path, "run", edited, *plain)
    assert by_file.exit_code == 0, by_file.stderr
    assert "deriving equations" in by_file.stderr
    first, second = json.loads(by_set.stdout), json.loads(by_file.stdout)
    for summary in (first, second):
        del summary["wall_time"], summary["files"]
    assert first == second


# --------------------------------------------------------------------------------------------------- wrong scene files


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [  # found when text is read, when values are checked, when the linkage is derived
        ("[bearing]", "[bearing", ("not TOML",)),
        ('clearance = "10 um"', 'clearence = "10 um"', ("bearing.clearence", 'did you mean "clearance"')),
        ('C = "100 mm"', 'C = "4 mm"', ("cannot be assembled at joint C", "crank angle", "rod")),
        ('"drive_torque"]', '"inner.z"]', ("run.outputs", "inner.z", "inner.x")),
    ],
)
def test_wrong_scene_is_refused_in_words_and_nothing_is_written(
    ballpass: Callable[..., Result], tmp_path: Path, old: str, new: str, words: tuple[str, ...]
) -> None:
    assert PRESS.count(old) == 1
    scene = tmp_path / "wrong.toml"
    scene.write_text(PRESS.replace(old, new), encoding="utf-8")
    for subcommand in ("run", "derive"):
        result = ballpass(tmp_path, subcommand, scene)
        says_no(result, str(scene), *words, "given:", "allowed:", "remedy:")
        assert list(tmp_path.iterdir()) == [scene]


@pytest.mark.long
def test_empty_and_missing_files_are_refused_by_the_process(site: Site, tmp_path: Path) -> None:
    empty = tmp_path / "empty.toml"
    empty.touch()
    for path, words in ((empty, "the file is empty"), (tmp_path / "missing.toml", "No such file")):
        run = subprocess.run(
            command("run", path, "--json"), cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False
        )
        assert run.returncode == 2
        assert run.stdout == ""
        assert words in run.stderr
        assert "remedy:" in run.stderr
        assert "Traceback" not in run.stderr
    assert list(tmp_path.iterdir()) == [empty]


# ------------------------------------------------------------------------------------------------------ wrong requests


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--set", "a=1 m", "--set", "bearing.clearance=1"), ("2 faults", "a:", "bearing.clearance", "remedy:")),
        (("--set", "mechanism.bodies.rod.mass=-1 kg"), ("mechanism.bodies.rod.mass", "above zero")),
        (("--method", "runge"), ("'runge'", "auto, stepper", "cvodes")),
        (("--rtol", "5"), ("--rtol", "5", "1e-13 to 0.1")),
        (("--rtol", "nan"), ("--rtol", "nan", "1e-13 to 0.1")),
        (("--cycles", "0"), ("--cycles", "above 0")),
        (("--cycles", "inf"), ("--cycles", "above 0")),
        (("--transient", "-1"), ("--transient", "from 0 on")),
        (("--cycles", "many"), ("--cycles", "number")),
        (("--cycles", "2"), ("run.transient_cycles", "2 of 2 cycles", "run longer")),
        (("--duration", "0.2 s"), ("run.transient_cycles", "cycles in 0.2 s", "run longer")),
        (("--cycles", "3", "--duration", "1 s"), ("both given", "one of them")),
        (("--error", "1%", "--kinks", "located"), ("kinks = 'located'", "or the error")),
        (("--error", "1%", "--rtol", "1e-5"), ("rtol = 1e-05", "or the error")),
        (("--cycle", "3"), ("--cycle", "--cycles")),
        (("--out", "file/results"), ("file/results", "cannot be written", "--out DIR")),
    ],
)
def test_wrong_request_is_refused_before_anything_is_written(
    ballpass: Callable[..., Result], tmp_path: Path, words: tuple[str, ...], said: tuple[str, ...]
) -> None:
    (tmp_path / "file").touch()
    result = ballpass(tmp_path, "run", SCENES / "punching_press.toml", *words)
    says_no(result, *said)
    assert "compiling" not in result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_linkage_that_locks_with_a_number_is_refused_and_no_results_are_written(
    site: Site, ballpass: Callable[..., Result], tmp_path: Path
) -> None:
    words = ("--out", tmp_path / "results", "--set", "mechanism.bodies.rod.points.C=3 mm")
    result = ballpass(site.folder, "run", SCENES / "punching_press.toml", *words)
    says_no(result, "joint 'C'", "crank angle", "Change the lengths")
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="the superuser may write everywhere")
def test_folder_without_permission_is_refused(ballpass: Callable[..., Result], tmp_path: Path) -> None:
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o555)
    result = ballpass(tmp_path, "run", SCENES / "punching_press.toml", "--out", locked / "results")
    says_no(result, str(locked), "may not be written", "--out DIR")
    result = ballpass(tmp_path, "derive", SCENES / "punching_press.toml", "--out", locked / "generated")
    says_no(result, str(locked), "permissions")


def test_folder_that_cannot_be_made_is_refused_by_derive(ballpass: Callable[..., Result], tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    result = ballpass(tmp_path, "derive", SCENES / "varying_compliance.toml", "--out", tmp_path / "file" / "generated")
    says_no(result, "file", "this folder cannot be made (Not a directory)")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


# --------------------------------------------------------------------------------------------------- derive, equations


def test_check_tells_fresh_stale_and_missing_and_its_remedy_works(
    ballpass: Callable[..., Result], tmp_path: Path
) -> None:
    scene = tmp_path / "rotor.toml"
    text = (SCENES / "varying_compliance.toml").read_text(encoding="utf-8")
    scene.write_text(text, encoding="utf-8")
    says_no(ballpass(tmp_path, "derive", "--check", scene), "does not exist", f"ballpass derive {scene}", code=1)
    assert ballpass(tmp_path, "derive", scene).stdout == "generated/rotor\n"
    before = contents(tmp_path)
    assert ballpass(tmp_path, "derive", "--check", scene).exit_code == 0

    # a number is in the manifest, the text of the equations in a file of its own
    scene.write_text(text.replace('clearance = "0 um"', 'clearance = "1 um"'), encoding="utf-8")
    assert scene.read_text(encoding="utf-8") != text
    says_no(ballpass(tmp_path, "derive", "--check", scene), "stale: manifest.json.", f"ballpass derive {scene}", code=1)
    scene.write_text(text, encoding="utf-8")
    (tmp_path / "generated" / "rotor" / "EQUATIONS.md").write_text("x = 1\n", encoding="utf-8")
    says_no(ballpass(tmp_path, "derive", "--check", scene), "stale: EQUATIONS.md.", code=1)

    assert ballpass(tmp_path, "derive", scene).exit_code == 0
    assert ballpass(tmp_path, "derive", "--check", scene).stdout == "generated/rotor is up to date\n"
    after = contents(tmp_path)
    assert {path: digest for path, (_, digest) in after.items()} == {
        path: digest for path, (_, digest) in before.items()
    }


def test_equations_are_markdown_with_the_matrix_of_eq_1(ballpass: Callable[..., Result], tmp_path: Path) -> None:
    result = ballpass(tmp_path, "equations", SCENES / "punching_press.toml")
    assert result.exit_code == 0
    assert re.search(r"^# \S", result.stdout, re.MULTILINE)
    assert "matrix}" in result.stdout
    assert "Eq. (1)" in result.stdout
    assert "`bearing.clearance`" in result.stdout
    assert result.stdout.endswith("\n")
    assert not list(tmp_path.iterdir())
    # what is committed beside the C is the same text without values, which are the scene's
    assert re.search(r"\| `bearing.clearance` \| 1e-05 \| m \|", result.stdout)
    committed = (ROOT / "generated" / "punching_press" / "EQUATIONS.md").read_text(encoding="utf-8")
    assert result.stdout.partition("## States")[2] == committed.partition("## States")[2]


def test_bearings_that_can_be_named_are_printed_within_80_columns(
    ballpass: Callable[..., Result], tmp_path: Path
) -> None:
    printed = ballpass(tmp_path, "bearings", "63*")
    assert printed.exit_code == 0
    rows = [line.split() for line in printed.stdout.splitlines() if line.startswith(" 63")]
    assert len(rows) == 17
    assert rows[6][:5] == ["6306", "30", "72", "19", "8"]
    assert max(len(line) for line in printed.stdout.splitlines()) <= 80
    (bearing,) = json.loads(ballpass(tmp_path, "bearings", "6204", "--json").stdout)["bearings"]
    assert bearing["clearance"]["CN"] == [5e-6, 20e-6]
    assert bearing["catalogues"]["skf"] == {"dynamic": 13500.0, "static": 6550.0, "fatigue_limit": 280.0}
    says_no(ballpass(tmp_path, "bearings", "6204-2RS"), "6204-2RS", "ballpass bearings")


def test_version_and_help_are_printed(ballpass: Callable[..., Result], tmp_path: Path) -> None:
    assert re.fullmatch(r"ballpass \d+\.\d+\.\d+\S*\n", ballpass(tmp_path, "--version").stdout)
    help_text = ballpass(tmp_path, "--help").stdout
    assert all(name in help_text for name in ("run", "derive", "equations", "--version"))
    assert "--transient" in ballpass(tmp_path, "run", "--help").stdout


# ------------------------------------------------------------------------------- interruptions, and results that exist


def started(site: Site, folder: Path, *words: str) -> subprocess.Popen[str]:
    """A run of the press in `folder` that has begun to simulate."""
    process = subprocess.Popen(
        command("run", SCENES / "punching_press.toml", "--out", str(folder), *words),
        cwd=site.folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    for line in process.stderr:
        if "simulating" in line:
            return process
    raise AssertionError(f"ended with {process.wait()}")


@pytest.mark.long
@pytest.mark.parametrize(
    ("method", "length"),
    [("stepper", ("800", "1e-7")), pytest.param("cvodes", ("500", "1e-12"), marks=pytest.mark.long)],
)
def test_interrupted_run_leaves_no_results_and_says_so(
    site: Site, tmp_path: Path, method: str, length: tuple[str, str]
) -> None:
    if method == "stepper":
        old = tmp_path / "results"
        shutil.copytree(site.folder / "results" / "punching_press", old)
    before = contents(tmp_path)
    words = ("--method", method, "--cycles", length[0], "--rtol", length[1])
    with started(site, tmp_path / "results", *words) as process:
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(0.3)  # it is on the way
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=300)  # the stepper hears it between its calls
    assert process.returncode == 130
    assert "interrupted" in err
    assert "Traceback" not in err
    assert "integrator could not" not in err
    assert out == ""
    assert contents(tmp_path) == before


def test_interruption_while_writing_leaves_nothing_half_written(
    site: Site, ballpass: Callable[..., Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: Any) -> None:
        assert list(tmp_path.rglob("solution.nc")), "the solution is written before the figures"
        raise KeyboardInterrupt

    monkeypatch.setattr("ballpass.runtime.plot.gallery.draw_all", interrupted)
    words = ("run", SCENES / "varying_compliance.toml", "--cycles", "3", "--transient", "1", "--out")
    says_no(ballpass(site.folder, *words, tmp_path / "new" / "results"), "interrupted", code=130)
    assert not list(tmp_path.iterdir())


def test_results_are_replaced_file_by_file(site: Site, ballpass: Callable[..., Result], tmp_path: Path) -> None:
    scene = SCENES / "varying_compliance.toml"
    (tmp_path / "notes.txt").write_text("mine", encoding="utf-8")
    (tmp_path / "orbit.png").write_bytes(b"of an earlier run")
    (tmp_path / "summary.json").write_text("old", encoding="utf-8")
    with (tmp_path / "summary.json").open(encoding="utf-8") as reader:
        words = ("--cycles", "3", "--transient", "1", "--no-figures", "--out", tmp_path)
        assert ballpass(site.folder, "run", scene, *words).exit_code == 0
        assert reader.read() == "old"  # who reads the old file reads it to its end
    # a figure of another run would pass for one of this
    names = sorted(path.name for path in tmp_path.iterdir() if not path.name.startswith("."))
    assert names == ["notes.txt", "solution.nc", "summary.json"]
    assert (tmp_path / "notes.txt").read_text(encoding="utf-8") == "mine"
    assert json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))["scene"] == "varying_compliance"
    assert np.isfinite(load_solution(tmp_path / "solution.nc")["inner.x"]).all()


@pytest.mark.filterwarnings("default::ballpass.runtime.NoCompilerWarning")
def test_without_a_compiler_a_warning_names_the_cost_and_the_numbers_agree(
    site: Site, ballpass: Callable[..., Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ballpass.runtime.native.compile.find_compiler", lambda command: None)
    words = ("run", SCENES / "punching_press.toml", "--json", "--no-figures", "--out", tmp_path)
    result = ballpass(site.folder, *words)
    assert result.exit_code == 0, result.stderr
    assert issubclass(NoCompilerWarning, UserWarning)
    assert "warning: No C compiler was found" in result.stderr
    assert "times as long" in result.stderr
    found, compiled = json.loads(result.stdout), site.summary("punching_press")
    assert found["compiled"] is False
    # two methods at a relative tolerance of 1e-6 per step
    sampled = compiled["peak_ball_force"]["sampled"]["total"]  # between them only the stepper looks
    assert found["peak_ball_force"]["total"] == pytest.approx(sampled, rel=1e-4)


def without_a_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in ("compilers", "compile", "loaded_model"):
        monkeypatch.setattr(f"ballpass.runtime.native.{module}.find_compiler", lambda command=None: None)


@pytest.mark.parametrize(
    "words",
    [
        *("life", "sensitivity", "steady", "trade", "sweep --vary bearing.clearance=1um:2um:2", "export --fmu"),
        *("run --of peak_ball_force", "run --error 1%", "run --turns settle", "run --method stepper"),
    ],
)
def test_without_a_compiler_what_needs_one_is_refused_before_anything_is_derived(
    ballpass: Callable[..., Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: str
) -> None:
    """`run --of` told to take a method that it had refused; the page said that everything runs."""
    without_a_compiler(monkeypatch)
    command, *rest = words.split()
    says_no(
        ballpass(tmp_path, command, SCENES / "varying_compliance.toml", *rest),
        *("needs a C compiler", WITHOUT_COMPILER, 'pip install "ballpass[compiler]"'),
    )
    assert not (tmp_path / "generated").exists()


@pytest.mark.filterwarnings("default::ballpass.runtime.NoCompilerWarning")
@pytest.mark.parametrize(
    "words",
    [
        *("linearize", "jacobian --of ball.force --wrt bearing.clearance", "explain", "export --c"),
        *("spectrum --of inner.y --cycles 25", "stream --cycles 1 --sample-rate 1kHz --out x.nc"),
        "section --readings 40 --settling 0",
    ],
)
def test_without_a_compiler_the_rest_works(
    ballpass: Callable[..., Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: str
) -> None:
    without_a_compiler(monkeypatch)
    command, *rest = words.split()
    result = ballpass(tmp_path, command, SCENES / "varying_compliance.toml", *rest)
    assert result.exit_code == 0, result.stderr


def test_the_page_on_installing_says_what_messages_say() -> None:
    page = (SCENES.parent / "docs/howto/install.md").read_text(encoding="utf-8")
    assert " ".join(WITHOUT_COMPILER.split()) in " ".join(page.split())


def test_what_needs_no_compiler_is_named() -> None:
    """`section` worked in Python and was refused as a command; the page was silent on it and five others."""
    named = WITHOUT_COMPILER.partition(" work,")[0]
    for ask in QUESTIONS:
        question = declared(ask)
        assert (f"`{question.name}`" in named) == (question.samples or not question.runs), question.name


@pytest.mark.parametrize(("setting", "option"), [("run.cycles=3", "--cycles 3"), ("run.rtol=1e-8", "--rtol 1e-8")])
def test_a_run_setting_given_as_a_parameter_is_told_its_option(
    ballpass: Callable[..., Result], tmp_path: Path, setting: str, option: str
) -> None:
    says_no(ballpass(tmp_path, "run", SCENES / "varying_compliance.toml", "--set", setting), option)


@pytest.mark.long
def test_a_large_file_is_told_before_it_is_written_and_its_size_behind(
    site: Site, ballpass: Callable[..., Result], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a bound that a short run passes."""
    words = ("run", SCENES / "varying_compliance.toml", "--no-figures", "--out", tmp_path / "out", "--cycles", "3")
    quiet = ballpass(site.folder, *words, "--transient", "1")
    assert "note" not in quiet.stderr
    monkeypatch.setattr("ballpass.runtime.app.commands.run.LARGE", 1000)
    told = ballpass(site.folder, *words, "--transient", "1")
    count = len(load_solution(tmp_path / "out" / "solution.nc"))
    assert f"note: {count} samples, about " in told.stderr
    size = (tmp_path / "out" / "solution.nc").stat().st_size
    assert (
        f"(solution.nc: {size / 1e6:.0f} MB)" in told.stdout or f"(solution.nc: {-(-size // 1000)} kB)" in told.stdout
    )
    assert "integrated in" in " ".join(told.stdout.split())
