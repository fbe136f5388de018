"""Cases of generated C: compiler's warnings, sanitizers over runs of the tour, and two compilers against each other."""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

import numpy as np

from extremes.case import Case, Finding
from extremes.models import DAMPING, ROOT, SHIPPED_DAMPING, text_of
from raceway.derive import generate
from raceway.derive.read import scene_from_text
from raceway.runtime import load
from raceway.runtime.compiled.export import export_c
from raceway.runtime.integrate.stepper import DRIVER

GROUP = "Generated C"
#: CasADi's function interface has arguments that a function need not use.
WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Wno-unused-parameter")
SANITIZERS = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-fno-omit-frame-pointer", "-g", "-O1")

#: Runs of the exported program under sanitizers: damping law, and arguments.
RUNS = (
    ("one-sided", ("--cycles", "2")),
    ("one-sided", ("--cycles", "1", "mechanism.driver.speed=6283")),
    ("one-sided", ("--cycles", "1", "bearing.clearance=-30e-6")),
    ("one-sided", ("--cycles", "1", "bearing.clearance=1e-3", "mechanism.forces.punch.force.y=1e6")),
    ("one-sided", ("--cycles", "1", "bearing.outer_ring.mass=1e-6")),
    ("one-sided", ("--cycles", "1", "bearing.outer_ring.stiffness=0")),
    ("one-sided", ("--cycles", "1", "bearing.initial.inner.y=-205e-6")),
    ("one-sided", ("--cycles", "1", "bearing.damping.ratio=0.25e-3")),
    ("one-sided", ("--duration", "0.1", "mechanism.driver.speed=0")),
    ("one-sided", ("--cycles", "1", "mechanism.forces.punch.window.end=4.136430327226561")),
    ("one-sided", ("--cycles", "1", "mechanism.bodies.crank.points.B=0.09999")),
    # these two end early, with a status
    ("one-sided", ("--cycles", "1", "bearing.outer_ring.damping=-1e5")),
    ("one-sided", ("--cycles", "1", "mechanism.forces.punch.force.y=1e300")),
    ("two-sided-gated", ("--cycles", "2")),
    ("two-sided-gated", ("--cycles", "1", "bearing.damping.ratio=0.25e-3", "bearing.outer_ring.mass=1e-3")),
    *(("tangent", ("--cycles", "1", "--method", method)) for method in ("rodas4", "rodas5p", "dp54", "dop853")),
)


def _scene(law: str, folder: Path) -> Path:
    """Generated folder of the press with a law."""
    text = text_of("punching_press", (SHIPPED_DAMPING, DAMPING[law]))
    return generate(scene_from_text(text, "punching_press"), folder / law / "punching_press")


def _call(*command: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command, capture_output=True, text=True, check=False, timeout=900, env={**os.environ, **environment}
    )


def compiler_warnings() -> Finding:
    """Lines that gcc says about driver, kernels and functions."""
    with tempfile.TemporaryDirectory(prefix="raceway-extremes-") as name:
        folder = _scene("one-sided", Path(name))
        lines: list[str] = []
        # a driver's source that needs further generated headers includes them itself
        sources = [*sorted(DRIVER.glob("*.c")), folder / "model.c"]
        for source in sources:
            for define in ((), ("-DRACEWAY_SENSITIVITIES",), ("-DRACEWAY_REDUCTIONS",)):
                if define and source.name != "stepper.c":
                    continue
                said = _call("gcc", "-fsyntax-only", "-std=c99", "-fopenmp-simd", *WARNINGS, *define, f"-I{folder}",
                             f"-I{DRIVER}", str(source)).stderr  # fmt: skip
                lines += [line for line in said.splitlines() if "warning:" in line or "error:" in line]
        program = export_c(folder, Path(name) / "program")
        for source in sorted(program.glob("*.c")):
            said = _call(
                "gcc", "-fsyntax-only", "-std=c99", "-fopenmp-simd", *WARNINGS, f"-I{program}", str(source)
            ).stderr
            lines += [line for line in said.splitlines() if "warning:" in line or "error:" in line]
    assert not lines, "\n".join(lines)
    return Finding(status="done", error=0.0, bound=0.0, note=f"{len(sources)} sources and the exported program")


