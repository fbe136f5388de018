"""Claims about processes that are killed, interrupted, or short of disk, permission or compiler.

What a process leaves is the old file or the new one, whenever it ends; what it cannot do it says, with a remedy.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import sysconfig
import textwrap
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from profiles import LONG

from ballpass.derive import generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import CacheWarning, CompileError, RequestError, Status, load, load_solution
from ballpass.runtime.app.commands import shared
from ballpass.runtime.app.commands.shared import Stages, read_own
from ballpass.runtime.contract.errors import ArtefactError
from ballpass.runtime.contract.folder import read_artefact, read_manifest
from ballpass.runtime.contract.folders import NEW, replace_files
from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.native import compile as compiling
from ballpass.runtime.native import compilers

SCENES = Path(__file__).resolve().parents[2] / "scenes"
ROTOR = (SCENES / "varying_compliance.toml").read_text(encoding="utf-8")

#: What ends within this time [s] does not wait for what lasts ten minutes; a busy machine takes a part of it.
PATIENCE = 120.0

SOURCE = "double twice(double x) { return 2.0 * x; }\n"


def python(code: str, *words: object, **options: Any) -> subprocess.Popen[str]:
    """A Python process that prints "ready" when it begins with what it is there for."""
    command = [sys.executable, "-c", textwrap.dedent(code), *map(str, words)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **options)


def killed_at_random(code: str, *words: object, kills: int, within: float) -> Iterator[None]:
    """Start such a process again and again, and kill each within a time [s] of its "ready"; yields behind each."""
    draw = random.Random(kills)
    for _ in range(200 if LONG else kills):
        with python(code, *words) as process:
            assert process.stdout is not None
            assert process.stdout.readline() == "ready\n", process.communicate()[1]
            time.sleep(draw.random() * within)
            process.kill()
            _, errors = process.communicate(timeout=300)
            assert process.returncode == -signal.SIGKILL, errors
        yield


def shown(folder: Path) -> list[str]:
    """Names in a folder without those that begin with a dot."""
    return sorted(path.name for path in folder.iterdir() if not path.name.startswith("."))


# -------------------------------------------------------------------------------------------------------------- SIGKILL

REPLACING = """
    import itertools, shutil, sys
    from pathlib import Path
    from ballpass.runtime.contract.folders import replace_files
    target, *sources = map(Path, sys.argv[1:])
    print("ready", flush=True)
    for source in itertools.cycle(sources):
        def write(made):
            for path in sorted(source.iterdir()):
                if not path.name.startswith("."):
                    shutil.copy(path, made)
        replace_files(target, write, last="manifest.json", owned=lambda: ())
"""


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Two generated folders of one name: bearings of different numbers of balls."""
    base = tmp_path_factory.mktemp("both")
    texts = (ROTOR, re.sub(r"(?m)^balls = \d+", "balls = 7", ROTOR))
    assert texts[0] != texts[1]
    one, other = (generate(scene_from_text(text, "rotor"), base / str(k)) for k, text in enumerate(texts))
    return one, other


def test_a_killed_derivation_leaves_a_whole_artefact_or_one_that_is_refused_and_mended_by_the_next(
    tmp_path: Path, both: tuple[Path, Path], kept: Callable[[Path], dict[str, bytes]]
) -> None:
    """Files are moved one by one there: what is between old and new does not pass for either."""
    target = tmp_path / "rotor"
    shutil.copytree(both[0], target)
    (target / "notes.txt").write_text("mine", encoding="utf-8")
    whole = [plain(folder) for folder in both]
    for _ in killed_at_random(REPLACING, target, *both, kills=6, within=0.04):
        found = plain(target)
        assert found.pop("notes.txt") == b"mine"
        if found not in whole:
            with pytest.raises(ArtefactError):
                read_artefact(target)
    generate(scene_from_text(ROTOR, "rotor"), target)
    assert plain(target) == {**whole[0], "notes.txt": b"mine"}


