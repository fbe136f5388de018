"""The tour under sanitizers: every case inside a Python whose generated code and drivers carry them.

AddressSanitizer and UndefinedBehaviorSanitizer, and float-cast-overflow with them; not float-divide-by-zero, for a
division by zero has a value in IEEE 754, and CasADi's branchless selection makes such values in the branch that is not
taken.  The compiler is wrapped, so that whatever the package compiles for a case (functions, drivers of single runs, of
ensembles, of derivatives, of equilibria, the loop) is compiled so; a report ends the process.

That they see each of these is shown by planting a fault: an access beyond an array in a copy of a source must end the
run with a report that names this source.
"""

from __future__ import annotations

import atexit
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

from ballpass.derive import generate
from ballpass.derive.scene.read import scene_from_text
from extremes.case import Case, Finding, run_case, select
from extremes.models import ROOT, text_of

GROUP = "Generated C"
METHOD = "sanitizers"
#: In the name of a case that the tour under sanitizers, beside this one, answers.
BESIDE = "inside Python"
FLAGS = "-O0 -g1 -fsanitize=address,undefined,float-cast-overflow -fno-sanitize-recover=all"
#: Entries of the drivers that the libraries compiled by the tour must hold.
ENTRIES = ("ballpass_run", "ballpass_run_tangents", "ballpass_ensemble", "ballpass_equilibria", "ballpass_loop")

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

#: An access one beyond an array on the stack, and one beyond memory that the caller gave.
BEYOND = "{ volatile double row[4]; for (volatile int k = 0; k <= 4; k++) row[k] = 0.0; }"
BEYOND_X = "((volatile double *)x)[{count}] = 0.0;"