def sanitized_program(laws: tuple[str, ...]) -> Finding:
    """Runs of the exported program with AddressSanitizer and UndefinedBehaviorSanitizer."""
    ended: dict[int, int] = {}
    with tempfile.TemporaryDirectory(prefix="raceway-extremes-") as name:
        for law in laws:
            program = export_c(_scene(law, Path(name)), Path(name) / law / "program")
            built = program / "checked"
            sources = [str(path) for path in sorted(program.glob("*.c"))]
            done = _call("gcc", "-std=c99", *SANITIZERS, f"-I{program}", *sources, "-o", str(built), "-lm")
            assert done.returncode == 0, done.stderr
            for arguments in (arguments for of, arguments in RUNS if of == law):
                run = _call(str(built), "--samples", "50", *arguments)
                assert run.returncode in (0, 1), (law, arguments, run.returncode, run.stderr[-2000:])
                assert "Sanitizer" not in run.stderr, run.stderr[-2000:]
                assert "runtime error" not in run.stderr, run.stderr[-2000:]
                ended[run.returncode] = ended.get(run.returncode, 0) + 1
    return Finding(
        status="done", error=0.0, bound=0.0, note=f"{ended.get(0, 0)} runs done, {ended.get(1, 0)} ended with a status"
    )


#: CasADi loads its plugins in a way that AddressSanitizer refuses; the flag it dislikes is taken off on the way.
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
#: Cases whose drivers (single runs, reductions, all methods) run under sanitizers inside Python.
SANITIZED_WORDS = (
    "60 000 rpm", "punch 1 MN", "outer ring 1 mg", "clearance 1 mm", "penetration", "window over",
    "start at 1e200", "overflow", "momentum over a turn, shipped",
)  # fmt: skip


def sanitized_tour() -> Finding:
    """Cases of the tour in a Python whose generated code and drivers carry the sanitizers."""
    libraries = [_call("gcc", f"-print-file-name=lib{name}.so").stdout.strip() for name in ("asan", "ubsan")]
    with tempfile.TemporaryDirectory(prefix="raceway-extremes-") as name:
        source, shim = Path(name) / "shim.c", Path(name) / "shim.so"
        source.write_text(SHIM, encoding="utf-8")
        built = _call("gcc", "-shared", "-fPIC", str(source), "-o", str(shim), "-ldl")
        assert built.returncode == 0, built.stderr
        done = subprocess.run(
            (sys.executable, "-m", "extremes", "--list-only", "--quick", *SANITIZED_WORDS),
            cwd=ROOT, capture_output=True, text=True, check=False, timeout=1800,
            env={
                **os.environ,
                "CC": "gcc -fsanitize=address,undefined -fno-sanitize-recover=undefined",
                "RACEWAY_CACHE_DIR": str(Path(name) / "cache"),
                "ASAN_OPTIONS": "detect_leaks=0:verify_asan_link_order=0",
                "LD_PRELOAD": ":".join((str(shim), *libraries)),
            },
        )  # fmt: skip
    assert done.returncode == 0, (done.stdout[-3000:], done.stderr[-3000:])
    assert "runtime error" not in done.stderr, done.stderr[-3000:]
    count = len(re.findall(r"^ok", done.stdout, re.MULTILINE))
    assert count >= len(SANITIZED_WORDS), done.stdout
    return Finding(status="done", error=0.0, bound=0.0, note=f"{count} cases")


def zig() -> tuple[str, ...] | None:
    """Command of the ziglang wheel's compiler: of this Python, or of the one that $ZIGLANG_PYTHON names."""
    other = os.environ.get("ZIGLANG_PYTHON")
    if other:
        return (other, "-m", "ziglang", "cc")
    return (sys.executable, "-m", "ziglang", "cc") if importlib.util.find_spec("ziglang") is not None else None


def compilers() -> Finding:
    """A turn of the press by gcc's code and by that of ziglang."""
    command = zig()
    if command is None:
        return Finding(status="skipped: the package ziglang is not installed")
    if shutil.which("gcc") is None:
        return Finding(status="skipped: no gcc")
    with tempfile.TemporaryDirectory(prefix="raceway-extremes-") as name:
        folder = _scene("one-sided", Path(name))
        gcc, other = (
            load(folder, compiler=text).simulate(cycles=1, rtol=1e-9, samples_per_cycle=500, transient=0)
            for text in ("gcc", " ".join(command))
        )
    size = np.max(np.abs(gcc.x), axis=0)
    error = float(np.max(np.abs(gcc.x - other.x) / size))
    return Finding(status="done", error=error, bound=1e-13)


def cases() -> list[Case]:
    """All of this section."""
    return [
        Case(group=GROUP, name="-Wall -Wextra -Wconversion", method="gcc", against="no warning of ours",
             run=compiler_warnings, quick=True),
        Case(group=GROUP, name="exported program, shipped law", method="ASan, UBSan", against="no report",
             run=partial(sanitized_program, ("one-sided",)), quick=True),
        Case(group=GROUP, name="exported program, other laws", method="ASan, UBSan", against="no report",
             run=partial(sanitized_program, ("two-sided-gated", "tangent"))),
        Case(group=GROUP, name="cases of the tour inside Python", method="ASan, UBSan", against="no report",
             run=sanitized_tour),
        Case(group=GROUP, name="gcc and ziglang", method="stepper", against="each other, over the largest value",
             run=compilers),
    ]  # fmt: skip