def put(target: Path, source: Path) -> None:
    """Replace the files of a generated folder by those of another."""

    def write(made: Path) -> None:
        for path in sorted(source.iterdir()):
            if not path.name.startswith("."):
                shutil.copy(path, made)

    replace_files(target, write, last="manifest.json", owned=lambda: ())


def plain(folder: Path) -> dict[str, bytes]:
    """Content of the files in a folder whose names begin with no dot."""
    return {name: (folder / name).read_bytes() for name in shown(folder)}


@pytest.mark.long
def test_a_reader_beside_a_process_that_derives_reads_one_folder(tmp_path: Path, both: tuple[Path, Path]) -> None:
    target = tmp_path / "rotor"
    shutil.copytree(both[0], target)
    allowed = [read_manifest(folder) for folder in both]
    code = REPLACING.replace("for source in", "import time\n    for source in").replace(
        "        replace_files", "        time.sleep(0.02)\n        replace_files"
    )
    with python(code, target, *both) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n", process.communicate()[1]
        try:
            for _ in range(3000 if LONG else 200):
                assert read_artefact(target) in allowed
        finally:
            process.kill()


def test_two_that_derive_into_one_folder_take_turns(
    tmp_path: Path,
    both: tuple[Path, Path],
    kept: Callable[[Path], dict[str, bytes]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Beside files of others, files are moved one by one: two derivations at once left files of both."""
    target = tmp_path / "rotor"
    shutil.copytree(both[0], target)
    (target / "notes.txt").write_text("mine", encoding="utf-8")
    second = threading.Thread(target=put, args=(target, both[1]))
    real = os.replace

    def moving(source: Path, place: Path) -> None:
        if second.ident is None and Path(place).parent == target and Path(place).name == "kernels.h":
            second.start()
            second.join(0.3)
        real(source, place)

    monkeypatch.setattr(os, "replace", moving)
    put(target, both[0])
    second.join()
    assert plain(target) == {**plain(both[1]), "notes.txt": b"mine"}


def test_a_model_whose_folder_is_written_anew_compiles_nothing_of_the_new_one(
    tmp_path: Path, both: tuple[Path, Path]
) -> None:
    """Drivers and derivatives are compiled when first asked for: of a new scene's C, and forces were 30 % wrong."""
    target = tmp_path / "rotor"
    shutil.copytree(both[0], target)
    model = load(target)
    put(target, both[1])
    calls: list[Callable[[], object]] = [
        lambda: model.stepper,
        lambda: model.reduce(cycles=0.1, transient=0),
        lambda: model.jacobian("ball.force", wrt=["bearing.clearance"], t=0.0),
        lambda: model.symbolic("rhs"),
        lambda: model.simulate(cycles=0.1, transient=0),
    ]
    for call in calls:
        with pytest.raises(ArtefactError, match=r"written anew or edited since\. Load the folder again"):
            call()
    put(target, both[0])
    again = model.simulate(cycles=0.1, transient=0)
    np.testing.assert_array_equal(again.x, load(both[0]).simulate(cycles=0.1, transient=0).x)


def test_what_is_compiled_is_what_gave_the_key(cache: Path, source: Path, tmp_path: Path) -> None:
    """A source that changed between key and compiler once left the new code in the cache under the key of the old."""
    other = tmp_path / "other.c"
    other.write_text(SOURCE.replace("2.0", "3.0"), encoding="utf-8")
    compiler = compiling.find_compiler()
    assert compiler is not None
    racing = wrapper(tmp_path, f'cp {other} {source}\nexec {compiler.command[0]} "$@"')
    racing = replace(racing, flags=compiler.flags)
    library = ctypes.CDLL(str(compiling.compile_sources((source,), racing).path))
    library.twice.restype = ctypes.c_double
    library.twice.argtypes = [ctypes.c_double]
    assert library.twice(4.0) == 8.0


def test_a_killed_compiler_leaves_no_library_or_a_whole_one(cache: Path, tmp_path: Path) -> None:
    code = """
        import sys
        from pathlib import Path
        from ballpass.runtime.native import compile as compiling
        compiler = compiling.find_compiler()
        print("ready", flush=True)
        for k in range(100):
            source = Path(sys.argv[1]) / "twice.c"
            source.write_text(f"double twice(double x) {{ return x * {k}; }}")
            compiling.compile_sources((source,), compiler)
    """
    cache.mkdir()
    for _ in killed_at_random(code, tmp_path, kills=3, within=0.4):
        for path in cache.iterdir():
            if not path.name.startswith("."):
                assert path.stem.endswith(compiling._digest(path))
    compiler = compiling.find_compiler()
    assert compiler is not None
    (tmp_path / "twice.c").write_text(SOURCE, encoding="utf-8")
    assert compiling.compile_sources((tmp_path / "twice.c",), compiler).path.exists()


@pytest.mark.long
def test_a_killed_process_leaves_the_old_solution_or_the_new_one(rotor: Path, tmp_path: Path) -> None:
    code = """
        import itertools, sys
        from ballpass.runtime import load_solution
        one, other = map(load_solution, sys.argv[2:])
        print("ready", flush=True)
        for solution in itertools.cycle((one, other)):
            solution.save(sys.argv[1])
    """
    model = load(rotor)
    runs = [model.simulate(cycles=length) for length in (0.2, 0.3)]
    places = [run.save(tmp_path / f"{k}.nc") for k, run in enumerate(runs)]
    target = tmp_path / "results" / "solution.nc"
    target.parent.mkdir()
    runs[0].save(target)
    lengths = {len(run.t) for run in runs}
    for _ in killed_at_random(code, target, *places, kills=2, within=0.3):
        assert len(load_solution(target).t) in lengths
        assert shown(target.parent) == ["solution.nc"]


# --------------------------------------------------------------------------------------------------------------- Ctrl-C


def ballpass(*words: object, cwd: Path, env: dict[str, str] | None = None, **options: Any) -> subprocess.Popen[str]:
    command = [str(Path(sysconfig.get_path("scripts")) / "ballpass"), *map(str, words)]
    return subprocess.Popen(
        command,
        cwd=cwd,
        env={**os.environ, **(env or {})},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "rotor.toml"
    path.write_text(ROTOR, encoding="utf-8")
    return path


#: Tells that the command has taken interrupts over: it imports the rest then.  Before, while Python itself starts, an
#: interrupt is Python's.
TELLING = """
import os, sys
def tell(event, words):
    if event == "import" and words[0] == "ballpass.runtime.app.cli" and "BALLPASS_BEGUN" in os.environ:
        os.write(int(os.environ.pop("BALLPASS_BEGUN")), b".")
sys.addaudithook(tell)
"""


@contextlib.contextmanager
def begun(folder: Path, *words: object, cwd: Path) -> Iterator[subprocess.Popen[str]]:
    """A command that has begun, however long the machine takes to start it."""
    folder.mkdir(exist_ok=True)
    (folder / "sitecustomize.py").write_text(TELLING, encoding="utf-8")
    places = os.pathsep.join(filter(None, (str(folder), os.environ.get("PYTHONPATH"))))
    reading, writing = os.pipe()
    try:
        env = {"PYTHONPATH": places, "BALLPASS_BEGUN": str(writing)}
        process = ballpass(*words, cwd=cwd, env=env, pass_fds=(writing,))
    finally:
        os.close(writing)
    with process, open(reading, "rb") as told:
        assert told.read(1) == b".", process.communicate()[1]
        yield process


@pytest.mark.long
def test_an_interrupt_at_any_moment_ends_with_130_and_whole_files(
    scene: Path, tmp_path: Path, both: tuple[Path, Path], kept: Callable[[Path], dict[str, bytes]]
) -> None:
    """While modules are imported as well, where Python turns an interrupt into other exceptions."""
    words = (
        "run",
        scene,
        "--cycles",
        "3",
        "--transient",
        "1",
        "--out",
        "results",
        *(() if LONG else ("--no-figures",)),
    )
    with ballpass(*words, cwd=tmp_path) as process:
        out, errors = process.communicate(timeout=300)
    assert process.returncode == 0, errors
    old = kept(tmp_path / "results")
    draw = random.Random(3)
    for k in range(100 if LONG else 3):
        if k % 3 == 0:
            shutil.copytree(both[1], tmp_path / "generated" / "rotor", dirs_exist_ok=True)  # stale: derived anew
        with begun(tmp_path / "site", *words, cwd=tmp_path) as process:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(3.0 * draw.random())
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
            out, errors = process.communicate(timeout=PATIENCE)
        assert process.returncode in (0, 130), errors
        assert "Traceback" not in errors
        if process.returncode == 130:
            assert "interrupted. Files written so far are complete." in errors
            assert out == ""
        found = kept(tmp_path / "results")
        assert set(found) == set(old)
        load_solution(tmp_path / "results" / "solution.nc")
        read_artefact(tmp_path / "generated" / "rotor")
        assert not [*tmp_path.rglob(f"{NEW}*"), *tmp_path.rglob(".*.tmp")]


#: A command line in which an interrupt comes where Python turns it into something else.
ELSEWHERE = """
import os, signal, sys, time, types

def interrupt(*_):
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(0.1)

def destroyed():
    type("Short", (), {"__del__": interrupt})()
    time.sleep(60.0)

def named():  # another fault, a RuntimeError
    type("Owner", (), {"part": type("Part", (), {"__set_name__": interrupt})()})

def refused():  # as a package that takes what an import says for its absence
    try:
        interrupt()
    except KeyboardInterrupt:
        sys.exit(2)

def done():
    try:
        interrupt()
    except KeyboardInterrupt:
        sys.exit(0)

cli = types.ModuleType("ballpass.runtime.app.cli")
cli.app = globals()[sys.argv[1]]
sys.modules[cli.__name__] = cli
from ballpass.runtime.app.entry import main
main()
"""


@pytest.mark.parametrize(("where", "code"), [("destroyed", 130), ("named", 130), ("refused", 130), ("done", 0)])
def test_an_interrupt_that_python_turns_into_something_else_is_one(where: str, code: int) -> None:
    found = subprocess.run([sys.executable, "-c", ELSEWHERE, where], capture_output=True, text=True, timeout=PATIENCE)
    assert found.returncode == code, found.stderr
    assert found.stderr == ("error: interrupted. Files written so far are complete.\n" if code else "")


@pytest.mark.long
def test_an_interrupt_while_compiling_ends_the_compiler_and_its_children(
    cache: Path, scene: Path, tmp_path: Path
) -> None:
    script, note = tmp_path / "slow-cc", tmp_path / "child"
    script.write_text(
        f'#!/bin/sh\nfor word; do if [ "$word" = -o ]; then sleep 600 & echo $! > {note}; wait; fi; done\necho 1\n',
        encoding="utf-8",
    )
    script.chmod(0o755)
    with ballpass("run", scene, cwd=tmp_path, env={"CC": str(script)}) as process:
        while not (note.exists() and note.read_text().strip()):
            assert process.poll() is None, process.communicate()[1]
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=PATIENCE)  # of the compiler's ten minutes
    assert process.returncode == 130
    assert "interrupted" in errors
    assert gone(int(note.read_text()))
    assert [path.name for path in cache.iterdir()] == ["written"]  # of the folder that was derived
    assert not (tmp_path / "results").exists()


def test_an_interrupt_while_the_compiler_starts_ends_it_too(
    source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The system has started it and Python has not said so yet: a busy machine makes that long."""
    begun: list[int] = []

    class Slow(subprocess.Popen):  # type: ignore[type-arg]
        def __init__(self, *words: Any, **options: Any) -> None:
            super().__init__(*words, **options)
            begun.append(self.pid)
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(subprocess, "Popen", Slow)
    with pytest.raises(KeyboardInterrupt):
        compiling.compile_sources((source,), wrapper(tmp_path, "exec sleep 600"))
    assert len(begun) == 1
    assert gone(begun[0])


def gone(process: int) -> bool:
    """Whether a process of ten minutes that is no child of this one has ended, or was ended and soon does."""
    for _ in range(2000):
        try:
            name, _, rest = Path(f"/proc/{process}/stat").read_text(encoding="utf-8").rpartition(")")
        except (FileNotFoundError, ProcessLookupError):
            return True
        if rest.split()[0] in ("Z", "X") or not name.endswith("(sleep"):  # another has its number
            return True
        time.sleep(0.01)
    return False


# ------------------------------------------------------------------------------------------------------------ compilers


def wrapper(folder: Path, text: str) -> compiling.Compiler:
    script = folder / "strange-cc"
    script.write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
    script.chmod(0o755)
    return compiling.Compiler(command=(str(script),), flags=(), identity=text)


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "twice.c"
    path.write_text(SOURCE, encoding="utf-8")
    return path


def test_a_compiler_whose_child_hangs_is_stopped_with_its_child(
    cache: Path, source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """gcc is a driver that starts the real one: ending gcc alone left that one, and waited for it without end."""
    note = tmp_path / "child"
    compiler = wrapper(tmp_path, f"sleep 600 &\necho $! > {note}.new && mv {note}.new {note}\nwait")
    for patience in (0.3, 3.0, 30.0):  # until it has come so far as to start its child
        monkeypatch.setattr(compilers, "TIMEOUT", patience)
        monkeypatch.setattr(os, "getloadavg", lambda: (0.1, 0.1, 0.1))
        said = rf"(?s)did not finish within {patience:g} s.*Nothing was written.*set CC"
        begun = time.perf_counter()
        with pytest.raises(CompileError, match=said) as caught:
            compiling.compile_sources((source,), compiler)
        assert time.perf_counter() - begun < PATIENCE  # of the child's ten minutes
        assert "strange-cc" in str(caught.value)
        if note.exists():
            break
    assert gone(int(note.read_text()))
    assert not list(cache.iterdir())


def test_a_compiler_has_longer_on_a_busy_machine(
    cache: Path, source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compilers, "TIMEOUT", 0.1)
    monkeypatch.setattr(os, "getloadavg", lambda: (4.0 * (os.cpu_count() or 1), 0.0, 0.0))
    with pytest.raises(CompileError, match=r"(?s)within 0\.4 s, 4 times as long as on an idle machine.*less else runs"):
        compiling.compile_sources((source,), wrapper(tmp_path, "sleep 60"))


def test_a_compiler_that_does_not_tell_its_version_is_refused_in_words(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compilers, "ANSWER_TIMEOUT", 0.3)
    command = wrapper(tmp_path, "sleep 60").command[0]
    with pytest.raises(CompileError, match=r"(?s)did not answer within 0\.3 s.*strange-cc --version.*set CC"):
        compilers.find_compiler(command)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("exit 0", "ended well, but what it wrote cannot be loaded"),
        ('for word; do out=$last; last=$word; done; echo text > "$out"; exit 0', "cannot be loaded"),
        ("echo out of order >&2; exit 3", r"failed with exit code 3.*out of order.*Nothing was written"),
        ("kill -SEGV $$", r"failed with exit code -11.*\(no output\).*Nothing was written"),
    ],
)
def test_a_compiler_that_fails_quietly_or_loudly_leaves_nothing(
    cache: Path, source: Path, tmp_path: Path, text: str, words: str
) -> None:
    """One that ends well without writing anything once left a library of no bytes in the cache, for good."""
    with pytest.raises(CompileError, match=f"(?s){words}.*set CC"):
        compiling.compile_sources((source,), wrapper(tmp_path, text))
    assert not list(cache.iterdir())


@pytest.mark.parametrize("command", ["'", " ", "no-such-compiler", "/", "cc\0x"])
def test_a_command_that_is_none_is_a_wrong_request(rotor: Path, command: str) -> None:
    with pytest.raises(RequestError, match="Give the command of a C compiler"):
        load(rotor, compiler=command)


@pytest.mark.long
def test_without_any_program_on_the_path_the_model_runs_in_the_virtual_machine(scene: Path, tmp_path: Path) -> None:
    words = ("run", scene, "--cycles", "2", "--transient", "1", "--json", "--no-figures")
    env = {"PATH": str(tmp_path / "nothing"), "CC": "", "PYTHONPATH": str(tmp_path)}
    # a compiler from PyPI would be found without a path
    (tmp_path / "sitecustomize.py").write_text("import sys; sys.modules['ziglang'] = None\n", encoding="utf-8")
    with ballpass(*words, cwd=tmp_path, env=env) as process:
        out, errors = process.communicate(timeout=300)
    assert process.returncode == 0, errors
    assert "No C compiler was found" in errors
    assert '"compiled": false' in out


def test_two_processes_on_one_cold_cache_both_get_the_right_library(cache: Path, rotor: Path) -> None:
    code = """
        import sys
        from ballpass.runtime import load
        print(load(sys.argv[1]).simulate(cycles=0.2).x.tobytes().hex())
    """
    running = [python(code, rotor) for _ in range(2)]
    answers = [process.communicate(timeout=300) for process in running]
    assert [process.returncode for process in running] == [0, 0], answers
    assert answers[0][0] == answers[1][0] != ""
    assert not [path for path in cache.iterdir() if path.name.startswith(".")]


# -------------------------------------------------------------------------------------------------- disk and permission


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A folder on a disk of 200 kB."""
    place = tmp_path / "disk"
    place.mkdir()
    if os.geteuid() != 0:
        pytest.skip("only the superuser may mount a small disk; the limit of a file's size is tested for everybody")
    command = ["mount", "-t", "tmpfs", "-o", "size=200k", "tmpfs", str(place)]
    if subprocess.run(command, capture_output=True, check=False).returncode != 0:
        pytest.skip("this machine does not let a test mount a small disk")
    yield place
    subprocess.run(["umount", str(place)], check=True)


def full(folder: Path) -> None:
    with contextlib.suppress(OSError), (folder / "ballast").open("wb") as stream:
        while True:
            stream.write(b"\0" * 1024)
            stream.flush()


def test_a_full_disk_leaves_the_old_solution_and_says_so(rotor: Path, small_disk: Path) -> None:
    """HDF5 that cannot write ends the process when it closes the file: it writes to memory here."""
    run = load(rotor).simulate(cycles=0.02)
    run.save(small_disk / "solution.nc")
    before = (small_disk / "solution.nc").read_bytes()
    with pytest.raises(RequestError, match=r"cannot be written \(No space left on device\); a file that was there"):
        load(rotor).simulate(cycles=3).save(small_disk / "solution.nc")
    assert (small_disk / "solution.nc").read_bytes() == before
    assert [path.name for path in small_disk.iterdir()] == ["solution.nc"]


@pytest.mark.parametrize(
    "what", ["results", *(pytest.param(name, marks=pytest.mark.long) for name in ("cache", "generated"))]
)
def test_a_full_disk_is_told_with_a_remedy_and_leaves_no_halves(
    scene: Path, tmp_path: Path, small_disk: Path, what: str
) -> None:
    full(small_disk)
    place = small_disk / what
    env = {"BALLPASS_CACHE_DIR": str(place)} if what == "cache" else {}
    (tmp_path / "here").mkdir()
    words: tuple[object, ...] = ("run", scene, "--cycles", "2", "--transient", "1", "--no-figures")
    words = {"cache": words, "generated": ("derive", scene, "--out", place), "results": (*words, "--out", place)}[what]
    with ballpass(*words, cwd=tmp_path / "here", env=env) as process:
        out, errors = process.communicate(timeout=300)
    assert process.returncode == (1 if what == "cache" else 2), errors
    assert out == ""
    assert "Traceback" not in errors
    assert "space" in errors
    assert not (tmp_path / "here" / "results").exists()
    # the record of a written folder is an empty file, which a full disk takes
    assert [path for path in small_disk.rglob("*") if path.is_file() and path.stat().st_size] == [
        small_disk / "ballast"
    ]


def test_a_limit_of_file_size_is_told_and_the_old_solution_stays(rotor: Path, tmp_path: Path) -> None:
    solution = load(rotor).simulate(cycles=0.2)
    target = solution.save(tmp_path / "results.nc")
    before = target.read_bytes()
    code = """
        import resource, sys
        from ballpass.runtime import load_solution
        from ballpass.runtime.contract.errors import RequestError
        solution = load_solution(sys.argv[1])
        resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
        try:
            solution.save(sys.argv[1])
        except RequestError as fault:
            print(fault)
    """
    with python(code, target) as process:
        out, errors = process.communicate(timeout=300)
    assert process.returncode == 0, errors
    assert "cannot be written (File too large); a file that was there is as it was. Give a folder" in out
    assert target.read_bytes() == before
    assert shown(tmp_path) == ["results.nc", "rotor"]


@pytest.fixture
def read_only(tmp_path: Path) -> Iterator[Path]:
    """A folder that cannot be written, by the superuser either."""
    place = tmp_path / "locked"
    place.mkdir()
    if os.geteuid() != 0:
        place.chmod(0o555)
        yield place
        place.chmod(0o755)
        return
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "ro", "tmpfs", str(place)], check=False).returncode != 0:
        pytest.skip("the superuser may write everywhere, and this machine does not let a test mount a read-only disk")
    yield place
    subprocess.run(["umount", str(place)], check=True)


@pytest.mark.long
@pytest.mark.parametrize(
    "words",
    [
        ("run", "--out"),
        *(pytest.param(w, marks=pytest.mark.long) for w in (("derive", "--out"), ("export", "--c", "--out"))),
    ],
    ids=lambda words: words[0],
)
def test_a_read_only_folder_is_told_with_a_remedy(
    scene: Path, tmp_path: Path, read_only: Path, words: tuple[str, ...]
) -> None:
    (tmp_path / "here").mkdir()
    with ballpass(words[0], scene, *words[1:], read_only / "x", cwd=tmp_path / "here") as process:
        out, errors = process.communicate(timeout=300)
    assert process.returncode == 2, errors
    assert out == ""
    assert "Traceback" not in errors
    assert str(read_only) in errors
    assert "permissions" in errors or "Give another" in errors


def test_a_read_only_cache_warns_and_names_the_folder_that_is_taken_instead(
    read_only: Path, source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compiling, "_opened", {})
    monkeypatch.setenv(compiling.CACHE_VARIABLE, str(read_only))
    compiler = compiling.find_compiler()
    assert compiler is not None
    with pytest.warns(CacheWarning, match=r"cannot be written .* this time into (\S+),.*BALLPASS_CACHE_DIR") as caught:
        library = compiling.compile_sources((source,), compiler)
    assert str(library.path.parent) in str(caught[0].message)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert compiling.compile_sources((source,), compiler).path == library.path  # of this process, not once more


@pytest.mark.long
def test_a_home_that_cannot_be_written_is_a_warning(scene: Path, tmp_path: Path) -> None:
    env = {"HOME": "/dev/null", "XDG_CACHE_HOME": "", "BALLPASS_CACHE_DIR": ""}
    words = ("run", scene, "--cycles", "2", "--transient", "1", "--json", "--no-figures")
    with ballpass(*words, cwd=tmp_path, env=env) as process:
        out, errors = process.communicate(timeout=300)
    assert process.returncode == 0, errors
    assert "/dev/null/.cache/ballpass cannot be written" in errors
    assert "this time into" in errors
    assert '"compiled": true' in out


def test_no_folder_at_all_to_compile_in_is_refused_in_words(
    source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def nowhere(*_: object, **__: object) -> str:
        raise FileNotFoundError(2, "No usable temporary directory found")

    (tmp_path / "file").touch()
    monkeypatch.setattr(compiling, "_opened", {})
    monkeypatch.setenv(compiling.CACHE_VARIABLE, str(tmp_path / "file" / "cache"))
    compiling._private_folder.cache_clear()
    monkeypatch.setattr(compiling.tempfile, "mkdtemp", nowhere)
    compiler = compiling.find_compiler()
    assert compiler is not None
    with pytest.raises(RequestError, match=r"Neither the cache .* nor a temporary folder .*BALLPASS_CACHE_DIR"):
        compiling.compile_sources((source,), compiler)


@pytest.mark.long
def test_a_relative_cache_folder_is_found_from_wherever_the_process_goes(
    rotor: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compiling, "_opened", {})
    monkeypatch.setenv(compiling.CACHE_VARIABLE, "cache")
    monkeypatch.chdir(tmp_path)
    model = load(rotor)
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert np.isfinite(model.simulate(cycles=0.05).x).all()


# --------------------------------------------------------------------------------------------------- paths, equal names

#: Loads a scene again and again as commands do, and prints how often the numbers were another scene's.
LOADING = """
    import sys
    from pathlib import Path
    from ballpass.runtime.app.commands.load_scene import read_asked
    from ballpass.runtime.app.commands.shared import load_model

    print("ready", flush=True)
    wrong = 0
    for _ in range(int(sys.argv[3])):
        scene = Path(sys.argv[1])
        model = load_model(scene, lambda name: None, "none", integrated=read_asked(scene, None)[0].integrated)
        wrong += abs(model.parameters["bearing.clearance"] - float(sys.argv[2])) > 1e-12
    print(wrong)
"""


def with_clearance(folder: Path, micrometres: int) -> Path:
    folder.mkdir()
    path = folder / "rotor.toml"
    path.write_text(ROTOR.replace('clearance = "0 um"', f'clearance = "{micrometres} um"'), encoding="utf-8")
    return path


@pytest.mark.long
def test_a_scene_of_the_same_name_written_between_deriving_and_loading_is_not_taken_for_ones_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(shared, "ATTEMPTS", 4)
    mine, other = (with_clearance(tmp_path / str(k), k) for k in (1, 2))
    others = [1, 2, 3]

    def read(folder: Path, own: bool) -> Manifest:
        assert own
        if others:  # the other process was faster
            others.pop()
            generate(other)
        return read_artefact(folder)

    found = read_own(mine, cast(Stages, lambda name: None), read, lambda manifest: manifest)
    assert not others
    assert {info.name: info.default for info in found.parameters}["bearing.clearance"] == 1e-6
    with pytest.raises(RequestError, match="other processes keep writing another scene of the name rotor"):
        read_own(mine, cast(Stages, lambda name: None), lambda _, own: read_artefact(generate(other)), lambda m: m)


@pytest.mark.long
def test_many_processes_with_scenes_of_one_name_and_different_numbers_each_get_their_own(tmp_path: Path) -> None:
    processes = [
        python(LOADING, with_clearance(tmp_path / str(k), k), f"{k}e-6", 40, cwd=tmp_path) for k in range(1, 7)
    ]
    for process in processes:
        out, errors = process.communicate(timeout=600)
        assert out.split() == ["ready", "0"], errors


@pytest.fixture
def odd(tmp_path: Path) -> Path:
    """A folder whose name is no UTF-8."""
    folder = tmp_path / os.fsdecode(b"odd\xff")
    try:
        folder.mkdir()
    except OSError:
        pytest.skip("this file system has names in UTF-8 only")
    return folder


def test_what_is_derived_does_not_depend_on_the_path(scene: Path, rotor: Path, odd: Path) -> None:
    """CasADi writes nothing where a path is not UTF-8, in part in silence."""
    plain = dict(read_artefact(generate(scene, odd.parent / "plain")).files)
    assert dict(read_artefact(generate(scene, odd / "rotor")).files) == plain
    assert load(odd / "rotor").simulate(duration=0.001).status is Status.DONE


def test_a_cache_whose_path_is_not_utf_8_warns_and_another_folder_is_taken(
    odd: Path, source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compiling, "_opened", {})
    monkeypatch.setenv(compiling.CACHE_VARIABLE, str(odd / "cache"))
    compiler = compiling.find_compiler()
    assert compiler is not None
    with pytest.warns(CacheWarning, match="its path is not UTF-8"):
        assert compiling.compile_sources((source,), compiler).path.is_file()
    assert list(odd.iterdir()) == []
