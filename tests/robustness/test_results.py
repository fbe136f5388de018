"""Claims about the folder of results: solution, summary and figures of one run, whenever a process is ended."""

from __future__ import annotations

import contextlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from profiles import LONG

from ballpass.runtime import RequestError, Solution, load, load_results
from ballpass.runtime.app.results import FILES, SOLUTION, SUMMARY, write_results
from ballpass.runtime.contract import folders
from ballpass.runtime.contract.folders import LOCK

FIGURES = ("orbit.png", "forces.png")

WRITING = """
    import itertools, sys
    from pathlib import Path
    from ballpass.runtime.app.results import SOLUTION, write_results
    target, *sources = map(Path, sys.argv[2:])
    runs = [{path.name: path.read_bytes() for path in sorted(source.iterdir())} for source in sources]
    print("ready", flush=True)
    times = itertools.count() if "always" in sys.argv else range(50)
    for number in (time % len(runs) for time in times):
        def write(made):
            for name, content in runs[number].items():
                (made / name).write_bytes(content)
            return {"run": number}
        write_results(target, write, figures=("orbit.png", "forces.png"))
"""


@pytest.fixture(scope="module")
def solutions(_rotor_master: Path) -> list[Solution]:
    model = load(_rotor_master)
    return [model.simulate(cycles=length) for length in (0.2, 0.3)]


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory, solutions: list[Solution]) -> tuple[Path, Path]:
    """Files of two runs; the second has a figure less."""
    base = tmp_path_factory.mktemp("runs")
    for number, solution in enumerate(solutions):
        folder = base / str(number)
        folder.mkdir()
        solution.save(folder / SOLUTION)
        for name in FIGURES[: 2 - number]:
            (folder / name).write_bytes(b"\x89PNG of run %d " % number * 10_000)
    return base / "0", base / "1"


def put(target: Path, source: Path, number: int) -> None:
    def write(made: Path) -> dict[str, Any]:
        for path in source.iterdir():
            shutil.copy(path, made)
        return {"run": number}

    write_results(target, write, figures=FIGURES)


def killed_while_writing(target: Path, runs: tuple[Path, Path], *, kills: int, within: float) -> Iterator[None]:
    draw = random.Random(kills)
    command = [sys.executable, "-c", textwrap.dedent(WRITING), "always", str(target), *map(str, runs)]
    for _ in range(200 if LONG else kills):
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n", process.communicate()[1]
            time.sleep(draw.random() * within)
            process.kill()
            _, errors = process.communicate(timeout=60)
            assert process.returncode == -signal.SIGKILL, errors
        yield


