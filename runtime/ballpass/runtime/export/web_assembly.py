"""The exported C program as a WebAssembly module, which a page runs: any browser, any processor, the same numbers.

In: a generated folder's model.  Out: bytes of the module.  ``ballpass.h`` is its interface, and ``page.c``.
"""

from __future__ import annotations

import casadi

from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.export.c_program import PROGRAM_ONLY, program_texts
from ballpass.runtime.export.scene_numbers import MOMENT, STANDALONE, behind, moment_symbols
from ballpass.runtime.export.targets import compiled
from ballpass.runtime.native.compilers import ZIG, need_zig
from ballpass.runtime.native.driver_library import DRIVER
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.reduction_rows import REDUCTION_TABLES, reduction_tables
from ballpass.runtime.point.jacobian import rows_of
from ballpass.runtime.quantity.cuts import PLACES
from ballpass.runtime.ratings.of_bearing import rated_element, ratings_of

#: What a page calls; memory for what it reads is the module's.
CALLED = (
    *(f"ballpass_{name}" for name in ("make", "value", "set_at", "start", "run_to", "rows", "error")),
    *(f"ballpass_{name}" for name in ("stop", "values", "ratings", "next_switch", "turns", "after")),
    *(f"ballpass_{name}" for name in ("state_size", "save", "restore", "reduce")),
    "malloc",
)

#: As the driver is compiled elsewhere, but for what belongs to processors; zig has one level above -O1.
_FLAGS = (
    *("-target", "wasm32-wasi", "-mexec-model=reactor", "-O3", "-msimd128"),
    *("-std=c99", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math", "-fopenmp-simd"),
    "-DBALLPASS_REDUCTIONS",
    *("-Wl,--strip-all", *(f"-Wl,--export={name}" for name in CALLED)),
)


def check_compiler() -> None:
    """Refuse with a `RequestError` where the compiler for WebAssembly is missing."""
    need_zig("A page with the solver in it")


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
    texts = {name: text for name, text in program_texts(symbolic).items() if name not in PROGRAM_ONLY}
    texts |= {name: (STANDALONE / name).read_text(encoding="utf-8") for name in ("page.c", "simulation.h")}
    texts |= {name: (DRIVER / name).read_text(encoding="utf-8") for name in ("reductions.h", "powers.h")}
    texts[REDUCTION_TABLES] = reduction_tables()
    texts["drawn.c"] = behind("What a page draws", _drawn(symbolic), "scene_drawn", MOMENT, "y")
    texts["ratings.c"] = behind("Ratings of the bearings", _ratings(symbolic), "scene_ratings", MOMENT[-2:], "y")
    sources = sorted(file for file in texts if file.endswith(".c"))
    command = (*ZIG, *_FLAGS, *sources, "-o", "model.wasm")
    shown = " ".join(("python -m ziglang cc", *_FLAGS, *sources, "-o model.wasm"))
    return compiled(command, shown, texts, "model.wasm")


def drawn_columns(manifest: Manifest) -> tuple[int, int, int, int]:
    """How many numbers a row has behind its columns: points, angles of cages, these as rings see them, inputs.

    Those of a ring are of ball 1 as the ring sees it: of each bearing the outer, then the inner one.
    """
    points = 0 if manifest.mechanism is None else 2 * len(manifest.mechanism.points)
    return points, len(manifest.bearings), 2 * len(manifest.bearings), len(manifest.inputs)


def _drawn(model: LoadedModel) -> casadi.Function:
    """What `drawn_columns` counts, one below the other, over t, x, u, p and c."""
    manifest = model.manifest
    given = moment_symbols(manifest)
    points, cages, *_ = drawn_columns(manifest)

    def values(name: str) -> casadi.SX:
        function = model.symbolic(name)
        return casadi.densify(function(*(given[argument] for argument in function.name_in())))

    rows = [values(name) for name, count in (("geometry", points), ("cages", cages)) if count]
    seen = [f"{bearing.prefix}{place}" for bearing in manifest.bearings for place in PLACES]
    rows += [values(part.function)[part.indices.tolist()] for name in seen for part in rows_of(model, name)]
    return casadi.Function("drawn", [*given.values()], [casadi.vertcat(*rows, given["u"])], [*given], ["y"])


def _ratings(model: LoadedModel) -> casadi.Function:
    """Q_ci and Q_ce of every bearing, one below the other, over p and c; 0 of one that no standard rates."""
    manifest = model.manifest
    names = {"p": [info.name for info in manifest.parameters], "c": [info.name for info in manifest.constants]}
    given = {kind: casadi.SX.sym(kind, len(some)) for kind, some in names.items()}
    known = {name: given[kind][k] for kind, some in names.items() for k, name in enumerate(some)}
    rows: list[casadi.SX | float] = []
    for bearing in manifest.bearings:
        found = None if rated_element(bearing).unrated else ratings_of(bearing, known)
        rows += [0.0, 0.0] if found is None else [found.inner_ball, found.outer_ball]
    return casadi.Function("ratings", [*given.values()], [casadi.vertcat(*rows)], [*given], ["y"])