RUN = "model.simulate(cycles=0.05, transient=0, outputs=[], method='stepper-{}')"
MANY = "model.simulate_many({{'bearing.clearance': [k * 1e-6 for k in range(9)]}}, ['max:ball.force'], cycles=0.1, "
MANY += "transient=0, method='{}')"
#: Sources, each with the function into which a fault is planted, the fault, and what runs it.
PLANTS: tuple[tuple[str, str, str, str], ...] = (
    ("stepper.c", "int ballpass_run", BEYOND_X.format(count="BP_NX"), RUN.format("dp54")),
    ("explicit.h", "bp_explicit_step", BEYOND, RUN.format("dop853")),
    ("rosenbrock.h", "bp_rosenbrock_step", BEYOND, RUN.format("rodas5p")),
    ("kernels.h", "bp_acceleration", BEYOND, RUN.format("dp54")),
    ("kinks.h", "bp_sides_start", BEYOND,
     "model.simulate(cycles=0.05, transient=0, outputs=[], method='stepper-dp54', kinks='located')"),
    ("reductions.h", "bp_reduce", BEYOND, "model.reduce(cycles=0.05, transient=0)"),
    ("ensemble.c", "int ballpass_ensemble", BEYOND_X.format(count="members * BP_NX"), MANY.format("stepper-dp54")),
    ("lanes.h", "bp_lane_linear_step", BEYOND, MANY.format("stepper-rodas5p")),
    ("sensitivity.h", "bp_rate_tangent", BEYOND, "model.sensitivities('bearing.clearance', cycles=0.05)"),
    ("equilibrium.c", "int ballpass_equilibria", BEYOND_X.format(count="BP_NX"),
     "model.simulate(cycles=0.05, transient=0, outputs=[], method='quasi-static')"),
    ("loop.c", "ballpass_loop", "((volatile double *)first_out[0])[count * stride_out[0]] = 0.0;",
     "model.simulate(cycles=0.05, transient=0, outputs=['drive_torque'])"),
    ("model.c", "int rhs", BEYOND, "model.kernel('rhs')({'t': 0.0, 'x': model.initial(), 'u': model.inputs_at(0.0),"
     " 'p': model.numbers().p, 'c': model.numbers().c})"),
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What the tour under sanitizers gave.

    Attributes
    ----------
    holding : cases that hold, by section
    failed : lines of those that do not
    libraries : number of those that were compiled
    entries : of `ENTRIES`, those that one of the libraries holds
    tail : end of what was said on stderr, where a report is
    finished : whether it came to its end
    seconds : it took
    """

    holding: Mapping[str, int]
    failed: tuple[str, ...]
    libraries: int
    entries: tuple[str, ...]
    tail: str
    finished: bool
    seconds: float


@cache
def _workshop() -> Path:
    """Folder with the wrapped compiler, and the cache of planted faults: what they have in common is compiled once."""
    folder = Path(tempfile.mkdtemp(prefix="ballpass-extremes-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def _environment(folder: Path, root: Path = ROOT) -> dict[str, str]:
    """Environment of a Python under sanitizers, its cache in `folder`, the package's sources those of `root`."""
    shim, source, compiler = folder / "shim.so", folder / "shim.c", folder / "cc"
    if not shim.exists():
        source.write_text(SHIM, encoding="utf-8")
        subprocess.run(("gcc", "-shared", "-fPIC", str(source), "-o", str(shim), "-ldl"), check=True)
        # behind the package's own flags, hence with the last word; the compiler itself needs no sanitizers
        compiler.write_text(f'#!/bin/sh\nunset LD_PRELOAD\nexec gcc "$@" {FLAGS}\n', encoding="utf-8")
        compiler.chmod(0o755)
    libraries = [
        subprocess.run(
            ("gcc", f"-print-file-name=lib{name}.so"), check=True, capture_output=True, text=True
        ).stdout.strip()
        for name in ("asan", "ubsan")
    ]
    return {
        **os.environ,
        "CC": str(compiler),
        "BALLPASS_CACHE_DIR": str(folder / "cache"),
        "ASAN_OPTIONS": "detect_leaks=0:verify_asan_link_order=0",  # Python leaves memory to the system when it ends
        "UBSAN_OPTIONS": "print_stacktrace=1",
        "LD_PRELOAD": ":".join((str(shim), *libraries)),
        "PYTHONPATH": os.pathsep.join(str(root / part) for part in ("derive", "runtime")),
    }


def able() -> bool:
    """Whether there is a gcc with both sanitizers."""
    return shutil.which("gcc") is not None and all(
        Path(
            subprocess.run(("gcc", f"-print-file-name=lib{name}.so"), check=True, capture_output=True, text=True)
            .stdout.strip()
        ).is_absolute()
        for name in ("asan", "ubsan")
    )  # fmt: skip


def run_tour(words: tuple[str, ...] = ()) -> Outcome:
    """Run all cases that are not `long`, or those with one of the words, in a Python under sanitizers."""
    started = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="ballpass-extremes-") as name:
        done = subprocess.run(
            (sys.executable, "-m", "extremes.sanitized", *words),
            cwd=ROOT, env=_environment(Path(name)), capture_output=True, text=True, check=False, timeout=3600,
        )  # fmt: skip
        contents = [path.read_bytes() for path in sorted((Path(name) / "cache").glob("*.so"))]
    # each library carries the sanitizers' calls
    assert all(b"__asan_report_" in content and b"__ubsan_handle_" in content for content in contents)
    lines = done.stdout.splitlines()
    ok = Counter(line.split("\t")[1] for line in lines if line.startswith("ok\t"))
    return Outcome(
        holding=dict(ok),
        failed=tuple(line for line in lines if line.startswith("FAIL\t")),
        libraries=len(contents),
        entries=tuple(entry for entry in ENTRIES if any(f"\0{entry}\0".encode() in content for content in contents)),
        tail=done.stderr[-4000:] or (lines[-1] if lines else ""),
        finished=bool(lines) and lines[-1] == "end",
        seconds=time.perf_counter() - started,
    )


@cache
def started() -> Future[Outcome]:
    """The tour under sanitizers, begun when first asked for: it runs beside the other cases on a second processor."""
    pool = ThreadPoolExecutor(max_workers=1)
    future = pool.submit(run_tour)
    pool.shutdown(wait=False)
    return future