def own(folder: Path) -> dict[str, bytes]:
    """Content of the files of a run in a folder, the summary aside."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name in (SOLUTION, *FIGURES)}


def test_a_killed_process_leaves_one_run_or_files_that_are_refused(
    tmp_path: Path, runs: tuple[Path, Path], solutions: list[Solution]
) -> None:
    """Once a new solution stood beside the summary and the figures of the run before, and passed for a run."""
    target = tmp_path / "results" / "rotor"
    put(target, runs[0], 0)
    (target / "mine").mkdir()
    (target / "mine" / "notes.txt").write_text("mine", encoding="utf-8")
    for _ in killed_while_writing(target, runs, kills=6, within=0.04):
        with contextlib.suppress(RequestError):
            found = load_results(target)
            np.testing.assert_array_equal(found.solution.x, solutions[found.summary["run"]].x)
        assert (target / "mine" / "notes.txt").read_text(encoding="utf-8") == "mine"
    put(target, runs[1], 1)
    assert own(target) == own(runs[1])
    assert load_results(target).summary["run"] == 1
    assert sorted(path.name for path in target.iterdir()) == [LOCK, "mine", "orbit.png", SOLUTION, SUMMARY]


@pytest.mark.parametrize("broken", [SOLUTION, "orbit.png", "forces.png", SUMMARY])
@pytest.mark.parametrize("call", ["replace", "unlink"])
def test_an_end_between_any_two_moves_is_refused_or_leaves_one_run(
    tmp_path: Path, runs: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch, call: str, broken: str
) -> None:
    """The process is ended before each call that touches a file."""
    target = tmp_path / "rotor"
    put(target, runs[0], 0)

    class Ended(BaseException):
        """What no handler of the code under test should make good."""

    real: Callable[..., object] = getattr(os, call)

    def ending(path: Any, *rest: Any, **options: Any) -> object:
        if Path(path).name == broken:
            raise Ended
        return real(path, *rest, **options)

    with monkeypatch.context() as patch:
        patch.setattr(os, call, ending)
        patch.setattr(shutil, "rmtree", lambda *_, **__: None)  # a process that is gone tidies nothing
        with contextlib.suppress(Ended):
            put(target, runs[1], 1)
    with contextlib.suppress(RequestError):
        assert own(target) == own(runs[load_results(target).summary["run"]])
    put(target, runs[0], 0)
    assert load_results(target).summary["run"] == 0
    assert own(target) == own(runs[0])


@pytest.mark.parametrize("name", [SOLUTION, "orbit.png"])
def test_files_of_two_runs_are_refused_by_name(tmp_path: Path, runs: tuple[Path, Path], name: str) -> None:
    target = tmp_path / "rotor"
    put(target, runs[0], 0)
    (target / name).write_bytes((runs[1] / SOLUTION).read_bytes())
    refusal = rf"{name}: does not belong to the run of summary\.json.*Run the scene again"
    with pytest.raises(RequestError, match=refusal):
        load_results(target)


def test_results_without_summary_or_of_another_version_are_refused(tmp_path: Path, runs: tuple[Path, Path]) -> None:
    with pytest.raises(RequestError, match=r"summary\.json: cannot be read.*`ballpass run`"):
        load_results(tmp_path)
    put(tmp_path / "rotor", runs[0], 0)
    for text in ("", "[]", "{}", '{"files": 3}', "[" * 100_000):
        (tmp_path / "rotor" / SUMMARY).write_text(text, encoding="utf-8")
        with pytest.raises(RequestError, match="has no digests"):
            load_results(tmp_path / "rotor")


def test_a_failure_while_writing_changes_nothing(
    tmp_path: Path, runs: tuple[Path, Path], kept: Callable[[Path], dict[str, bytes]]
) -> None:
    target = tmp_path / "rotor"
    put(target, runs[0], 0)
    before = kept(tmp_path)

    def failing(made: Path) -> dict[str, Any]:
        (made / SOLUTION).write_bytes(b"half")
        raise OSError(28, "No space left on device")

    for place in (target, tmp_path / "new" / "folder"):
        with pytest.raises(OSError, match="No space"):
            write_results(place, failing)
    assert kept(tmp_path) == before
    assert [path.name for path in tmp_path.iterdir()] == ["rotor"]


def test_where_somebody_works_the_folder_itself_stays(
    tmp_path: Path, runs: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """`ballpass run SCENE --out .`: a shell whose folder was replaced would see nothing any more."""
    target = tmp_path / "rotor"
    put(target, runs[0], 0)
    monkeypatch.chdir(target)
    number = target.stat().st_ino
    put(Path(), runs[1], 1)
    assert target.stat().st_ino == number
    assert own(Path()) == own(runs[1])


def test_links_and_permissions_of_a_folder_stay(tmp_path: Path, runs: tuple[Path, Path]) -> None:
    target, link = tmp_path / "rotor", tmp_path / "link"
    put(target, runs[0], 0)
    target.chmod(0o750)
    link.symlink_to(target)
    (target / "other").symlink_to("elsewhere")
    put(link, runs[1], 1)
    assert link.is_symlink()
    assert target.stat().st_mode & 0o777 == 0o750
    assert (target / "other").is_symlink()
    (target / "other").unlink()
    put(link, runs[0], 0)
    assert link.is_symlink()
    assert target.stat().st_mode & 0o777 == 0o750


@pytest.mark.long
def test_a_reader_beside_a_writer_gets_one_run(
    tmp_path: Path, runs: tuple[Path, Path], solutions: list[Solution]
) -> None:
    target = tmp_path / "rotor"
    put(target, runs[0], 0)
    code = WRITING.replace(
        "        def write(made):", "        import time; time.sleep(0.02)\n        def write(made):"
    )
    command = [sys.executable, "-c", textwrap.dedent(code), "always", str(target), *map(str, runs)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        try:
            for _ in range(300 if LONG else 20):
                found = load_results(target)
                np.testing.assert_array_equal(found.solution.x, solutions[found.summary["run"]].x)
        finally:
            process.kill()


@pytest.mark.long
def test_two_processes_that_write_one_folder_take_turns(tmp_path: Path, runs: tuple[Path, Path]) -> None:
    """Each took files of the other for those of a killed process, and one ended in FileNotFoundError."""
    target = tmp_path / "rotor"
    put(target, runs[0], 0)
    command = [sys.executable, "-c", textwrap.dedent(WRITING), "some", str(target), *map(str, runs)]
    both = [subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) for _ in range(2)]
    errors = [process.communicate(timeout=60)[1] for process in both]
    assert [process.returncode for process in both] == [0, 0], errors
    assert load_results(target).summary["run"] == 1
    assert own(target) == own(runs[1])
    assert [path.name for path in tmp_path.iterdir()] == ["rotor"]


def test_a_folder_that_another_process_never_leaves_is_told(
    tmp_path: Path, runs: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    put(tmp_path, runs[0], 0)
    monkeypatch.setattr(folders, "PATIENCE", 0.1)
    with folders.locked(tmp_path), pytest.raises(RequestError, match="another process has been writing there"):
        put(tmp_path, runs[1], 1)
    assert own(tmp_path) == own(runs[0])


def test_a_figure_that_cannot_be_read_is_named(tmp_path: Path, runs: tuple[Path, Path]) -> None:
    target = tmp_path / "rotor"
    put(target, runs[0], 0)
    (target / "orbit.png").unlink()
    (target / "orbit.png").mkdir()
    with pytest.raises(RequestError, match=r"orbit\.png: cannot be read \(Is a directory\)"):
        load_results(target)


def test_the_summary_names_every_file_of_the_run(tmp_path: Path, runs: tuple[Path, Path]) -> None:
    put(tmp_path / "rotor", runs[0], 0)
    summary = json.loads((tmp_path / "rotor" / SUMMARY).read_text(encoding="utf-8"))
    assert sorted(summary[FILES]) == sorted((SOLUTION, *FIGURES))
