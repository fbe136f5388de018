"""Fixtures shared by the suite: scenes of the repository, generated and compiled once per test process."""

from __future__ import annotations

import gc
import hashlib
import os
import shutil
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from importlib import import_module
from pathlib import Path

import pytest
from filelock import FileLock
from hypothesis import HealthCheck, settings
from typer.testing import CliRunner, Result
from virtual import virtual_model

from ballpass.derive import generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime import Model, load
from ballpass.runtime.app.cli import app

ROOT = Path(__file__).resolve().parent.parent

# The same examples on every run and on every machine, however slow it is; BALLPASS_LONG=1 draws others each time.
settings.register_profile(
    "repeatable",
    derandomize=not os.environ.get("BALLPASS_LONG"),
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("repeatable")

# What `make -j2 test` tells the makes below it, which they warn about, and what makes programs colour or wrap what they
# print to a file: the tests see what a user's shell shows.  Here, for typer looks when it is imported.
for _name in (
    *("MAKEFLAGS", "MFLAGS", "GNUMAKEFLAGS", "MAKELEVEL", "MAKEOVERRIDES"),
    *("COLUMNS", "LINES", "TERMINAL_WIDTH", "FORCE_COLOR", "CLICOLOR_FORCE", "PY_COLORS", "GITHUB_ACTIONS"),
):
    os.environ.pop(_name, None)


#: Names a folder whose compiled models several runs of the suite share, all compiled as those of the quick tests.
SHARED = "BALLPASS_TESTS_SHARE"


def _shared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder that the processes of a run share."""
    if SHARED in os.environ:
        return Path(os.environ[SHARED])
    place = tmp_path_factory.getbasetemp()
    return place.parent if "PYTEST_XDIST_WORKER" in os.environ else place


@pytest.fixture(scope="session", autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Compiled models of the suite stay out of the user's cache folder; the processes of one run share theirs."""
    cache = _shared(tmp_path_factory) / "compiled"
    cache.mkdir(exist_ok=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("BALLPASS_CACHE_DIR", str(cache))
        yield


@pytest.fixture(scope="session", autouse=True)
def _quick_compiler(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Half of the suite's time would go into gcc -O3: without the long tests, which run what users run, -Og does."""
    real = shutil.which("cc")
    quick = request.config.option.markexpr == "not long and not extreme" or SHARED in os.environ
    if real is None or "CC" in os.environ or not quick:
        yield
        return
    script = _shared(tmp_path_factory) / "cc"
    with FileLock(f"{script}.lock"):
        if not script.exists():
            script.write_text(f'#!/bin/sh\nexec {real} "$@" -Og\n', encoding="utf-8")
            script.chmod(0o755)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CC", str(script))
        yield


def pytest_collection_finish() -> None:
    """Thousands of tests and what they import stay: the collector of garbage need not go through them each time."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def _fonts_known() -> None:
    """matplotlib looks for fonts once in an account, and says so on stderr where that takes long: not within a test."""
    import_module("matplotlib.font_manager")


@pytest.fixture(scope="session", autouse=True)
def interrupts_heard() -> Iterator[None]:
    """Processes started by these tests hear interrupts, also where the tests run in a shell's background, which ignores
    them and has its children ignore them."""
    before = signal.getsignal(signal.SIGINT)
    if before is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="session")
def scene_text() -> Callable[..., str]:
    """Text of a shipped scene with replacements, each of which must apply."""

    def text(name: str, *changes: tuple[str, str]) -> str:
        out = (ROOT / "scenes" / f"{name}.toml").read_text(encoding="utf-8")
        for old, new in changes:
            assert old in out, f"{old!r} is not in {name}"
            out = out.replace(old, new)
        return out

    return text


@contextmanager
def _place(tmp_path_factory: pytest.TempPathFactory, text: str, name: str) -> Iterator[Path]:
    """Folder of a scene that the processes of a run derive once."""
    folder = _shared(tmp_path_factory) / "generated" / hashlib.sha256(text.encode()).hexdigest()[:16] / name
    folder.parent.mkdir(parents=True, exist_ok=True)
    with FileLock(f"{folder.parent}.lock"):
        yield folder


@pytest.fixture(scope="session")
def model_of(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Model]:
    """Model of a scene's text, generated and compiled once."""

    @cache
    def make(text: str, name: str = "scene") -> Model:
        with _place(tmp_path_factory, text, name) as folder:
            return load(generate(scene_from_text(text, name), folder))

    return make


@pytest.fixture(scope="session")
def make_model(model_of: Callable[..., Model], scene_text: Callable[..., str]) -> Callable[..., Model]:
    """Model of a shipped scene with replacements, generated and compiled once."""
    return lambda name, *changes: model_of(scene_text(name, *changes), name)


@pytest.fixture(scope="session")
def make_virtual(tmp_path_factory: pytest.TempPathFactory, scene_text: Callable[..., str]) -> Callable[..., Model]:
    """Model of a shipped scene with replacements, generated once and run by CasADi's virtual machine."""

    @cache
    def make(name: str, *changes: tuple[str, str]) -> Model:
        text = scene_text(name, *changes)
        with _place(tmp_path_factory, text, name) as folder:
            return virtual_model(text, folder)

    return make


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A working directory of a module of tests, where its scenes are derived once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder := tmp_path_factory.mktemp("site"))
        yield folder


@pytest.fixture(scope="module")
def ballpass(site: Path) -> Callable[..., Result]:
    """The command in this process, called in that directory."""

    def call(*words: str | Path) -> Result:
        return CliRunner().invoke(app, [*map(str, words)])

    return call


@pytest.fixture
def boundless(monkeypatch: pytest.MonkeyPatch) -> Callable[[Model], Model]:
    """Lets a model take numbers that no scene may have, such as a negative damping: the surest way to diverge."""

    def lift(model: Model) -> Model:
        free = (replace(info, above=None, least=None, most=None, below=None) for info in model.manifest.parameters)
        monkeypatch.setattr(model, "manifest", replace(model.manifest, parameters=tuple(free), relations=()))
        return model

    return lift
