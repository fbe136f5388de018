"""What the tests of limits share: a cheap generated folder, a cache of their own, a compiler in a hurry."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from ballpass.derive import generate
from ballpass.derive.reading.read import scene_from_text
from ballpass.runtime.contract.folders import LOCK
from ballpass.runtime.native import compile as compiling

ROOT = Path(__file__).resolve().parents[2]
SCENES = ROOT / "scenes"


@pytest.fixture(scope="session")
def _quick_script(tmp_path_factory: pytest.TempPathFactory) -> Path:
    real = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if real is None:
        pytest.skip("needs a C compiler: the tests are about what happens to it and to what it writes")
    script = tmp_path_factory.mktemp("compiler") / "cc"
    script.write_text(f'#!/bin/sh\nexec {real} "$@" -O0\n', encoding="utf-8")
    script.chmod(0o755)
    return script


@pytest.fixture(scope="module", autouse=True)
def quick_compiler(_quick_script: Path) -> Iterator[Path]:
    """A compiler that does not optimize: what is tested here is not speed.

    Of these files alone: what the same process tests behind them is compiled as users compile it.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CC", str(_quick_script))
        yield _quick_script


@pytest.fixture(scope="session")
def _rotor_master(tmp_path_factory: pytest.TempPathFactory) -> Path:
    text = (SCENES / "varying_compliance.toml").read_text(encoding="utf-8")
    return generate(scene_from_text(text, "rotor"), tmp_path_factory.mktemp("master") / "rotor")


@pytest.fixture
def rotor(_rotor_master: Path, tmp_path: Path) -> Path:
    """A generated folder of its own: a ring with eight balls, two degrees of freedom."""
    return Path(shutil.copytree(_rotor_master, tmp_path / "rotor"))


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache folder of its own, not yet there, as a process sees it that has opened no library."""
    folder = tmp_path / "cache"
    monkeypatch.setenv(compiling.CACHE_VARIABLE, str(folder))
    monkeypatch.setattr(compiling, "_opened", {})
    return folder


@pytest.fixture(scope="session")
def kept() -> Callable[[Path], dict[str, bytes]]:
    """Content of a folder's files by their place in it, the lock aside."""

    def read(folder: Path) -> dict[str, bytes]:
        found = sorted(path for path in folder.rglob("*") if path.is_file() and path.name != LOCK)
        return {str(path.relative_to(folder)): path.read_bytes() for path in found}

    return read