def section(group: str) -> Finding:
    """The cases of a section under sanitizers."""
    if not able():
        return Finding(status="skipped: gcc's libasan and libubsan are not installed")
    outcome = started().result()
    assert outcome.finished, outcome.tail
    assert "runtime error" not in outcome.tail, outcome.tail
    assert not outcome.failed, "\n".join(outcome.failed)
    from extremes.tour import cases

    wanted = sum(case.group == group and not case.long for case in cases())
    left_out = sum(case.group == group and case.long for case in cases())
    assert outcome.holding.get(group, 0) == wanted, (outcome.holding, wanted)
    assert outcome.entries == ENTRIES, outcome.entries
    note = f"{wanted} cases" + (f", without {left_out} of millions of steps" if left_out else "")
    return Finding(status="done", error=0.0, bound=0.0, note=note)


def planted(source: str, function: str, fault: str, call: str) -> Finding:
    """A fault in a copy of a source: the report must come, and name the source."""
    if not able():
        return Finding(status="skipped: gcc's libasan and libubsan are not installed")
    with tempfile.TemporaryDirectory(prefix="ballpass-extremes-") as name:
        root = Path(name)
        shutil.copytree(ROOT / "runtime", root / "runtime", ignore=shutil.ignore_patterns("__pycache__"))
        os.symlink(ROOT / "derive", root / "derive")
        text = text_of("punching_press")
        folder = generate(scene_from_text(text, "punching_press"), root / "punching_press")
        own = root / "runtime" / "ballpass" / "runtime" / "driver" / source
        path = own if own.is_file() else folder / source
        code = path.read_text(encoding="utf-8")
        begin = re.search(rf"{function}\([^;{{}}]*\)\s*\{{", code)
        assert begin is not None, f"{source} has no function {function}"
        path.write_text(f"{code[: begin.end()]}\n{fault}\n{code[begin.end() :]}", encoding="utf-8")
        # the digests of the manifest are of the files without the fault
        program = (
            "import sys\nfrom ballpass.runtime import load\nmodel = load(sys.argv[1], verify=False)\n"
            f"{call}\nprint('survived')\n"
        )
        done = subprocess.run(
            (sys.executable, "-c", program, str(folder)), cwd=root, env=_environment(_workshop(), root),
            capture_output=True, text=True, check=False, timeout=600,
        )  # fmt: skip
    said = done.stderr
    assert done.returncode != 0, "the fault was not seen"
    assert "survived" not in done.stdout, "the fault was not seen"
    report = re.search(r"ERROR: AddressSanitizer: (\S+)|runtime error: (index \S+ out of bounds)", said)
    assert report is not None, said[-3000:]
    assert re.search(rf"{re.escape(source)}:\d+", said), said[-3000:]
    return Finding(status=f"caught: {report[1] or report[2]}", note=f"in {function.split()[-1]}")


def cases() -> list[Case]:
    """The tour under sanitizers, and what shows that they see."""
    found = [
        Case(group=GROUP, name=f"planted fault in {plant[0]}", method=METHOD, against="a report that names it",
             run=partial(planted, *plant))
        for plant in PLANTS
    ]  # fmt: skip
    sections = ("Physics", "Invariants", "Methods", "Other drivers", "Conditioning")
    found += [
        Case(group=GROUP, name=f"section {group} {BESIDE}", method=METHOD, against="no report",
             run=partial(section, group))
        for group in sections
    ]  # fmt: skip
    return found


def main() -> None:
    """Run the cases in this process, a line for each; whoever called has set the environment."""
    from extremes.tour import cases as every

    for case in select(every(), sys.argv[1:]):
        if case.group == GROUP or case.long:
            continue
        row = run_case(case)
        fault = "" if row.holds else (row.fault or f"error {row.finding}").replace("\n", " | ")[-600:]
        print("ok" if row.holds else "FAIL", case.group, case.name, case.method, f"{row.seconds:.2f}", fault, sep="\t",
              flush=True)  # fmt: skip
    print("end", flush=True)


if __name__ == "__main__":
    main()
