"""Cases of generated C: compiler's warnings, sanitizers over runs of the exported program, two compilers.

The tour itself under sanitizers is in `sanitized`.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

import numpy as np

from ballpass.derive import generate
from ballpass.derive.scene.read import scene_from_text
from ballpass.runtime import load
from ballpass.runtime.export.c_program import export_c
from ballpass.runtime.native.driver_library import DRIVER
from extremes.case import Case, Finding
from extremes.models import DAMPING, SHIPPED_DAMPING, text_of

GROUP = "Generated C"
#: CasADi's function interface has arguments that a function need not use.
WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Wno-unused-parameter")
SANITIZERS = (
    "-fsanitize=address,undefined,float-cast-overflow",
    "-fno-sanitize-recover=all",
    "-fno-omit-frame-pointer",
    "-g",
    "-O1",
)

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
    ("one-sided", ("--cycles", "1", "bearing.initial.inner.y=1e200")),
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
    with tempfile.TemporaryDirectory(prefix="ballpass-extremes-") as name:
        folder = _scene("one-sided", Path(name))
        lines: list[str] = []
        # a driver's source that needs further generated headers includes them itself
        sources = [*sorted(DRIVER.glob("*.c")), folder / "model.c"]
        for source in sources:
            for define in ((), ("-DBALLPASS_SENSITIVITIES",), ("-DBALLPASS_REDUCTIONS",)):
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
    with tempfile.TemporaryDirectory(prefix="ballpass-extremes-") as name:
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
    with tempfile.TemporaryDirectory(prefix="ballpass-extremes-") as name:
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
        Case(group=GROUP, name="exported program, shipped law", method="sanitizers", against="no report",
             run=partial(sanitized_program, ("one-sided",)), quick=True),
        Case(group=GROUP, name="exported program, other laws", method="sanitizers", against="no report",
             run=partial(sanitized_program, ("two-sided-gated", "tangent"))),
        Case(group=GROUP, name="gcc and ziglang", method="stepper", against="each other, over the largest value",
             run=compilers),
    ]  # fmt: skip
