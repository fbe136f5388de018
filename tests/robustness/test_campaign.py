"""Absurd commands and mutated scenes end with words and the right exit code: no traceback, no hang.

Drawn from a seed.  A small part runs with the quick tests, in this process; the rest is long.
"""

from __future__ import annotations

import contextlib
import copy
import os
import random
import signal
import subprocess
import sysconfig
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from test_bad_input import EVIL, NUMBERS, as_toml, places
from typer.testing import CliRunner

from ballpass.runtime.app.cli import app

SCENES = Path(__file__).resolve().parents[2] / "scenes"
NAMES = tuple(sorted(path.stem for path in SCENES.glob("*.toml")))
BALLPASS = str(Path(sysconfig.get_path("scripts")) / "ballpass")

pytestmark = pytest.mark.long

#: Twenty commands or scenes each.
SEEDS = range(1, 11)

#: What a command may take of its own processor time, however absurd it is [s].
PATIENCE = 60.0

#: Options, with what is absurd for each; `{}` is a value of `ABSURD`.
OPTIONS = (
    *("--cycles {}", "--duration {}s", "--transient {}", "--sample-rate {}Hz", "--rtol {}", "--error {}", "--of {}"),
    *("--set bearing.clearance={}um", "--set {}={}", "--method {}", "--kinks {}", "--members {}", "--vary {}={}:{}:{}"),
    *("--initial {}", "--turns {}", "--time {}s", "--at-angle {}deg", "--wrt {}", "--against {}", "--out {}"),
)
ABSURD = (
    *("0", "-1", "1e300", "1e-300", "nan", "inf", "-inf", "", " ", "x", "9" * 400, "1e9", "1e12", "0x10", "½", "-0"),
    *("/dev/null", "/dev/full", "..", "\x1b[31m", "é", "%s%n", "[bold]x[/]", "peak:", ":", "rms:inner.y@", "a" * 5000),
)
#: A short run of a scene that derives.
RUN = ("run", "--duration", "2ms", "--transient", "0", "--no-figures")
COMMANDS = (
    *("run", "derive", "equations", "explain", "life", "sensitivity", "spectrum", "linearize", "jacobian", "trade"),
    *("sweep", "stream", "export", "dataset", "animate", "new", "bearings", "schema", "nothing", "--version"),
)


@contextlib.contextmanager
def no_hang() -> Iterator[None]:
    """Time of this process on its processor is bounded."""

    def too_long(*_: object) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGPROF, too_long)
    signal.setitimer(signal.ITIMER_PROF, PATIENCE)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def ends_in_words(words: list[str]) -> int:
    """The exit code of a command, which says why it failed where it did."""
    with no_hang():
        done = CliRunner().invoke(app, words)
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise AssertionError(words) from done.exception
    assert done.exit_code in (0, 1, 2), words
    assert not done.exit_code or done.stderr.strip(), words
    assert "Traceback" not in done.stderr, words
    return done.exit_code


def absurd_command(draw: random.Random) -> list[str]:
    """A command, a scene or what is none, and options with absurd values."""
    words = [draw.choice(COMMANDS)]
    if draw.random() < 0.9:
        words.append(str(SCENES / "varying_compliance.toml") if draw.random() < 0.8 else draw.choice(ABSURD))
    for _ in range(draw.randint(1, 2)):
        option = draw.choice(OPTIONS)
        words += option.format(*(draw.choice(ABSURD) for _ in range(4))).split(" ", 1)
    return words


def mutant(draw: random.Random) -> str:
    """A shipped scene with one or two values replaced."""
    tree: Any = copy.deepcopy(tomllib.loads((SCENES / f"{draw.choice(NAMES)}.toml").read_text(encoding="utf-8")))
    for _ in range(draw.randint(1, 2)):
        path = draw.choice(places(tree))
        table = tree
        for key in path[:-1]:
            table = table[key]
        table[path[-1]] = draw.choice((*EVIL, *NUMBERS, [], {}, [1], ["", ""]))
    return "\n".join(f"{as_toml(key)} = {as_toml(value)}" for key, value in tree.items())


@pytest.mark.parametrize("seed", SEEDS)
def test_absurd_commands_end_in_words(seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    draw = random.Random(seed)
    for _ in range(20):
        ends_in_words(absurd_command(draw))


@pytest.mark.parametrize("seed", SEEDS)
def test_mutated_scenes_end_in_words(seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    draw = random.Random(seed)
    for number in range(20):
        scene = tmp_path / f"mutant{number}.toml"
        scene.write_text(mutant(draw), encoding="utf-8")
        if ends_in_words([draw.choice(("derive", "equations")), str(scene)]) == 0:
            ends_in_words([*RUN, str(scene)])


@pytest.mark.parametrize(
    ("words", "code"),
    [
        ("trade SCENE --members 1000000000", 2),
        ("stream SCENE --out x.nc --sample-rate 1e9Hz --cycles 1e9", 2),
        ("dataset DATA_SET --out x.nc --workers 1000000000", 2),  # as many processes were started
    ],
)
def test_what_is_too_large_is_refused(words: str, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    files = {"SCENE": SCENES / "varying_compliance.toml", "DATA_SET": SCENES / "data_sets" / "bearing_faults.toml"}
    assert ends_in_words([str(files.get(word, word)) for word in words.split()]) == code
    assert not (tmp_path / "x.nc").exists()


def shell(line: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """What a shell makes of a command, $B, and its streams."""
    env = {**os.environ, "B": BALLPASS, "S": str(SCENES / "varying_compliance.toml")}
    return subprocess.run(["sh", "-c", line], cwd=folder, env=env, capture_output=True, text=True, timeout=300)


@pytest.mark.parametrize("stderr", ["2>/dev/full", "2>&-"])
def test_a_command_whose_messages_nobody_takes_does_its_work(stderr: str, tmp_path: Path) -> None:
    """Each ended with exit code 1 and without a result."""
    done = shell(f'"$B" equations "$S" {stderr}', tmp_path)
    assert done.returncode == 0
    assert "# Derived equations: varying_compliance" in done.stdout


@pytest.mark.parametrize("stdout", [">/dev/full", ">&-"])
@pytest.mark.parametrize("words", ["bearings", "schema", 'equations "$S"', "--help"])
def test_results_that_stdout_does_not_take_are_a_fault_in_words(words: str, stdout: str, tmp_path: Path) -> None:
    """Nine commands ended in a traceback."""
    done = shell(f'"$B" {words} {stdout}', tmp_path)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert "error: cannot " in done.stderr
    assert "No space left on device" in done.stderr or "Bad file descriptor" in done.stderr


@pytest.mark.parametrize(
    "words", ["run PIPE", "equations PIPE", "dataset PIPE", 'run "$S" --initial PIPE', "run /dev/zero"]
)
def test_pipes_and_devices_are_refused_and_not_waited_for(words: str, tmp_path: Path) -> None:
    """A pipe without a writer hung, and a device filled the memory."""
    os.mkfifo(tmp_path / "pipe.toml")
    done = shell(f'timeout 60 "$B" {words.replace("PIPE", "pipe.toml")}', tmp_path)
    assert done.returncode == 2
    assert "this is no regular file" in done.stderr
