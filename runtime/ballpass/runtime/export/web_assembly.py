"""The exported C program as a WebAssembly module, which a page runs: any browser, any processor, the same numbers.

In: a generated folder's model.  Out: bytes of the module.  ``ballpass.h`` is its interface, and ``page.c``.
"""

from __future__ import annotations

import importlib.util
import sys
import tempfile
from pathlib import Path

import casadi

from ballpass.runtime.contract import Manifest
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.extras import can_derive
from ballpass.runtime.export.c_program import program_texts
from ballpass.runtime.export.scene_numbers import MOMENT, STANDALONE, behind
from ballpass.runtime.native.compilers import run_compiler
from ballpass.runtime.native.loaded_model import LoadedModel

#: What a page calls; memory for what it reads is the module's.
CALLED = (
    *(f"ballpass_{name}" for name in ("make", "value", "set_at", "start", "run_to", "read", "error")),
    *(f"ballpass_{name}" for name in ("stop", "values", "drawn", "next_switch", "state_size", "save", "restore")),
    "malloc",
)

#: As the driver is compiled elsewhere, but for what belongs to processors; zig has one level above -O1.
_FLAGS = (
    *("-target", "wasm32-wasi", "-mexec-model=reactor", "-O3", "-msimd128"),
    *("-std=c99", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math", "-fopenmp-simd"),
    *("-Wl,--strip-all", *(f"-Wl,--export={name}" for name in CALLED)),
)


def check_compiler() -> None:
    """Refuse with a `RequestError` where the compiler for WebAssembly is missing."""
    if importlib.util.find_spec("ziglang") is None:
        target = "ballpass[compiler]" if can_derive() else "ziglang"
        raise RequestError(
            "A page with the solver in it needs a compiler for WebAssembly, ziglang, which is not installed; gcc and "
            f'clang of a system do not bring its libraries. Install it from PyPI: pip install "{target}".'
        )


def web_assembly(model: LoadedModel) -> bytes:
    """The module of a model; a first one takes a minute, for the compiler builds its libraries.

    Raises
    ------
    RequestError
        The compiler is missing; the model has no states.
    CompileError
        It failed.
    """
    check_compiler()
    symbolic = LoadedModel(model.folder, model.manifest, None)
    texts = {name: text for name, text in program_texts(symbolic).items() if name.endswith((".c", ".h"))}
    texts = {name: text for name, text in texts.items() if name not in ("main.c", "example.c")}
    texts["page.c"] = (STANDALONE / "page.c").read_text(encoding="utf-8")
    texts["simulation.h"] = (STANDALONE / "simulation.h").read_text(encoding="utf-8")
    texts["drawn.c"] = behind("What a page draws", _drawn(symbolic), "scene_drawn", MOMENT, "y")
    with tempfile.TemporaryDirectory(prefix="ballpass-") as name:
        folder = Path(name)
        for file, text in texts.items():
            (folder / file).write_text(text, encoding="utf-8", newline="\n")
        sources = sorted(file for file in texts if file.endswith(".c"))
        command = (sys.executable, "-m", "ziglang", "cc", *_FLAGS, *sources, "-o", "model.wasm")
        run_compiler(command, folder, " ".join(("python -m ziglang cc", *_FLAGS, *sources, "-o model.wasm")))
        return (folder / "model.wasm").read_bytes()


def drawn_columns(manifest: Manifest) -> tuple[int, int, int]:
    """How many numbers `ballpass_drawn` gives: coordinates of points, angles of cages, inputs."""
    points = 0 if manifest.mechanism is None else 2 * len(manifest.mechanism.points)
    return points, len(manifest.bearings), len(manifest.inputs)


def _drawn(model: LoadedModel) -> casadi.Function:
    """Points, angles of the cages and inputs, one below the other, over t, x, u, p and c."""
    manifest = model.manifest
    sizes = {
        "t": 1,
        "x": len(manifest.states),
        "u": len(manifest.inputs),
        "p": len(manifest.parameters),
        "c": len(manifest.constants),
    }
    given = {name: casadi.SX.sym(name, size) for name, size in sizes.items()}
    points, cages, _ = drawn_columns(manifest)
    rows = []
    for name, count in (("geometry", points), ("cages", cages)):
        if count:
            function = model.symbolic(name)
            rows.append(casadi.densify(function(*(given[argument] for argument in function.name_in()))))
    return casadi.Function("drawn", [*given.values()], [casadi.vertcat(*rows, given["u"])], [*given], ["y"])
