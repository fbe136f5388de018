"""Generated C: warnings of the compiler, two compilers, and the extreme cases under sanitizers."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from ballpass.derive import generate
from ballpass.runtime import load
from ballpass.runtime.native.driver_library import DRIVER
from ballpass.runtime.native.method_tables import METHOD_TABLES, method_tables
from ballpass.runtime.native.reduction_rows import REDUCTION_TABLES, reduction_tables

ROOT = Path(__file__).resolve().parents[2]
pytestmark = [
    pytest.mark.extreme,
    pytest.mark.skipif(shutil.which("gcc") is None, reason="these are claims about gcc, which is not installed"),
]

Holds = Callable[..., None]

#: Their word is the last one: they stand behind the package's own flags.
SANITIZERS = "-O0 -g1 -fsanitize=address,undefined,float-cast-overflow -fno-sanitize-recover=all"
#: A write beyond an array on the stack.
BEYOND = "{ volatile double row[4]; for (volatile int k = 0; k <= 4; k++) row[k] = 0.0; }"
#: CasADi loads its plugins in a way that AddressSanitizer refuses: the flag is taken off.
SHIM = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stddef.h>
void *dlopen(const char *file, int flags)
{
    static void *(*next)(const char *, int) = NULL;
    if (next == NULL) next = (void *(*)(const char *, int))dlsym(RTLD_NEXT, "dlopen");
    return next(file, flags & ~RTLD_DEEPBIND);
}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shipped press, generated."""
    return generate(ROOT / "scenes" / "punching_press.toml", tmp_path_factory.mktemp("c") / "punching_press")


def test_no_warnings(folder: Path, tmp_path: Path) -> None:
    """gcc -Wall -Wextra -Wconversion says nothing about driver, kernels and functions."""
    # CasADi's function interface has arguments that a function need not use
    flags = ("-std=c99", "-march=native", "-fopenmp-simd", "-Wall", "-Wextra", "-Wconversion", "-Wno-unused-parameter")
    said = ""
    (tmp_path / METHOD_TABLES).write_text(method_tables(), encoding="utf-8")
    (tmp_path / REDUCTION_TABLES).write_text(reduction_tables(), encoding="utf-8")
    for source in (*sorted(DRIVER.glob("*.c")), folder / "model.c"):
        for define in ("", "BALLPASS_SENSITIVITIES", "BALLPASS_REDUCTIONS") if source.name == "stepper.c" else ("",):
            defined = [f"-D{define}"] if define else []
            places = [f"-I{place}" for place in (folder, DRIVER, tmp_path)]
            command = ("gcc", "-fsyntax-only", *flags, *defined, *places, str(source))
            said += subprocess.run(command, capture_output=True, text=True, check=False, timeout=300).stderr
    assert not [line for line in said.splitlines() if "warning:" in line or "error:" in line]


@pytest.mark.long
def test_two_compilers(folder: Path, holds: Holds) -> None:
    """A turn of the press by gcc's code and by that of ziglang, over the largest value."""
    pytest.importorskip("ziglang", reason="the package ziglang is not installed (make compiler)")
    gcc, zig = (
        load(folder, compiler=text).simulate(cycles=1, rtol=1e-9, samples_per_cycle=500, transient=0)
        for text in ("gcc", f"{sys.executable} -m ziglang cc")
    )
    holds(float(np.max(np.abs(gcc.x - zig.x) / np.max(np.abs(gcc.x), axis=0))), 1e-13)


@cache
def _library(name: str) -> str:
    command = ("gcc", f"-print-file-name=lib{name}.so")
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


@pytest.fixture
def sanitized(tmp_path: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Runs Python with arguments such that what it compiles carries sanitizers; a report ends it."""
    if not all(Path(_library(name)).is_absolute() for name in ("asan", "ubsan")):
        pytest.skip("gcc's libasan and libubsan are not installed")
    shim, compiler = tmp_path / "shim.so", tmp_path / "cc"
    (tmp_path / "shim.c").write_text(SHIM, encoding="utf-8")
    subprocess.run(("gcc", "-shared", "-fPIC", str(tmp_path / "shim.c"), "-o", str(shim), "-ldl"), check=True)
    compiler.write_text(f'#!/bin/sh\nunset LD_PRELOAD\nexec gcc "$@" {SANITIZERS}\n', encoding="utf-8")
    compiler.chmod(0o755)
    environment = {
        **os.environ,
        "CC": str(compiler),
        "BALLPASS_CACHE_DIR": str(tmp_path / "cache"),
        "ASAN_OPTIONS": "detect_leaks=0:verify_asan_link_order=0",  # Python leaves memory to the system when it ends
        "LD_PRELOAD": ":".join((str(shim), _library("asan"), _library("ubsan"))),
    }

    def run(*arguments: str, **more: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            (sys.executable, *arguments), cwd=ROOT, env={**environment, **more}, capture_output=True, text=True,
            check=False, timeout=1800,
        )  # fmt: skip

    return run


@pytest.mark.parametrize("fault", ["", BEYOND], ids=["without", "with"])
def test_sanitizers_see_a_planted_fault(
    sanitized: Callable[..., subprocess.CompletedProcess[str]], folder: Path, tmp_path: Path, fault: str
) -> None:
    """Sanitizers report a write beyond an array that is planted in a copy of the functions, and nothing without it."""
    copy = shutil.copytree(folder, tmp_path / "punching_press")
    code = (copy / "equations.c").read_text(encoding="utf-8")
    begin = re.search(r"int rhs\([^;{}]*\)\s*\{", code)
    assert begin is not None
    (copy / "equations.c").write_text(code[: begin.end()] + fault + code[begin.end() :], encoding="utf-8")
    program = (
        "import sys\nfrom ballpass.runtime import load\nmodel = load(sys.argv[1], verify=False)\n"
        "numbers = model.numbers()\n"
        "at = {'t': 0.0, 'x': model.initial(), 'u': model.inputs_at(0.0), 'p': numbers.p, 'c': numbers.c}\n"
        "model.kernel('rhs')(at)\n"
    )
    done = sanitized("-c", program, str(copy))
    assert (done.returncode != 0) == bool(fault), done.stderr[-2000:]
    assert ("index 4 out of bounds" in done.stderr) == bool(fault), done.stderr[-2000:]


@pytest.mark.long
def test_extreme_cases_under_sanitizers(
    sanitized: Callable[..., subprocess.CompletedProcess[str]], record_property: Callable[[str, object], None]
) -> None:
    """The cases that are not long run under sanitizers without a report, but for motions beside SciPy's."""
    done = sanitized(
        "-m", "pytest", "-q", "-p", "no:cacheprovider", "-m", "extreme and not long", "tests/extremes",
        f"--ignore={Path(__file__).relative_to(ROOT)}", "-k", "not written_by_hand",
    )  # fmt: skip
    assert done.returncode == 0, (done.stdout + done.stderr)[-4000:]
    record_property("note", done.stdout.strip().splitlines()[-1])
